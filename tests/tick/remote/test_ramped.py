"""A coefficient that goes from one value to another: no step of its force, and what it stores is that force's work."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.tick.remote.ramped import Ramped
from tests.examples import examples

VALUES = st.floats(0.0, 5000.0) | st.just(0.0)
LENGTHS = st.floats(1e-6, 0.02)
LIMITS = st.floats(0.5, 20.0)
STEPS = st.floats(0.01, 0.99)


@examples(60)
@given(VALUES, VALUES, VALUES, LENGTHS, LIMITS, STEPS)
def test_a_new_goal_begins_at_the_force_of_then_and_ends_at_its_own(
    first: float, second: float, third: float, s: float, limit: float, step: float
) -> None:
    ramped = Ramped(first)
    assert (ramped.now, ramped.force(s, limit)) == (first, min(first * s, limit))
    for goal in (second, third):
        before = ramped.force(s, limit)
        ramped.aim(goal, s, limit)
        assert ramped.goal == goal
        assert ramped.force(s, limit) == pytest.approx(before)
        ramped.go_on(step, step)
        between = (1.0 - step) * before + step * min(goal * s, limit)
        assert ramped.force(s, limit) == pytest.approx(between)
    ramped.go_on(1.0, 1.0)
    assert (ramped.now, ramped.force(s, limit)) == (third, min(third * s, limit))


@examples(40)
@given(VALUES, VALUES, LENGTHS, LIMITS, st.floats(0.0, 1.2))
def test_what_it_stores_is_the_work_of_its_force_from_there_to_nothing(
    first: float, second: float, s: float, limit: float, step: float
) -> None:
    ramped = Ramped(first)
    ramped.aim(second, s, limit)
    ramped.go_on(step, step)
    parts = 400
    work_j = sum(ramped.force((n + 0.5) * s / parts, limit) for n in range(parts)) * s / parts
    assert ramped.stored(s, limit) == pytest.approx(work_j, rel=1e-4, abs=1e-12)
    other = Ramped(0.0)
    ramped.copy_to(other)
    assert (other.now, other.goal, other.stored(s, limit)) == (ramped.now, ramped.goal, ramped.stored(s, limit))
    ramped.begin(0.25)
    assert ramped.now == pytest.approx(0.25 * second)
    assert ramped.force(s, limit) == pytest.approx(0.25 * min(second * s, limit))
    ramped.begin(1.0)
    assert (ramped.now, ramped.stored(s, limit)) == (second, Ramped(second).stored(s, limit))


def test_without_length_it_goes_over_from_the_coefficient_of_then() -> None:
    ramped = Ramped(1000.0)
    ramped.aim(200.0, 0.0, 5.0)
    ramped.go_on(0.25, 0.25)
    assert ramped.now == pytest.approx(800.0)
    ramped.aim(0.0, 0.0, 5.0)
    ramped.go_on(0.5, 0.5)
    assert ramped.now == pytest.approx(400.0)
