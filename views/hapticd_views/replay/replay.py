"""One recorded hand, several laws, side by side."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hapticd.config.loading import LoadedConfig, load
from hapticd.errors import ConfigError, HapticdError
from hapticd.offline.rehearsal import rehearse, simulation_options
from hapticd.plugins import CONTROLLERS, names
from hapticd.simulation.options import SimulationOptions
from hapticd_views.recording import read
from hapticd_views.replay.begun import begun
from hapticd_views.replay.hand import HandForce, identify
from hapticd_views.replay.motion import replay_motion
from hapticd_views.replay.scores import Score, Trace, score, table
from hapticd_views.replay.stretch import Stretch, longest_stretch

BANDWIDTH_HZ = 10.0
"""Up to where the force of the hand is followed unless told otherwise [Hz]: a hand means to do nothing faster."""

HANDS = ("force", "motion")
"""What of the hand is replayed."""

_CAVEATS = {
    "force": "the hand's force is replayed, identified up to {bandwidth_hz:g} Hz with the device model: the loop is "
    "closed, but the hand does not answer to the other motion",
    "motion": "the motion is replayed: the device moves as it was recorded whatever the law does, so this says what a "
    "law answers and not what would have come of it",
}


@dataclass(frozen=True, eq=False)
class Replay:
    """What every law made of one hand.

    Attributes:
        file: the recording.
        hand: "force" or "motion".
        caveat: what this can and cannot show.
        first_s, duration_s: which part of the recording [s].
        in_contact: it begins inside a wall, where laws start with a ramp.
        learned: the recorded law began with a damping that the same law has not where it is replayed.
        period_s: time between ticks [s].
        force_n: of the hand, > 0 outwards; None for a motion [N].
        traces: what was recorded first, then each law.
        scores: a row each.
    """

    file: Path
    hand: str
    caveat: str
    first_s: float
    duration_s: float
    in_contact: bool
    learned: bool
    period_s: float
    force_n: Any
    traces: tuple[Trace, ...]
    scores: tuple[Score, ...]

    @property
    def lines(self) -> list[str]:
        """The table, and what to know of it."""
        part = f"{self.file}: {self.duration_s:.3f} s from {self.first_s:.3f} s on"
        begins = ["it begins in contact, where every law starts with a ramp"] if self.in_contact else []
        if self.learned:
            begins.append("the recorded law had learned its damping before, and a replayed one begins without any")
        return [part, self.caveat, *begins, *table(self.scores)]

    @property
    def summary(self) -> dict[str, Any]:
        """The same for programs; null for what there is not."""
        rows = [
            {key: None if isinstance(value, float) and math.isnan(value) else value for key, value in row.items()}
            for row in map(dataclasses.asdict, self.scores)
        ]
        return {
            "file": str(self.file),
            "hand": self.hand,
            "caveat": self.caveat,
            "first_s": self.first_s,
            "duration_s": self.duration_s,
            "in_contact": self.in_contact,
            "learned": self.learned,
            "laws": rows,
        }

    @property
    def columns(self) -> dict[str, Any]:
        """Columns for a figure: t_s, hand_n, and for each law `LAW.x_m` and so on; NaN behind the end of a run."""
        count = len(self.traces[0].x_m)
        found = {"t_s": np.arange(count) * self.period_s}
        if self.force_n is not None:
            found["hand_n"] = self.force_n
        for trace in self.traces:
            for name, values in trace.columns().items():
                whole = np.full(count, np.nan)
                whole[: len(values)] = values
                found[f"{trace.law}.{name}"] = whole
        return found


def replay(
    file: Path,
    config: Path | None = None,
    laws: Sequence[str] = (),
    hand: str = "force",
    duration_s: float | None = None,
    bandwidth_hz: float = BANDWIDTH_HZ,
    progress: Callable[[int], object] | None = None,
) -> Replay:
    """Put a recorded hand under other laws.

    Args:
        file: a recording.
        config: device, walls, limits and the parameters of its own law; None: those that were recorded.
        laws: names; none or "all": every installed one. Another than the configuration's own has its defaults.
        hand: "force": that of the hand, identified, on the simulated device; "motion": as it was recorded.
        duration_s: how much of the recording at most [s].
        bandwidth_hz: up to where the force of the hand is followed.
        progress: hears how many laws are done.

    Raises:
        ConfigError: a configuration, law or option that cannot be used.
        HapticdError: there is nothing to replay.
    """
    if hand not in HANDS:
        raise ConfigError(f"--hand {hand}: must be {' or '.join(HANDS)}")
    recording = read(file)
    stretch = longest_stretch(recording, duration_s)
    own = stretch.config if config is None else load(config)
    if not own.config.scene.walls:
        raise ConfigError(f"{own.path}: has no wall to replay against")
    period_s = own.config.loop.period_s
    if abs(period_s * stretch.receipt["rate_hz"] - 1.0) > 1e-9:
        raise ConfigError(
            f"{own.path}: loop.rate_hz = {own.config.loop.rate_hz:g}: {file} was recorded at "
            f"{stretch.receipt['rate_hz']:g} Hz"
        )
    recorded = _recorded(stretch, own)
    force = None
    if hand == "force":
        device = _device(own)
        force = identify(recorded.x_m, recorded.force_n, device, period_s, bandwidth_hz)
    traces = [recorded]
    for done, law in enumerate(_laws(laws, own)):
        changed = own if law == own.config.controller.law else own.with_values({"controller.law": law})
        if config is None:
            changed = begun(recording, stretch, changed)
        made = replay_motion(stretch, changed) if force is None else _closed(changed, force, device, period_s)
        traces.append(made)
        if progress is not None:
            progress(done + 1)
    return Replay(
        file=file,
        hand=hand,
        caveat=_CAVEATS[hand].format(bandwidth_hz=bandwidth_hz),
        first_s=stretch.first_s,
        duration_s=len(stretch) * period_s,
        in_contact=stretch.in_contact,
        learned=any(
            one.law == stretch.receipt["law"] and one.damping_n_s_per_m[0] != recorded.damping_n_s_per_m[0]
            for one in traces[1:]
        ),
        period_s=period_s,
        force_n=None if force is None else force.force_n,
        traces=tuple(traces),
        scores=tuple(score(trace, recorded, period_s) for trace in traces),
    )


def laws_of(laws: Sequence[str]) -> list[str]:
    """Names of laws, each once; none or "all" stands for every installed one."""
    if not laws or "all" in laws:
        return names(CONTROLLERS)
    return list(dict.fromkeys(laws))


def _laws(laws: Sequence[str], own: LoadedConfig) -> list[str]:
    """The configuration's own law first, where it is among them."""
    found = laws_of(laws)
    return sorted(found, key=lambda law: (law != own.config.controller.law, found.index(law)))


