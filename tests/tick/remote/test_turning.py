"""An orientation has length 1 whatever a client says, and one that has no length says nothing."""

from __future__ import annotations

import math

import pytest

from hapticd.tick.remote.turning import Turning, unit

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
AROUND_Z = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
"""By a quarter turn."""


def test_one_without_length_is_upright_at_first_and_says_nothing_later() -> None:
    turning = Turning((0.0, 0.0, 0.0, 0.0), 2.0, 0.1)
    assert turning.now == UPRIGHT
    turning.aim(AROUND_Z, None)
    for _ in range(2000):
        turning.move(1e-3)
    assert turning.now == pytest.approx(AROUND_Z)
    turning.aim((0.0, 0.0, 0.0, 0.0), None)
    for _ in range(2000):
        turning.move(1e-3)
    assert turning.now == pytest.approx(AROUND_Z)


@pytest.mark.parametrize("length", [5e-324, 1e-200, 0.5, 1.0, 1e200, 1e308])
def test_any_length_that_a_number_has_is_brought_to_1(length: float) -> None:
    made = unit((0.0, 0.0, -length, 0.0))
    assert made == (0.0, 0.0, -1.0, 0.0)
    skew = unit((0.5 * length, -0.5 * length, 0.5 * length, 0.5 * length))
    if length > 1e-300:
        assert skew == pytest.approx((0.5, -0.5, 0.5, 0.5))


@pytest.mark.parametrize("nothing", [0.0, math.inf, math.nan])
def test_what_has_no_length_is_no_orientation(nothing: float) -> None:
    assert unit((nothing, 0.0, 0.0, 0.0)) is None


def test_it_turns_no_faster_than_its_limit_and_stops_where_it_is_told_to() -> None:
    turning = Turning(UPRIGHT, 2.0, 0.1)
    turning.aim(AROUND_Z, None)
    angles = []
    for _ in range(100):
        turning.move(1e-3)
        angles.append(2.0 * math.atan2(turning.now[3], turning.now[0]))
    steps = [after - before for before, after in zip([0.0, *angles], angles, strict=False)]
    assert max(steps) == pytest.approx(2e-3)
    assert angles[-1] == pytest.approx(0.2, rel=0.05)
    turning.stop()
    turning.move(1e-3)
    turning.move(1e-3)
    assert 2.0 * math.atan2(turning.now[3], turning.now[0]) == pytest.approx(angles[-1])
