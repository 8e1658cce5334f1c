"""How long laws have computed, asked of a clock that only they move."""

from __future__ import annotations

from typing import Any

from tests.tick.rig import Rig, law, pushes, wall
from tests.tick.space.rig import Rig as SpaceRig
from tests.tick.space.rig import ball

LAW_NS = 300
WALL = '[[scene.walls]]\naxis = "z"\nposition_m = 0.02\nstiffness_n_per_m = 1000.0\n'


class LawClock:
    """It goes on while a law is asked.

    Attributes:
        now_ns: what it shows [ns].
    """

    def __init__(self) -> None:
        self.now_ns = 7_000_000

    def __call__(self) -> int:
        return self.now_ns

    def count(self, of: Any) -> None:
        """Have each step of a law take `LAW_NS`."""
        step = of.step

        def slow(*told: Any) -> Any:
            self.now_ns += LAW_NS
            return step(*told)

        of.step = slow


def test_the_laws_of_all_walls_are_counted_where_somebody_asks() -> None:
    clock = LawClock()
    rig = Rig(wall(), wall(position_m=-0.01), module=pushes(1.0))
    for contact in rig.tick.contacts:
        clock.count(contact.law)
    rig.at(-0.02)
    assert rig.tick.law_ns == 0
    rig.tick.law_clock = clock
    rig.at(-0.02, ticks=2)
    assert rig.tick.law_ns == 2 * LAW_NS


def test_a_law_that_fails_is_counted_too() -> None:
    clock = LawClock()

    def fail(_state: Any, _params: Any, _tick: Any) -> float:
        clock.now_ns += LAW_NS
        raise ValueError

    rig = Rig(wall(), module=law(fail))
    rig.tick.law_clock = clock
    rig.at(-0.01)
    assert rig.tick.fault
    assert rig.tick.law_ns == LAW_NS


def test_laws_of_objects_are_counted_with_those_of_walls() -> None:
    clock = LawClock()
    rig = SpaceRig(ball() + WALL).start((0.0, 0.0, 0.05))
    for contact in rig.tick.contacts:
        clock.count(contact.law)
    for solid in rig.tick.solids:
        for channel in solid.channels:
            clock.count(channel.law)
    rig.to((0.0, 0.0, 0.025), 100)
    assert rig.tick.law_ns == 0
    rig.tick.law_clock = clock
    rig.go((0.0, 0.0, 0.025))
    assert rig.tick.law_ns == LAW_NS
    rig.to((0.0, 0.0, 0.015), 100)
    assert rig.tick.law_ns == 2 * LAW_NS
