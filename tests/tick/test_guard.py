"""The guard: what of a force is let through."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.config.safety import SafetyConfig
from hapticd.device import DeviceInfo
from hapticd.errors import ConfigError
from hapticd.tick.guard import DEFAULT_MAX_SPEED_M_PER_S, Guard, Mode, begin_late, blended, blended_again, start_blend

PERIOD_S = 1e-3
FORCES = st.lists(st.floats(-1e18, 1e18), min_size=1, max_size=3)


def device(max_force_n: float = 12.0, simulated: bool = False) -> DeviceInfo:
    span = ((-0.1, 0.1),) * 3
    return DeviceInfo("a device", "", ("x", "y", "z"), max_force_n, 1e-5, span, 1e3, 5.0, None, simulated=simulated)


def guard(info: DeviceInfo | None = None, **keys: Any) -> Guard:
    return Guard(SafetyConfig.model_validate(keys), info or device())


def armed(info: DeviceInfo | None = None, **keys: Any) -> Guard:
    made = guard(info, **keys)
    assert made.arm()
    return made


def test_nothing_passes_until_it_is_armed() -> None:
    made = guard()
    force_n = [3.0, -4.0, 0.5]
    assert made.mode is Mode.DISARMED
    assert made.reduce(force_n, PERIOD_S) == 0.0
    assert force_n == [0.0, 0.0, 0.0]


def test_nothing_is_limited_before_the_first_force_nor_after_the_last() -> None:
    assert not guard().limited
    made = armed()
    made.reduce([100.0], PERIOD_S)
    assert made.limited
    made.drop()
    assert not made.limited


@given(force_n=FORCES, max_axis_n=st.none() | st.floats(0.1, 12.0))
def test_no_force_is_beyond_a_limit_and_its_direction_is_kept(force_n: list[float], max_axis_n: float | None) -> None:
    made = armed(max_axis_force_n=max_axis_n)
    asked_n = list(force_n)
    share = made.reduce(force_n, PERIOD_S)
    assert math.hypot(*force_n) <= 12.0 * (1.0 + 1e-12)
    assert max(map(abs, force_n)) <= (max_axis_n or 12.0) * (1.0 + 1e-12)
    assert force_n == [share * newton for newton in asked_n]
    assert made.limited == (share < 1.0)


@given(force_n=st.lists(st.floats(-6.0, 6.0), min_size=1, max_size=3))
def test_a_force_within_limits_is_not_touched(force_n: list[float]) -> None:
    made = armed()
    asked_n = list(force_n)
    assert made.reduce(force_n, PERIOD_S) == 1.0
    assert [newton.hex() for newton in force_n] == [newton.hex() for newton in asked_n]


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e200])
@pytest.mark.parametrize("profile", ["device", "simulation"])
def test_what_is_not_a_finite_force_becomes_none_and_stops_the_guard(bad: float, profile: str) -> None:
    made = armed(device(simulated=True), profile=profile)
    for force_n in ([bad, 1.0, 1.0], [1.0, 1.0, bad], [1.0, 0.0, 0.0]):
        made.reduce(force_n, PERIOD_S)
        assert force_n == [0.0, 0.0, 0.0]
        assert made.latched
        assert made.mode is Mode.DISARMED


def test_the_limit_of_the_device_holds_unless_a_smaller_one_is_named() -> None:
    assert guard().max_force_n == 12.0
    assert guard(max_force_n=3.0).max_force_n == 3.0
    with pytest.raises(ConfigError, match=r"safety\.max_force_n = 13: a device takes at most 12 N"):
        guard(max_force_n=13.0)


def test_one_contact_is_bound_by_the_smaller_of_both_limits() -> None:
    assert guard(max_force_n=10.0, max_axis_force_n=4.0).limit_n == 4.0
    assert guard(max_force_n=4.0, max_axis_force_n=10.0).limit_n == 4.0


def test_a_real_device_without_a_limit_of_its_own_needs_one() -> None:
    for declared in (math.inf, math.nan):
        with pytest.raises(ConfigError, match="max_force_n"):
            guard(device(declared))
    assert guard(device(math.inf), max_force_n=5.0).max_force_n == 5.0
    assert guard(device(math.inf, simulated=True)).max_force_n == math.inf


def test_the_simulation_profile_is_refused_for_a_real_device() -> None:
    with pytest.raises(ConfigError, match=r"simulation.*real device"):
        guard(profile="simulation")
    free = guard(device(math.inf, simulated=True), profile="simulation", max_force_n=1.0)
    assert (free.max_force_n, free.max_axis_n, free.max_speed_m_per_s) == (math.inf, math.inf, math.inf)


def test_in_simulation_nothing_is_asked_of_a_device_beyond_what_it_saturates_at() -> None:
    made = guard(device(12.0, simulated=True), profile="simulation", max_force_n=1.0, max_axis_force_n=1.0)
    assert (made.max_force_n, made.max_axis_n, made.limit_n) == (12.0, 12.0, 12.0)


def test_a_refused_configuration_changes_nothing() -> None:
    made = armed(max_force_n=5.0)
    for bad in ({"profile": "simulation"}, {"max_force_n": 50.0}):
        with pytest.raises(ConfigError):
            made.configure(SafetyConfig.model_validate(bad), device(), [5.0, 0.0, 0.0])
    force_n = [9.0, 0.0, 0.0]
    made.reduce(force_n, PERIOD_S)
    assert force_n[0] == pytest.approx(5.0)
    assert made.max_speed_m_per_s == DEFAULT_MAX_SPEED_M_PER_S


def test_over_speed_is_a_matter_of_real_devices_unless_named() -> None:
    assert guard().max_speed_m_per_s == DEFAULT_MAX_SPEED_M_PER_S == 2.0
    assert guard(max_speed_m_per_s=0.5).max_speed_m_per_s == 0.5
    assert guard(device(simulated=True)).max_speed_m_per_s == math.inf
    assert guard(device(simulated=True), max_speed_m_per_s=0.5).max_speed_m_per_s == 0.5


def written(made: Guard, asked_n: float, ticks: int) -> list[float]:
    forces = []
    for _ in range(ticks):
        force_n = [asked_n]
        made.reduce(force_n, PERIOD_S)
        forces.append(force_n[0])
    return forces


def test_a_release_is_a_ramp_of_its_duration_and_ends_disarmed() -> None:
    made = armed()
    made.release(0.02)
    assert written(made, 10.0, 21) == pytest.approx([10.0 * (1.0 - step / 20.0) for step in range(1, 21)] + [0.0])
    assert made.mode is Mode.DISARMED
    assert not made.latched


def test_a_release_under_way_is_made_faster_and_never_slower() -> None:
    made = armed()
    made.release(0.02)
    forces = [10.0, *written(made, 10.0, 5)]
    made.release(1.0)
    forces += written(made, 10.0, 1)
    assert forces[-2] - forces[-1] == pytest.approx(0.5)
    made.release(0.01)
    forces += written(made, 10.0, 7)
    assert forces[-1] == pytest.approx(0.0, abs=1e-12)
    assert max(a - b for a, b in itertools.pairwise(forces)) <= 1.0 + 1e-9


@pytest.mark.parametrize("ramp_s", [0.0, 1e-6, 1e-3])
def test_a_release_that_takes_no_longer_than_a_tick_is_over_at_once(ramp_s: float) -> None:
    made = armed()
    made.release(ramp_s)
    assert written(made, 10.0, 1) == [0.0]


def test_a_force_that_has_been_let_out_leaves_no_gain() -> None:
    made = armed()
    made.drop()
    assert (made.mode, made.gain) == (Mode.DISARMED, 0.0)
    assert made.arm()
    assert made.gain == 1.0


def test_a_fault_latches_until_it_is_cleared_explicitly() -> None:
    made = armed()
    made.release(0.005, latch=True)
    written(made, 10.0, 10)
    assert not made.arm()
    assert written(made, 10.0, 1) == [0.0]
    made.clear()
    assert made.mode is Mode.DISARMED
    assert written(made, 10.0, 1) == [0.0]
    assert made.arm()
    assert written(made, 10.0, 1) == [10.0]


def test_a_fault_during_a_release_latches_too() -> None:
    made = armed()
    made.release(0.02)
    written(made, 10.0, 3)
    made.release(0.02, latch=True)
    written(made, 10.0, 20)
    assert made.latched
    assert not made.arm()


def test_a_fault_while_disarmed_latches() -> None:
    made = guard()
    made.release(0.02, latch=True)
    assert not made.arm()


@pytest.mark.parametrize("axis_only", [False, True])
def test_a_lowered_limit_comes_down_by_a_ramp_from_what_is_in_use(axis_only: bool) -> None:
    """Pressed with 8 N under 12 N, then limited to 2 N: 6 N in 20 ticks, and not at once."""
    made = armed()
    forces = written(made, 8.0, 1)
    key = "max_axis_force_n" if axis_only else "max_force_n"
    made.configure(SafetyConfig.model_validate({key: 2.0, "ramp_s": 0.02}), device(), [forces[-1]])
    forces += written(made, 8.0, 30)
    assert forces[-1] == pytest.approx(2.0)
    assert max(a - b for a, b in itertools.pairwise(forces)) == pytest.approx(6.0 / 20.0)
    assert made.limit_n == 2.0


def test_a_raised_limit_goes_up_by_a_ramp() -> None:
    made = armed(max_force_n=2.0)
    forces = written(made, 100.0, 1)
    made.configure(SafetyConfig(ramp_s=0.02), device(), [forces[-1]])
    forces += written(made, 100.0, 30)
    assert forces[-1] == pytest.approx(12.0)
    assert max(b - a for a, b in itertools.pairwise(forces)) == pytest.approx(0.5)


def test_a_blend_that_begins_late_does_not_count_what_passed_before_and_one_that_has_begun_does() -> None:
    for first in (0, 1):
        state = SimpleNamespace()
        start_blend(state, 0.0, -1.0, 12.0, 50)
        begin_late(state, 20.0)
        assert blended(state, -1.0, 10.0, 21.0 + first) == pytest.approx(10.0 * first / 50)
        begin_late(state, 20.0)
        assert blended(state, -1.0, 10.0, 21.0) == pytest.approx(10.0 * (first + 21) / 50)
    state = SimpleNamespace(blending=False, blend_tick=-1.0)
    begin_late(state, 20.0)
    assert state.blend_tick == -1.0


@pytest.mark.parametrize(
    ("limit_n", "longer"), [(12.0, 2.0), (24.0, 1.0), (30.0, 1.0), (1.0, 10.0), (0.0, 1.0), (math.inf, 1.0)]
)
def test_a_blend_from_more_than_the_limit_is_so_much_longer_and_goes_on_to_as_much(
    limit_n: float, longer: float
) -> None:
    for from_n in (24.0, -24.0):
        state = SimpleNamespace()
        start_blend(state, from_n, -1.0, limit_n, 50)
        assert state.blend_ticks == 50.0 * longer
        assert state.blend_limit_n == limit_n * longer


def test_limits_that_begin_to_move_after_the_last_tick_do_not_count_what_passed_before() -> None:
    """And a release does, whose force was held; what a tick was not told in time counts for no later one."""
    made = armed(max_force_n=8.0)
    made.reduce([5.0], PERIOD_S)
    made.configure(SafetyConfig(max_force_n=3.0), device(), [5.0])
    made.begin_late(0.02)
    made.reduce([5.0], PERIOD_S + 0.02)
    assert made.max_force_n == pytest.approx(5.0 - 2.0 / 50)
    made.reduce([5.0], PERIOD_S)
    assert made.max_force_n == pytest.approx(5.0 - 4.0 / 50)
    made.release(0.05)
    made.begin_late(0.02)
    made.reduce([5.0], PERIOD_S + 0.02)
    assert made.gain == pytest.approx(1.0 - 21 / 50)
    made.configure(SafetyConfig(max_force_n=8.0), device(), [5.0])
    before_n = made.max_force_n
    made.begin_late(0.02)
    made.reduce([5.0], PERIOD_S)  # of an arming the first tick counts one period at most
    assert made.max_force_n == before_n
    made = armed(max_force_n=8.0)
    made.reduce([5.0], PERIOD_S)
    made.begin_late(0.02)  # nothing moves
    made.configure(SafetyConfig(max_force_n=3.0), device(), [5.0])
    made.reduce([5.0], PERIOD_S)
    assert made.max_force_n == pytest.approx(5.0 - 2.0 / 50)


def test_limits_that_return_from_simulation_start_from_the_force_in_use() -> None:
    info = device(math.inf, simulated=True)
    made = armed(info, profile="simulation")
    forces = written(made, 100.0, 1)
    made.configure(SafetyConfig(ramp_s=0.02, max_force_n=12.0), info, [forces[-1]])
    forces += written(made, 100.0, 30)
    assert forces[-1] == pytest.approx(12.0)
    assert max(a - b for a, b in itertools.pairwise(forces)) == pytest.approx(88.0 / 20.0)


BLEND_FORCES = st.floats(-1e6, 1e6)


@given(
    from_n=st.floats(-12.0, 12.0),
    from_x_m=st.floats(-0.02, -1e-6),
    ticks=st.integers(1, 60),
    forces_n=st.lists(BLEND_FORCES, min_size=130, max_size=130),
    depths_m=st.lists(st.floats(-0.02, -1e-9), min_size=130, max_size=130),
)
def test_a_blend_steps_no_further_than_its_bound_and_ends_within_it(
    from_n: float, from_x_m: float, ticks: int, forces_n: list[float], depths_m: list[float]
) -> None:
    """|dF| <= 2 limit / N + |d of the new force, cut at its bound| + |d of the old one with depth|.

    The bound is the limit until w = 1, and w times the limit from then on.
    """
    state = SimpleNamespace()
    start_blend(state, from_n, from_x_m, 12.0, ticks)

    def old(x_m: float) -> float:
        return from_n * min(1.0, x_m / from_x_m)

    def cut(force_n: float, at: int) -> float:
        reach_n = 12.0 * max(1.0, at / ticks)
        return max(-reach_n, min(reach_n, force_n))

    last_n = from_n
    last_x_m, last_new_n = from_x_m, forces_n[0]
    for tick, (x_m, new_n) in enumerate(zip(depths_m, forces_n, strict=True)):
        if not state.blending:
            break
        force_n = blended(state, x_m, new_n, 1.0)
        moved_n = abs(cut(new_n, tick) - cut(last_new_n, tick)) + abs(old(x_m) - old(last_x_m))
        assert abs(force_n - last_n) <= 2.0 * 12.0 / ticks + moved_n + 1e-9
        assert state.blending == (tick < ticks or new_n != pytest.approx(cut(new_n, tick), abs=1e-9))
        last_n, last_x_m, last_new_n = force_n, x_m, new_n


def test_a_blend_starts_at_the_old_force_and_lets_it_out_with_the_depth() -> None:
    state = SimpleNamespace()
    start_blend(state, 6.0, -1e-3, 12.0, 50)
    assert blended(state, -1e-3, 100.0, 1.0) == 6.0
    start_blend(state, 6.0, -1e-3, 12.0, 50)
    assert blended(state, -5e-4, 100.0, 1.0) == 3.0
    start_blend(state, 6.0, -1e-3, 12.0, 50)
    assert blended(state, -4e-3, 100.0, 1.0) == 6.0


def test_a_blend_begins_with_its_first_sample_however_soon_that_tick_comes() -> None:
    state = SimpleNamespace()
    start_blend(state, 5.0, -1e-3, 12.0, 50)
    assert blended_again(state, -1e-3, 11.0, 1.0) == 5.0  # what to go over to is not known yet
    assert blended(state, -1e-3, 11.0, 0.05) == 5.0
    assert blended_again(state, -1e-3, 11.0, 25.0) == 8.0


def test_a_blend_without_a_limit_ends_with_its_ticks() -> None:
    state = SimpleNamespace()
    start_blend(state, 0.0, -1e-3, math.inf, 4)
    assert [blended(state, -1e-3, 1e6, 1.0) for _ in range(5)] == [0.0, 2.5e5, 5e5, 7.5e5, 1e6]
    assert not state.blending


def test_what_is_not_in_use_of_an_axis_limit_goes_at_once_however_low_it_falls() -> None:
    """T11: below 1 N as well: 0.2 N along an axis from the tick after the change, with no force there yet."""
    for force_n in ([0.0, 0.0, 0.0], [0.1, 0.0, -0.1]):
        made = armed()
        made.configure(SafetyConfig(max_axis_force_n=0.2), device(), force_n)
        assert made.max_axis_n == 0.2
        asked_n = [5.0, 0.0, 0.0]
        made.reduce(asked_n, PERIOD_S)
        assert asked_n[0] == pytest.approx(0.2)


def test_after_a_blend_its_bound_opens_no_faster_than_it_came_in() -> None:
    """A force that asks for ten times the limit: F = w limit from w = 1 on, and all of it at w = 10."""
    state = SimpleNamespace()
    start_blend(state, 4.0, -1e-3, 12.0, 10)
    forces_n = [blended(state, -1e-3, 120.0, 1.0) for _ in range(101)]
    assert forces_n[5] == pytest.approx(0.5 * 4.0 + 0.5 * 12.0)
    assert forces_n[10:] == pytest.approx([1.2 * done for done in range(10, 101)])
    assert forces_n[100] == 120.0
    assert not state.blending


def test_limits_that_are_under_way_arrive_while_the_device_is_disarmed() -> None:
    """Dropped in the middle of their ramp, as where a position is lost."""
    made = armed(ramp_s=0.05, max_force_n=2.0)
    made.configure(SafetyConfig(ramp_s=0.05, max_force_n=10.0), device(), [2.0, 0.0, 0.0])
    made.reduce([0.0, 0.0, 0.0], PERIOD_S)
    made.reduce([0.0, 0.0, 0.0], PERIOD_S)
    made.drop()
    for _ in range(60):
        made.reduce([0.0, 0.0, 0.0], PERIOD_S)
    assert (made.max_force_n, made.max_axis_n, made.limit_n) == (10.0, 10.0, 10.0)


def test_a_limit_on_the_whole_force_goes_up_by_a_ramp_also_where_no_axis_may_have_more() -> None:
    made = armed(max_force_n=6.0, max_axis_force_n=5.0)
    made.configure(SafetyConfig(max_force_n=8.0, max_axis_force_n=5.0), device())
    lengths = []
    for _ in range(60):
        force_n = [5.0, 5.0]
        made.reduce(force_n, PERIOD_S)
        lengths.append(math.hypot(*force_n))
    assert lengths[0] == pytest.approx(6.0 + 2.0 / 50.0)
    assert lengths[24] == pytest.approx(7.0)
    assert lengths[-1] == pytest.approx(math.hypot(5.0, 5.0))


def test_where_nothing_changes_a_tick_is_spared_the_look_at_what_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also once a change has come to its end."""
    looks: list[float] = []
    change = Guard._change

    def look(self: Guard, dt_s: float) -> None:
        looks.append(dt_s)
        change(self, dt_s)

    monkeypatch.setattr(Guard, "_change", look)
    made = armed()
    made.configure(SafetyConfig(max_force_n=2.0, ramp_s=5.0 * PERIOD_S), device(), [8.0])
    written(made, 8.0, 40)
    assert made.limit_n == 2.0
    assert len(looks) < 10
    made.release(5.0 * PERIOD_S)
    written(made, 1.0, 40)
    assert made.mode is Mode.DISARMED
    assert len(looks) < 20
