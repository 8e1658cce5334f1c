"""A wall's changes over time through reloads of the scene: the record says what the loop's own walls are by now."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from hapticd.config.walls import WallConfig
from hapticd.tick.scene import Wall
from tests.tick.rig import PERIOD_S, Rig, scene, wall

TIMES = st.sets(st.one_of(st.integers(0, 30).map(lambda ms: ms * 1e-3), st.floats(0.0, 0.03)), max_size=5)


def changing(stiffness_n_per_m: float, *at_s: float, **keys: Any) -> dict[str, Any]:
    """A wall that takes 0, 100, 200 ... N/m at these times."""
    changes = [{"at_s": time_s, "stiffness_n_per_m": 100.0 * count} for count, time_s in enumerate(sorted(at_s))]
    return wall(stiffness_n_per_m, changes=changes, **keys)


def recorded(rig: Rig, ticks: int = 1) -> list[float]:
    """Stiffness of each wall as the record of the last of some ticks has it."""
    rig.at(0.05, ticks=ticks)
    row = bytearray(rig.layout.size)
    rig.layout.pack(memoryview(row), 0, rig.tick, rig.sample, 0, 0, 0.0, 0.0, 0, 0)
    return [each.stiffness_n_per_m for each in rig.layout.unpack(memoryview(row)).walls]


@given(at_s=TIMES)
def test_the_record_has_what_the_wall_is_at_every_tick(at_s: set[float]) -> None:
    config = changing(12e3, *at_s)
    rig = Rig(config)
    alone = Wall(WallConfig.model_validate(config), 0, PERIOD_S)
    for _ in range(40):
        if alone.changes_left:
            alone.pass_time(1.0)
        assert recorded(rig) == [alone.stiffness_n_per_m]


def test_a_wall_that_stays_keeps_its_clock_and_another_one_starts_its_own() -> None:
    stays, other = changing(1.0, 0.01), changing(2.0, 0.01, position_m=-0.01)
    rig = Rig(stays)
    recorded(rig, 8)
    rig.switch(scene(other, stays))
    assert recorded(rig, 2) == [2.0, 1.0]
    assert recorded(rig) == [2.0, 0.0], "ten ticks after its own first one"
    assert recorded(rig, 7) == [2.0, 0.0]
    assert recorded(rig) == [0.0, 0.0]


def test_of_two_walls_in_one_place_each_stays_itself_in_another_order() -> None:
    one, other = changing(1.0, 0.01), changing(2.0, 0.02)
    rig = Rig(one, other)
    recorded(rig, 8)
    rig.switch(scene(other, one))
    assert recorded(rig, 2) == [2.0, 1.0]
    assert recorded(rig) == [2.0, 0.0]
    assert recorded(rig, 10) == [0.0, 0.0]


def test_two_equal_walls_have_a_clock_each() -> None:
    same = changing(1.0, 0.01)
    rig = Rig(same)
    recorded(rig, 10)
    rig.switch(scene(same, same))
    assert recorded(rig) == [0.0, 1.0]
    assert recorded(rig, 10) == [0.0, 0.0]
