"""Instructions of a tick, by scene: what is not in a scene costs nothing, and a count shows it where timings cannot.

A tick here is the daemon's own, from the read of a simulated device to its books.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from hapticd.config.loading import LoadedConfig, parse
from hapticd.offline.operations import count_operations
from hapticd.offline.rehearsal import Rehearsal

SETTLE_TICKS = 200
"""Ticks before the count, so that ramps are over and the wall is pressed."""

COUNTED_TICKS = 10


@dataclass(frozen=True, slots=True)
class TickCount:
    """What a tick of one scene takes.

    Attributes:
        name: of the scene.
        operations: instructions of the interpreter in the last tick that was counted.
        steady: whether every tick that was counted took as many.
    """

    name: str
    operations: int
    steady: bool


def tick_operations(
    loaded: LoadedConfig, first: int = SETTLE_TICKS, ticks: int = COUNTED_TICKS, every: int = 1
) -> list[int]:
    """Instructions of some ticks.

    Args:
        loaded: the configuration.
        first: the first tick that is counted.
        ticks: how many are.
        every: one in this many.
    """
    run = Rehearsal(loaded).run(first + ticks * every)
    for _ in range(first):
        next(run)
    counts = []
    for _ in range(ticks):
        for _ in range(every - 1):
            next(run, None)
        counts.append(count_operations(partial(next, run, None)))
    return counts


def bare(walls: int = 1, wall: str = "", device: str = "", rest: str = "", newton: float = -3.0) -> str:
    """A configuration of the least that can be pressed: a mass with viscous friction, a law that does nothing.

    Args:
        walls: how many, sharing 2 kN/m.
        wall: more lines of each wall.
        device: more lines of the device.
        rest: more tables.
        newton: force of the hand [N].
    """
    stiffness = 2000.0 / max(1, walls)
    return (
        f'[device.options]\nmodel = "omega7"\nresolution_m = 0.0\nmax_force_n = 0.0\n{device}\n'
        f'hand.force = {{ profile = "constant", newton = {newton} }}\n'
        + f"[[scene.walls]]\nstiffness_n_per_m = {stiffness}\n{wall}\n" * walls
        + f'[controller]\nlaw = "none"\n[safety]\nprofile = "simulation"\n{rest}\n'
    )


SCENES = {
    "empty loop": bare(0),
    "one wall, not touched": bare(newton=0.0, device="initial_position_m = 0.01"),
    "one wall": bare(),
    "two walls": bare(2),
    "three walls": bare(3),
    "one wall with damping": bare(wall="damping_n_s_per_m = 1.0"),
    "one wall that will change": bare(wall="changes = [{ at_s = 100.0, stiffness_n_per_m = 1000.0 }]"),
    "one wall, device with friction": bare(device="coulomb_n = 0.1"),
    "one wall, sensor with steps": bare(device="resolution_m = 1e-5").replace("resolution_m = 0.0\n", ""),
    "one wall, sensor with noise": bare(device="noise_m = 1e-6"),
    "one wall, force delay": bare(device="force_delay_samples = 1"),
    "one wall, velocity over 3": bare(rest="[velocity]\nsamples = 3"),
}
"""Scenes that differ by one thing each."""


def scene_ticks() -> list[TickCount]:
    """What a tick of each scene takes, while its walls are pressed."""
    found = []
    for name, text in SCENES.items():
        counts = tick_operations(parse(text, name))
        found.append(TickCount(name, counts[-1], len(set(counts)) == 1))
    return found
