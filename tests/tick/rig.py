"""A control tick on a bench: a device of any axes, walls, a law, and positions played to it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from types import ModuleType
from typing import Any

from hapticd.config.models import SceneConfig, VelocityConfig
from hapticd.config.safety import SafetyConfig
from hapticd.device import DeviceInfo, Sample
from hapticd.law import LawParams
from hapticd.tick.contact import RunningLaw
from hapticd.tick.guard import Guard
from hapticd.tick.record import RecordLayout
from hapticd.tick.tick import ControlTick
from hapticd_controllers import none

PERIOD_S = 1e-3
LIMIT_N = 12.0
RAMP_TICKS = 50

Step = Callable[[Any, Any, Any], Any]


class NoParams(LawParams):
    """Nothing to set."""


def law(
    step: Step, start: Callable[[Any, Any, Any], None] | None = None, fields: dict[str, type] | None = None
) -> ModuleType:
    """A law made of functions."""
    module = ModuleType("tests.some_law")
    module.__dict__.update(
        Params=NoParams,
        State=type("State", (), {"__annotations__": fields or {}}),
        start=start or (lambda _state, _params, _snapshot: None),
        step=step,
    )
    return module


def returns(value: Any) -> Step:
    """A step that always returns this."""
    return lambda _state, _params, _tick: value


def pushes(newton: float) -> ModuleType:
    """A law that asks for the same force in every contact."""
    return law(returns(newton))


def wall(stiffness_n_per_m: float = 2000.0, axis: str = "z", **keys: Any) -> dict[str, Any]:
    return {"axis": axis, "stiffness_n_per_m": stiffness_n_per_m, **keys}


def scene(*walls: dict[str, Any]) -> SceneConfig:
    return SceneConfig.model_validate({"walls": list(walls)})


def running(module: ModuleType) -> Callable[[], RunningLaw]:
    return lambda: RunningLaw(module, module.Params())


def device(axes: str = "z", **declared: Any) -> DeviceInfo:
    fields: dict[str, Any] = {
        "model": "a device",
        "serial": "",
        "axes": tuple(axes),
        "max_force_n": LIMIT_N,
        "resolution_m": 0.0,
        "workspace_m": ((-0.1, 0.1),) * len(axes),
        "nominal_rate_hz": 1000.0,
        "safe_damping_n_s_per_m": 10.0,
        "host_silence_ms": 0.0,
        **declared,
    }
    return DeviceInfo(**fields)


class Rig:
    """A tick, started outside all walls and armed unless told otherwise."""

    def __init__(
        self,
        *walls: dict[str, Any],
        axes: str = "z",
        module: ModuleType = none,
        at_m: float = 0.05,
        arm: bool = True,
        velocity: VelocityConfig | None = None,
        safety: dict[str, Any] | None = None,
        **declared: Any,
    ) -> None:
        info = device(axes, **declared)
        config = SafetyConfig.model_validate({"max_speed_m_per_s": 100.0, **(safety or {})})
        self.tick = ControlTick(
            scene(*walls),
            velocity or VelocityConfig(),
            Guard(config, info),
            info,
            running(module),
            PERIOD_S,
            config.ramp_s,
        )
        self.sample = Sample(len(axes))
        self.sample.position_m[:] = [at_m] * len(axes)
        self.tick.start(self.sample)
        self.layout = RecordLayout(len(axes), False, 8)
        self.energy_j = 0.0
        if arm:
            assert self.tick.arm()

    def switch(self, *what: Any, **named: Any) -> None:
        """Take another scene, limits or law, without a tick in between."""
        for _ in self.tick.switch(*what, **named):
            pass

    def at(self, *position_m: float, ticks: int = 1, dt_s: float = PERIOD_S) -> list[list[float]]:
        """Tick with the device at a position; the written forces."""
        written = []
        for _ in range(ticks):
            self.sample.position_m[:] = position_m
            self.sample.time_ns += round(dt_s * 1e9)
            self.sample.sequence += 1
            here_m = self.tick.motion.position_m  # always the same list
            before_m, before_n = list(here_m), list(self.tick.force_n)
            written.append(list(self.tick.advance(self.sample, dt_s)))
            self.energy_j -= sum(
                newton * (now - was) for newton, now, was in zip(before_n, here_m, before_m, strict=True)
            )
        return written

    def force(self, *position_m: float, ticks: int = 1, dt_s: float = PERIOD_S) -> float:
        """The same for a device with one axis: the last force."""
        return self.at(*position_m, ticks=ticks, dt_s=dt_s)[-1][0]

    def forces(self, position_m: float, ticks: int) -> list[float]:
        """Forces of a device with one axis that stands still."""
        return [force_n[0] for force_n in self.at(position_m, ticks=ticks)]

    @property
    def books_j(self) -> tuple[float, float, float, float]:
        """Energy, stored, dissipated and generated, over walls that are there, leaving and gone."""
        ledgers = [contact.ledger for contact in (*self.tick.contacts, *self.tick.leaving)] + [self.tick.past]
        return (
            math.fsum(ledger.energy_j for ledger in ledgers),
            math.fsum(ledger.stored_j for ledger in ledgers),
            math.fsum(ledger.dissipated_j for ledger in ledgers),
            math.fsum(ledger.generated_j for ledger in ledgers),
        )


def largest_step(forces_n: list[float]) -> float:
    return max(abs(b - a) for a, b in itertools.pairwise(forces_n))
