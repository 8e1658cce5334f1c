"""A reload is no motion: what it puts or changes is felt from where the device is, and not from where it was."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest

from tests.tick.space.rig import Rig, apart, ball, table
from tests.tick.space.test_changes import RAMP_TICKS

PLATE: dict[str, Any] = {"size_m": (0.1, 0.1, 0.002)}
ROUND = ((0.0, 0.0, 0.1), (0.2, 0.0, 0.1), (0.2, 0.0, -0.1), (0.0, 0.0, -0.1))


@pytest.mark.parametrize("first", [0.1, 0.01], ids=["never in reach", "in reach before"])
@pytest.mark.parametrize("remote", [False, True], ids=["still", "remote"])
@pytest.mark.parametrize(
    ("shape", "keys"),
    [("box", PLATE), ("sphere", {"radius_m": 0.03}), ("cylinder", {"radius_m": 0.06, "length_m": 0.004})],
    ids=["plate", "ball", "disc"],
)
def test_a_change_of_an_object_that_the_device_has_passed_round_is_not_felt(
    shape: str, keys: dict[str, Any], remote: bool, first: float
) -> None:
    """The way there was taken for one through the object: the guard's limit, 10 cm away, for as long as it stayed."""
    rig = Rig(table("it", shape, 5000.0, remote=remote, **keys), "none").start(ROUND[0])
    rig.to((0.0, 0.0, first + 0.03), 100)
    for at in ROUND:
        rig.to(at, 100)
    rig.switch(table("it", shape, 5500.0, remote=remote, **keys))
    rig.forces.clear()
    rig.to(ROUND[-1], 3 * RAMP_TICKS)
    assert not any(map(any, rig.forces))
    rig.to((0.0, 0.0, 0.0), 400)
    assert rig.force[2] < -1.0, "and from where it is now it is felt"


@pytest.mark.parametrize("z", [0.02, -0.02])
def test_an_object_that_a_reload_puts_behind_a_free_device_does_not_hold_it(z: float) -> None:
    """A change is no motion: nothing has swept over the hand."""
    rig = Rig(table("plate", "box", **PLATE, position_m=(0.0, 0.0, -z)), "none").start((0.0, 0.0, 0.0))
    rig.to((0.0, 0.0, 0.001), 20)
    rig.switch(table("plate", "box", **PLATE, position_m=(0.0, 0.0, z))).forces.clear()
    rig.to((0.0, 0.0, 0.001), 3 * RAMP_TICKS)
    assert not any(map(any, rig.forces))


@pytest.mark.parametrize("before", ["", ball("far", position_m=(0.5, 0.0, 0.0))], ids=["empty", "another far away"])
def test_a_new_object_comes_in_by_a_ramp_where_the_device_is_now(before: str) -> None:
    """The first object took the device to be where it had been armed, and gave 10 N in one tick."""
    here = (0.0, 0.0, 0.028)
    rig = Rig(before, "none").start((0.0, 0.0, 0.1)).to(here, 100)
    rig.switch(before + ball()).forces.clear()
    rig.to(here, 3 * RAMP_TICKS)
    steps = [apart(now, last) for last, now in pairwise([(0.0, 0.0, 0.0), *rig.forces])]
    assert max(steps) <= 2.0 * 12.0 / RAMP_TICKS
    assert rig.force[2] == pytest.approx(10.0)


@pytest.mark.parametrize("before", ["", ball("far", position_m=(0.5, 0.0, 0.0))], ids=["empty", "another far away"])
def test_a_new_object_between_where_the_device_was_and_is_does_not_hold_it(before: str) -> None:
    rig = Rig(before, "none").start((0.0, 0.0, -0.02)).to((0.0, 0.0, 0.02), 100)
    rig.switch(before + table("plate", "box", **PLATE)).forces.clear()
    rig.to((0.0, 0.0, 0.02), 3 * RAMP_TICKS)
    assert not any(map(any, rig.forces))