def _device(config: LoadedConfig) -> SimulationOptions:
    try:
        return simulation_options(config)
    except ConfigError as error:
        raise ConfigError(
            f"{error}; name a --config with a model of the device, or replay the motion: --hand motion"
        ) from None


def _closed(config: LoadedConfig, force: HandForce, device: SimulationOptions, period_s: float) -> Trace:
    """The simulated device with this hand under a law."""
    run = rehearse(replace(config, options=device), len(force.force_n) * period_s, force.on(device, period_s))
    columns = run.columns
    return Trace(
        law=config.config.controller.law,
        x_m=columns["x_m"],
        force_n=columns["force_n"],
        force_requested_n=columns["force_requested_n"],
        energy_j=columns["energy_j"],
        damping_n_s_per_m=columns["damping_n_s_per_m"],
        in_contact=columns["in_contact"],
        generated_j=run.generated_j,
        dissipated_j=run.dissipated_j,
        fault=run.fault or "",
    )


def _recorded(stretch: Stretch, config: LoadedConfig) -> Trace:
    """What was recorded, along the first wall of the configuration."""
    wall = config.config.scene.walls[0]
    axes = stretch.receipt["axes"]
    if len(axes) > 1 and wall.axis not in axes:
        raise HapticdError(
            f"{config.path}: scene.walls[0].axis = {wall.axis!r}: the recorded device has {', '.join(axes)}"
        )
    axis = axes.index(wall.axis) if len(axes) > 1 else 0
    outward = 1.0 if wall.free_side == "positive" else -1.0
    ticks = stretch.ticks
    count = len(stretch)
    found = Trace(
        law="recorded",
        x_m=outward * (ticks["position_m"][:, axis] - wall.position_m),
        force_n=outward * ticks["force_n"][:, axis],
        force_requested_n=outward * ticks["force_requested_n"][:, axis],
        energy_j=ticks["energy_j"] - ticks["energy_j"][0] if "energy_j" in ticks else np.full(count, np.nan),
        damping_n_s_per_m=ticks["damping_n_s_per_m"][:, 0],
        in_contact=ticks["in_contact"][:, 0],
    )
    if "generated_j" in ticks:
        found.generated_j = float(ticks["generated_j"][-1] - ticks["generated_j"][0])
        found.dissipated_j = float(ticks["dissipated_j"][-1] - ticks["dissipated_j"][0])
    return found
