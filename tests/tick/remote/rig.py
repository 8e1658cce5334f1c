"""A tick with ports and no client but the test: positions and updates in, forces and books out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import count
from typing import Any

import pytest

from hapticd.config.loading import LoadedConfig, parse
from hapticd.device import DeviceInfo, Sample
from hapticd.tick.assemble import make_tick
from hapticd.tick.contact import Contact, RunningLaw
from hapticd.tick.remote.port import Port
from hapticd.tick.remote.update import (
    DAMPING,
    FORCE,
    ORIENTATION,
    POSITION,
    RELEASED,
    STIFFNESS,
    TURNING,
    VELOCITY,
    Update,
)
from tests.tick.rig import law

PERIOD_S = 1e-3
RAMP_S = 0.05
MOST_N = 6.0
COUPLING = f"""
[[scene.couplings]]
name = "tool"
stiffness_n_per_m = 2000.0
damping_n_s_per_m = 5.0
max_force_n = {MOST_N}
"""
PROMPT = "come_in_s = 0.0\n"
"""Of a coupling: it comes in by the ramp alone."""
FORCE_PORT = """
[[scene.forces]]
name = "field"
max_force_n = 3.0
"""
WALL = '[[scene.walls]]\naxis = "x"\nposition_m = 0.0\nstiffness_n_per_m = 3000.0\n'

_NOW_NS = count()
_BITS = {
    "position_m": POSITION,
    "orientation": ORIENTATION,
    "velocity_m_per_s": VELOCITY,
    "angular_velocity_rad_per_s": TURNING,
    "stiffness_n_per_m": STIFFNESS,
    "damping_n_s_per_m": DAMPING,
    "force_n": FORCE,
}


def device(axes: str = "x", **declared: Any) -> DeviceInfo:
    fields: dict[str, Any] = {
        "model": "bench",
        "serial": "",
        "axes": tuple(axes),
        "max_force_n": 12.0,
        "resolution_m": 0.0,
        "workspace_m": ((-1.0, 1.0),) * len(axes),
        "nominal_rate_hz": 1000.0,
        "safe_damping_n_s_per_m": 10.0,
        "host_silence_ms": 0.0,
        "simulated": True,
        "has_clock": True,
    }
    return DeviceInfo(**{**fields, **declared})


def update(seq: int = 0, released: bool = False, **said: Any) -> Update:
    """What a client says: vectors as long as the device has axes."""
    made = Update()
    made.seq = seq
    made.stamp(-1, next(_NOW_NS))
    for name, value in said.items():
        made.said |= _BITS[name]
        if isinstance(value, float):
            setattr(made, name, value)
        else:
            getattr(made, name)[: len(value)] = value
    if released:
        made.said |= RELEASED
    return made


class Metered:
    """A law that leaves a contact its own force, and adds up the work of the force that was applied.

    Args:
        contact: gets it.

    Attributes:
        taken_j: work into the contact so far [J].
    """

    def __init__(self, contact: Contact) -> None:
        self.taken_j = 0.0
        module = law(self._step)
        contact.law = RunningLaw(module, module.Params())

    def _step(self, _state: Any, _params: Any, tick: Any) -> float:
        self.taken_j -= tick.applied_n * tick.moved_m
        assert tick.applied_contact_n == pytest.approx(tick.applied_n)
        return float(tick.contact_n)


class Rig:
    """A tick that is shown positions and told updates, and the work of the forces that it gave.

    Between two samples the device has moved evenly, a tick like the next.
    """

    def __init__(
        self, scene: str = COUPLING, law: str = "none", axes: str = "x", arm: bool = True, safety: str = "", **info: Any
    ) -> None:
        self.law, self.safety = law, safety
        self.loaded = self._load(scene, law)
        self.tick = make_tick(self.loaded, device(axes, **info))
        self.sample = Sample(len(axes))
        self.at = [0.0] * len(axes)
        self.force: list[float] = [0.0] * len(axes)
        self.pulled: list[list[float]] = []  # forces since the last sample, up to the last tick
        self.energy_j = 0.0
        self.seq = 0
        self.tick.start(self.sample)
        if arm:
            assert self.tick.arm()

    def __getitem__(self, name: str) -> Any:
        """The port of this name."""
        return next(port for port in self.tick.ports if port.name == name)

    @property
    def ports(self) -> list[Port]:
        return self.tick.ports

    def say(self, name: str, **said: Any) -> None:
        """Have a client say something of a port."""
        self.seq += 1
        self[name].take(update(self.seq, **said))

    def go(self, at: Sequence[float] | None = None, ticks: int = 1, dt_s: float = PERIOD_S) -> list[float]:
        """Be somewhere for some ticks; the force."""
        for _ in range(ticks):
            if at is not None:
                moved = [to - of for to, of in zip(at, self.at, strict=True)]
                pulled = [*self.pulled, self.force]
                self.energy_j -= sum(f * m for each in pulled for f, m in zip(each, moved, strict=True)) / len(pulled)
                self.at = list(at)
            self.pulled = []
            self.sample.position_m[:] = self.at
            self.sample.time_ns += round(dt_s * 1e9)
            self.sample.sequence += 1
            self.force = list(self.tick.advance(self.sample, dt_s))
        return self.force

    def repeat(self, ticks: int = 1) -> list[float]:
        """Have the device say nothing new for some ticks; the force."""
        for _ in range(ticks):
            self.pulled.append(self.force)
            self.force = list(self.tick.advance(self.sample, PERIOD_S))
        return self.force

    def switch(self, scene: str | None = None, law: str | None = None) -> None:
        """Reload another scene, or another law, without a tick in between."""
        loaded = self._load(scene or "", law or self.law)
        make = (lambda: RunningLaw(loaded.law, loaded.params)) if law else None
        for _ in self.tick.switch(None if scene is None else loaded.config.scene, loaded.config.safety, make):
            pass

    def unbalanced_j(self) -> float:
        """How far the books are off: what flowed in, and what became of it."""
        totals = self.tick.totals()
        ledger = totals.ledger
        became = ledger.stored_j + ledger.dissipated_j - ledger.generated_j - totals.moved_j
        return max(abs(self.energy_j - became), abs(self.energy_j - ledger.energy_j))

    def _load(self, scene: str, law: str) -> LoadedConfig:
        laws = f'[controller]\nlaw = "{law}"\n[remote]\nlaw = "{law}"\n'
        return parse(f"{scene}\n{laws}[safety]\nramp_s = {RAMP_S}\n{self.safety}\n", "bench")


class Hand:
    """A device of one mass an axis, exact under a held force, and a hand that pushes it."""

    def __init__(self, rig: Rig, mass_kg: float = 0.25, viscous_n_s_per_m: float = 4.4) -> None:
        self.rig = rig
        self.mass_kg = mass_kg
        self.viscous = viscous_n_s_per_m
        self.speed = [0.0] * len(rig.at)

    def run(self, ticks: int, hand_n: Iterable[float] | None = None) -> list[list[float]]:
        """Positions tick by tick, under a constant force of the hand."""
        pushed = list(hand_n or [0.0] * len(self.speed))
        path = []
        for _ in range(ticks):
            at = list(self.rig.at)
            keep = math.exp(-self.viscous / self.mass_kg * PERIOD_S)
            for axis, newton in enumerate(self.rig.force):
                ends = (newton + pushed[axis]) / self.viscous
                off = self.speed[axis] - ends
                at[axis] += ends * PERIOD_S + off * (1.0 - keep) * self.mass_kg / self.viscous
                self.speed[axis] = ends + off * keep
            self.rig.go(at)
            path.append(at)
        return path


def length(vector: Iterable[float]) -> float:
    return float(sum(value * value for value in vector) ** 0.5)


def apart_each(a: Iterable[float], b: Iterable[float]) -> list[float]:
    return [x - y for x, y in zip(a, b, strict=True)]


def apart(a: Iterable[float], b: Iterable[float]) -> float:
    return length(apart_each(a, b))
