"""Walls that share a limit, under a hand that rests: what changes of one of them turns the whole force by a ramp."""

from __future__ import annotations

import itertools
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.tick.rig import LIMIT_N, RAMP_TICKS, Rig, largest_step, running, scene, wall
from tests.tick.transitions import RAMP_STEP_N

CHANGED_S = 0.02
STIFFNESS = st.sampled_from([0.0, 300.0, 1e3, 1e4, 5e4])


def slot(first_n_per_m: float, second_n_per_m: float, **keys: Any) -> list[dict[str, Any]]:
    """Two walls that face each other and overlap by 4 mm."""
    return [wall(first_n_per_m, **keys), wall(second_n_per_m, position_m=-4e-3, free_side="negative")]


def changes(stiffness_n_per_m: float) -> list[dict[str, float]]:
    return [{"at_s": CHANGED_S, "stiffness_n_per_m": stiffness_n_per_m}]


def longest_step(forces_n: list[list[float]]) -> float:
    return max(math.dist(a, b) for a, b in itertools.pairwise(forces_n))


def test_a_wall_that_softens_by_a_tenth_does_not_turn_the_force_of_a_slot_round_at_once() -> None:
    """It went from 12 N to -12 N within a tick, and stayed there for 60 ms."""
    rig = Rig(*slot(50e3, 20e3, changes=changes(45e3)), at_m=0.0)
    forces_n = rig.forces(-2e-3, 1200)
    assert forces_n[0] == forces_n[-1] == pytest.approx(LIMIT_N)
    assert largest_step(forces_n) <= 2.0 * RAMP_STEP_N + 1e-9


def test_a_wall_that_softens_hands_its_share_of_the_limit_over_by_a_ramp() -> None:
    """The other axis rose by 2.6 N in a tick."""
    rig = Rig(wall(10e3, "x", changes=changes(1e3)), wall(10e3, "y"), axes="xy", at_m=0.0)
    forces_n = rig.at(-2e-3, -2e-3, ticks=300)
    assert forces_n[0] == pytest.approx([LIMIT_N / math.sqrt(2.0)] * 2)
    assert forces_n[-1] == pytest.approx([LIMIT_N / math.hypot(1.0, 10.0), 10.0 * LIMIT_N / math.hypot(1.0, 10.0)])
    assert longest_step(forces_n) <= 2.0 * RAMP_STEP_N + 1e-9


@pytest.mark.parametrize("late", [False, True])
@examples(40)
@given(before=st.lists(STIFFNESS, min_size=4, max_size=4), after=STIFFNESS)
def test_whatever_wall_changes_no_tick_turns_the_force_by_more_than_the_ramps_of_all(
    late: bool, before: list[float], after: float
) -> None:
    """Two axes, two walls each: 2 limit / N for every wall that blends."""
    walls = [
        wall(stiffness, axis, position_m=at_m, free_side=side)
        for stiffness, (axis, (at_m, side)) in zip(
            before, itertools.product("xy", [(0.0, "positive"), (-4e-3, "negative")]), strict=True
        )
    ]
    walls[0]["changes"] = [{"at_s": 9e-3 * RAMP_TICKS, "stiffness_n_per_m": after}]
    rig = Rig(*walls, axes="xy", at_m=0.0)
    forces_n = rig.at(-2e-3, -2e-3, ticks=9 * RAMP_TICKS - 1)[-1:]  # all that it was armed in has come in
    forces_n += rig.at(-2e-3, -2e-3, dt_s=0.03 if late else 1e-3)
    forces_n += rig.at(-2e-3, -2e-3, ticks=8 * RAMP_TICKS)
    assert longest_step(forces_n) <= 4.0 * 2.0 * RAMP_STEP_N + 1e-9


@pytest.mark.parametrize("after_n_per_m", [0.0, 45e3, 60e3])
def test_of_two_walls_that_balance_one_lets_go_no_faster_than_the_limit_allows(after_n_per_m: float) -> None:
    """100 N against 100 N: what one let go within a ramp was on the device at a rate of 8 limits."""
    walls = slot(50e3, 50e3)
    walls[0]["changes"] = [{"at_s": 2.0, "stiffness_n_per_m": after_n_per_m}]
    rig = Rig(*walls, at_m=0.0)
    forces_n = rig.forces(-2e-3, 4000)
    assert abs(forces_n[1900]) <= 1e-9
    goal_n = min(max(2e-3 * (after_n_per_m - 50e3), -LIMIT_N), LIMIT_N)
    assert forces_n[-1] == pytest.approx(goal_n)
    assert largest_step(forces_n) <= 2.0 * RAMP_STEP_N + 1e-9


@pytest.mark.parametrize("armed_inside", [True, False])
def test_a_slot_opens_its_bound_no_faster_than_a_ramp(armed_inside: bool) -> None:
    """It came from no force to all of it within five ticks: both walls ask for more than the limit."""
    rig = Rig(*slot(50e3, 20e3), at_m=-2e-3 if armed_inside else 0.0)
    forces_n = rig.forces(-2e-3, 10)
    if not armed_inside:
        rig.switch(make_law=running(rig.tick.contacts[0].law.module))
        forces_n = forces_n[-1:]
    forces_n += rig.forces(-2e-3, 8 * RAMP_TICKS)
    assert forces_n[-1] == pytest.approx(LIMIT_N)
    assert largest_step(forces_n) <= 2.0 * RAMP_STEP_N + 1e-9


def test_a_corner_turns_by_a_ramp_when_a_wall_is_added() -> None:
    rig = Rig(wall(3e3, "x"), wall(9e3, "y"), axes="xyz", at_m=0.0)
    forces_n = rig.at(-2e-3, -2e-3, -2e-3, ticks=5)
    rig.switch(scene(wall(3e3, "x"), wall(9e3, "y"), wall(30e3, "z")))
    forces_n += rig.at(-2e-3, -2e-3, -2e-3, ticks=8 * RAMP_TICKS)
    assert forces_n[-1] == pytest.approx([LIMIT_N * k / math.hypot(3.0, 9.0, 30.0) for k in (3.0, 9.0, 30.0)])
    assert longest_step(forces_n) <= 2.0 * RAMP_STEP_N + 1e-9
