"""The scene of docs/examples/simulator on the simulated device, without a daemon: each tick and each step in its place.

A simulator needs time: what it makes of the state of a tick is in force `LATER_TICKS` later.
"""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import hapticd
from hapticd.offline.rehearsal import Rehearsal
from hapticd.tick.remote.update import POSITION, Update

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "simulator"
LATER_TICKS = 2
TICK_S = 1e-3
WINDOW_TICKS = 250
SMOOTH_TICKS = 50


def example() -> Any:
    """The module `coupled.py`."""
    spec = importlib.util.spec_from_file_location("coupled", EXAMPLE / "coupled.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def config(law: str = "") -> hapticd.LoadedConfig:
    """The example's configuration, under the default law of couplings or another one."""
    loaded = hapticd.load(EXAMPLE / "scene.toml")
    return loaded.with_values({"remote.law": law}) if law else loaded


@dataclass(frozen=True)
class Session:
    """What happened, an element a tick.

    Attributes:
        device_m, peg_m, ball_m: where they were, three each.
        drawer_m: how far it was in.
        force_n: on the device, three.
    """

    device_m: npt.NDArray[np.float64]
    peg_m: npt.NDArray[np.float64]
    ball_m: npt.NDArray[np.float64]
    drawer_m: npt.NDArray[np.float64]
    force_n: npt.NDArray[np.float64]

    @property
    def hum_m(self) -> float:
        """How much the device swings about its own mean of 50 ms, in the usual quarter second [m]."""
        return hum_m(self.device_m)


def hum_m(position_m: npt.NDArray[np.float64]) -> float:
    """How much a device swings about its own mean of 50 ms, in the usual quarter second [m].

    Args:
        position_m: a row a tick of a millisecond.
    """
    mean = np.ones(SMOOTH_TICKS) / SMOOTH_TICKS
    smooth = np.stack([np.convolve(axis, mean, "same") for axis in position_m.T], axis=1)
    squared = np.sum((position_m - smooth)[SMOOTH_TICKS:-SMOOTH_TICKS] ** 2, axis=1)
    windows = squared[: len(squared) // WINDOW_TICKS * WINDOW_TICKS].reshape(-1, WINDOW_TICKS)
    return float(np.median(np.sqrt(windows.mean(axis=1))))


class _Stepped:
    """The simulator beside the ticks: steps when it is due, and its pose arrives later."""

    def __init__(self, rate_hz: float, peg_m: Any) -> None:
        self.scene = example().Scene(rate_hz, peg_m)
        self._rate_hz = rate_hz
        self._steps = 0
        self._arriving: list[tuple[int, list[float]]] = []

    def is_due(self, tick: int) -> bool:
        """Whether a step begins after this tick."""
        return (tick + 1) * TICK_S >= (self._steps + 1) / self._rate_hz - 1e-9

    def step(self, tick: int, force_n: Any) -> None:
        """Step under a force on the device."""
        self._steps += 1
        self._arriving.append((tick + LATER_TICKS, self.scene.step(force_n)))

    def arrived(self, tick: int) -> list[float] | None:
        """The pose that has just come."""
        if self._arriving and tick >= self._arriving[0][0]:
            return self._arriving.pop(0)[1]
        return None

    def seen(self) -> list[float]:
        """Peg, ball and drawer."""
        data = self.scene.data
        return [*data.qpos[:3], *data.body("ball").xpos, data.joint("drawer").qpos[0]]


def coupled(rate_hz: float, duration_s: float, law: str = "") -> Session:
    """The example: mean force over each step to the peg, its pose to a coupling of hapticd.

    Args:
        rate_hz: of the simulator.
        duration_s: how long.
        law: of couplings, another one than the default.
    """
    rehearsal = Rehearsal(config(law))
    device, port = rehearsal.space, rehearsal.tick.ports[0]
    assert device is not None
    stepped = _Stepped(rate_hz, device.position_m)
    update = Update()
    update.said = POSITION
    before, since = [0.0, 0.0, 0.0], -1
    rows = []
    for tick in rehearsal.run(round(duration_s / TICK_S)):
        pose_m = list(device.position_m) if tick == 0 else stepped.arrived(tick)
        if pose_m is not None:
            update.seq += 1
            update.stamp(POSITION, update.seq)
            update.position_m[:] = pose_m
            port.take(update)
        if stepped.is_due(tick):
            impulse = list(port.impulse_n_s)
            stepped.step(tick, [(a - b) / ((tick - since) * TICK_S) for a, b in zip(impulse, before, strict=True)])
            before, since = impulse, tick
        rows.append([*device.position_m, *stepped.seen(), *rehearsal.tick.force_n])
    assert rehearsal.fault is None
    return _session(rows)


def plain(rate_hz: float, duration_s: float, damping_n_s_per_m: float = 0.0) -> Session:
    """What one writes first: the pose is held, the last force goes to the peg, and there is no law.

    Args:
        rate_hz: of the simulator.
        duration_s: how long.
        damping_n_s_per_m: of a damper beside the spring.
    """
    loaded = config()
    limits = loaded.config.scene.couplings[0]
    device = Rehearsal(loaded).space
    assert device is not None
    stepped = _Stepped(rate_hz, device.position_m)
    target_m = last_m = np.array(device.measured_m)
    rows = []
    for tick in range(round(duration_s / TICK_S)):
        pose_m = stepped.arrived(tick)
        if pose_m is not None:
            target_m = np.array(pose_m)
        at_m = np.array(device.measured_m)
        force_n = limits.stiffness_n_per_m * (target_m - at_m) - damping_n_s_per_m * (at_m - last_m) / TICK_S
        force_n *= min(1.0, limits.max_force_n / max(float(np.linalg.norm(force_n)), 1e-9))
        last_m = at_m
        device.advance(force_n.tolist())
        if stepped.is_due(tick):
            stepped.step(tick, force_n)
        rows.append([*device.position_m, *stepped.seen(), *force_n])
    return _session(rows)


def _session(rows: list[list[float]]) -> Session:
    table = np.array(rows)
    return Session(table[:, 0:3], table[:, 3:6], table[:, 6:9], table[:, 9], table[:, 10:13])
