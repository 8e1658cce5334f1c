"""A tick in space without a device: positions in, forces out, and the books beside."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable
from typing import Any

from hapticd.config.loading import LoadedConfig, parse
from hapticd.device import DeviceInfo, Sample
from hapticd.shapes.field import Field
from hapticd.tick.assemble import make_tick
from hapticd.tick.space.books import Totals
from hapticd.tick.space.tick import SpaceTick

PERIOD_S = 1e-3
INFO = DeviceInfo(
    model="bench",
    serial="",
    axes=("x", "y", "z"),
    max_force_n=12.0,
    resolution_m=0.0,
    workspace_m=((-1.0, 1.0),) * 3,
    nominal_rate_hz=1000.0,
    safe_damping_n_s_per_m=10.0,
    host_silence_ms=0.0,
    simulated=True,
    has_clock=True,
)
Point = tuple[float, float, float]


def table(name: str, shape: str, stiffness: float = 5000.0, **keys: Any) -> str:
    """An object of a scene."""
    lines = [f"{key} = {_toml(value)}" for key, value in keys.items()]
    head = f'[[scene.objects]]\nname = "{name}"\nshape = "{shape}"\nstiffness_n_per_m = {stiffness}\n'
    return head + "\n".join(lines) + "\n"


def ball(name: str = "ball", stiffness: float = 5000.0, **keys: Any) -> str:
    return table(name, "sphere", stiffness, **{"radius_m": 0.03, **keys})


def ball_field(radius_m: float, spacing_m: float) -> Field:
    """The distance field of a ball about the origin, as `hapticd mesh` would write it."""
    count = 2 * math.ceil((radius_m + 4.0 * spacing_m) / spacing_m) + 1
    edge_m = (count // 2) * spacing_m
    at = [n * spacing_m - edge_m for n in range(count)]
    values = array("f", [math.hypot(x, y, z) - radius_m for x in at for y in at for z in at])
    error_m = spacing_m * spacing_m / (4.0 * radius_m)
    return Field((count,) * 3, (-edge_m,) * 3, spacing_m, edge_m - radius_m, error_m, values)


def config(scene: str, law: str = "energy-cycle", safety: str = "") -> LoadedConfig:
    return parse(f'{scene}\n[controller]\nlaw = "{law}"\n[safety]\n{safety}\n', "bench")


class Rig:
    """A tick that is shown positions, and the work of the forces that it gave."""

    def __init__(self, scene: str, law: str = "energy-cycle", safety: str = "", info: DeviceInfo = INFO) -> None:
        self.loaded = config(scene, law, safety)
        tick = make_tick(self.loaded, info)
        assert isinstance(tick, SpaceTick)
        self.tick = tick
        self.sample = Sample(3)
        self.energy_j = 0.0
        self.force: Point = (0.0, 0.0, 0.0)
        self.forces: list[Point] = []

    def start(self, at: Point) -> Rig:
        self.sample.position_m[:] = at
        self.sample.time_ns = 0
        self.tick.start(self.sample)
        self.tick.arm()
        return self

    def go(self, *points: Point) -> Rig:
        """Show these positions, a tick each."""
        for at in points:
            before = tuple(self.sample.position_m)
            self.sample.position_m[:] = at
            self.sample.time_ns += 1_000_000
            self.sample.sequence += 1
            self.energy_j -= sum(f * (to - of) for f, to, of in zip(self.force, at, before, strict=True))
            x, y, z = self.tick.advance(self.sample, PERIOD_S)
            self.force = (x, y, z)
            self.forces.append(self.force)
        return self

    def to(self, at: Point, ticks: int) -> Rig:
        """Go to a point in a straight line."""
        start = tuple(self.sample.position_m)
        share = [(n + 1) / ticks for n in range(ticks)]
        return self.go(*(_between(start, at, s) for s in share))

    def switch(self, scene: str, law: str | None = None) -> Rig:
        """Reload another scene, and perhaps another law."""
        loaded = config(scene, law or self.loaded.config.controller.law)
        make = None
        if law is not None:
            from hapticd.tick.contact import RunningLaw

            make = lambda: RunningLaw(loaded.law, loaded.params)  # noqa: E731 - as the loop hands it over
        for _ in self.tick.switch(loaded.config.scene, loaded.config.safety, make):
            pass
        return self

    @property
    def totals(self) -> Totals:
        return self.tick.totals()

    def unbalanced_j(self) -> float:
        """How far the books are off: what flowed in, and what became of it."""
        totals = self.totals
        ledger = totals.ledger
        became = ledger.stored_j + ledger.dissipated_j - ledger.generated_j - totals.moved_j
        return max(abs(self.energy_j - became), abs(self.energy_j - ledger.energy_j))


def length(vector: Iterable[float]) -> float:
    return float(sum(value * value for value in vector) ** 0.5)


def apart(a: Iterable[float], b: Iterable[float]) -> float:
    return length(x - y for x, y in zip(a, b, strict=True))


def _between(a: Iterable[float], b: Iterable[float], share: float) -> Point:
    x, y, z = (of + share * (to - of) for of, to in zip(a, b, strict=True))
    return (x, y, z)


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(each) for each in value) + "]"
    return f'"{value}"' if isinstance(value, str) else repr(float(value))
