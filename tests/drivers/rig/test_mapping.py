"""Counts to metres, newtons to micronewtons."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.errors import ConfigError
from hapticd_drivers.rig.mapping import AxisMap
from hapticd_drivers.rig.messages import Axis
from hapticd_drivers.rig.options import AxisOptions

TOLD = Axis(0, 0, 0, 0, count_pm=10_000_000, max_force_un=5_000_000, lowest=-1000, highest=4000, home=0)


def axis(**options: object) -> AxisOptions:
    return AxisOptions.model_validate(options)


def test_a_rig_that_says_everything_needs_no_options() -> None:
    found = AxisMap(TOLD, axis())
    assert (found.count_m, found.max_force_n) == (1e-5, 5.0)
    assert (found.lowest_m, found.highest_m) == pytest.approx((-0.01, 0.04))
    assert found.position_m(100) == pytest.approx(1e-3)
    assert found.force_un(1.5) == 1_500_000


def test_a_reversed_axis_turns_its_travel_as_well() -> None:
    found = AxisMap(TOLD, axis(reversed=True))
    assert (found.lowest_m, found.highest_m) == pytest.approx((-0.04, 0.01))
    assert found.position_m(4000) == pytest.approx(found.lowest_m)
    assert found.force_un(1.0) == -1_000_000


@pytest.mark.parametrize(
    ("told", "options", "says"),
    [
        ({"count_pm": 0}, {}, "count_m is not set"),
        ({"lowest": 0, "highest": 0}, {"lowest_m": 0.0}, "lowest_m and highest_m are not set"),
        ({}, {"lowest_m": 0.04}, "below the upper end"),
        ({"max_force_un": 0}, {}, "largest force is 0"),
    ],
)
def test_what_neither_side_knows_is_asked_for_by_its_key(
    told: dict[str, int], options: dict[str, float], says: str
) -> None:
    with pytest.raises(ConfigError, match=rf"device\.options\.axes\[0\].*{says}"):
        AxisMap(TOLD._replace(**told), axis(**options))


@given(
    told=st.builds(
        TOLD._replace,
        count_pm=st.integers(1, 2**32 - 1),
        max_force_un=st.integers(1, 2**32 - 1),
        home=st.integers(-(2**31), 2**31 - 1),
    ),
    options=st.builds(
        axis,
        reversed=st.booleans(),
        motor_reversed=st.booleans(),
        force_scale=st.floats(0.11, 9.9),
        home_m=st.floats(-1.0, 1.0),
    ),
    count=st.integers(-(2**31), 2**31 - 1),
    force_n=st.floats(-1e6, 1e6),
)
def test_whatever_a_rig_says_a_force_fits_it_and_home_is_where_it_was_put(
    told: Axis, options: AxisOptions, count: int, force_n: float
) -> None:
    found = AxisMap(told, options)
    assert abs(found.force_un(force_n)) <= min(told.max_force_un, 2**31 - 1)
    at_m = found.position_m(count)
    home = found.home_if(count, at_m)
    assert abs(home - told.home) <= 1 + abs(count - told.home) * 1e-9 + 1e-9 / abs(found.count_m)
    found.put_middle(count)
    assert found.position_m(count) == pytest.approx(0.5 * (found.lowest_m + found.highest_m), abs=1e-6)


@given(count=st.integers(-(10**6), 10**6), at_m=st.floats(-0.01, 0.04), reversed_=st.booleans())
def test_a_home_that_was_found_puts_the_handle_where_it_stands(count: int, at_m: float, reversed_: bool) -> None:
    found = AxisMap(TOLD, axis(reversed=reversed_, home_m=0.005))
    found.put_home(found.home_if(count, at_m))
    assert found.position_m(count) == pytest.approx(at_m, abs=0.51 * abs(found.count_m))


@pytest.mark.parametrize("sign", [1, -1])
def test_the_largest_force_that_a_message_holds_is_never_passed(sign: int) -> None:
    """31 bits and a sign, whatever the rig says that it can."""
    found = AxisMap(TOLD._replace(max_force_un=2**32 - 1), axis())
    assert found.force_un(sign * 1e9) == sign * (2**31 - 1)
    assert AxisMap(TOLD, axis()).force_un(sign * 1e9) == sign * 5_000_000
