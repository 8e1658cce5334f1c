"""What a calibration does to a handle, whatever the handle does: force, way and time are bounded."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.errors import DeviceFaultError
from hapticd_drivers.rig import motion
from hapticd_drivers.rig.motion import Moment
from tests.drivers.rig.handle import BOUND_N, COUNT_M, Handle, drive_of


def test_a_motor_that_is_right_passes_after_a_millimetre() -> None:
    handle = Handle()
    motion.check_sign(drive_of(handle))
    assert abs(handle.position_m) < 2e-3
    assert handle.forces_n[-1] == 0.0


@pytest.mark.parametrize("towards", [-1.0, 1.0])
@pytest.mark.parametrize("starts_m", [-0.03, 0.0, 0.05])
def test_an_end_is_found_from_wherever_the_handle_stands(towards: float, starts_m: float) -> None:
    handle = Handle()
    handle.position_m = starts_m
    found = motion.find_stop(drive_of(handle), towards) * COUNT_M
    assert found == pytest.approx(handle.stops_m[towards > 0.0], abs=2 * COUNT_M)
    assert handle.fastest_m_per_s < 4 * 0.02


@pytest.mark.parametrize("starts_m", [-0.025, -0.01, 0.03])
def test_a_switch_is_found_from_both_sides_of_it(starts_m: float) -> None:
    handle = Handle(switch_m=-0.02)
    handle.position_m = starts_m
    assert motion.find_switch(drive_of(handle), -1.0) * COUNT_M == pytest.approx(-0.02, abs=1e-4)


class Disturbed(Handle):
    """A handle above its home switch, which noise closes for a sample on the way, so many times."""

    def __init__(self, times: int) -> None:
        super().__init__(switch_m=-0.02)
        self.position_m = 0.03
        self.times = times
        self.disturbed = 0

    def push(self, axis: int, force_n: float) -> Moment:
        now = super().push(axis, force_n)
        if self.disturbed < self.times and now.position_m < 0.005 - 0.01 * self.disturbed:
            self.disturbed += 1
            return now._replace(switch=True)
        return now


@pytest.mark.parametrize("passes", [1, 2])
def test_a_switch_that_noise_closes_on_the_way_gives_no_home(passes: int) -> None:
    """One sample of it, beside a motor's pulses: home was 60 mm off, and calibrated."""
    handle = Disturbed(passes)
    with pytest.raises(DeviceFaultError, match="closed at two places"):
        motion.find_switch(drive_of(handle), -1.0)
    assert handle.disturbed == passes
    assert handle.forces_n[-1] == 0.0


@pytest.mark.parametrize("towards", [-1.0, 1.0])
def test_a_switch_that_never_opens_gives_no_home(towards: float) -> None:
    """Stuck, or closed at rest: the far end of the travel was taken for home."""
    handle = Handle(switch_m=1.0)
    with pytest.raises(DeviceFaultError, match="does not open"):
        motion.find_switch(drive_of(handle), towards)
    assert handle.forces_n[-1] == 0.0


def test_a_handle_without_an_end_is_not_driven_for_ever() -> None:
    handle = Handle(stops_m=(-10.0, 10.0))
    with pytest.raises(DeviceFaultError, match="found no end"):
        motion.find_stop(drive_of(handle), -1.0)
    assert abs(handle.position_m) < 2.0 * 0.08
    assert handle.forces_n[-1] == 0.0


def test_a_reversed_motor_in_a_drive_ends_by_its_speed() -> None:
    """A drive comes after the check of the sign; a wire that comes loose in between must not turn it into a throw."""
    handle = Handle(motor=-1.0)
    with pytest.raises(DeviceFaultError, match="as fast as it should"):
        motion.find_stop(drive_of(handle), -1.0)
    assert handle.fastest_m_per_s < 3 * motion.FAST * 0.02
    assert handle.forces_n[-1] == 0.0


def test_a_place_where_the_handle_sticks_is_not_taken_for_the_end() -> None:
    """It is held up half-way at first, and goes on at the second try."""
    handle = Handle()
    handle.stops_m = (-0.01, 0.05)
    push = handle.push

    def freed(axis: int, force_n: float) -> Moment:
        now = push(axis, force_n)
        if handle.time_s > 1.5:
            handle.stops_m = (-0.03, 0.05)
        return now

    handle.push = freed  # type: ignore[method-assign]  # changes its stops on the way
    with pytest.raises(DeviceFaultError, match="two places"):
        motion.find_stop(drive_of(handle), -1.0)


class Mad:
    """A handle that is wherever it likes, on a clock that runs as it likes, but runs.

    Args:
        way: positions [counts] and steps of time [ms], again and again.
    """

    def __init__(self, way: list[tuple[int, int, bool]]) -> None:
        self.way = way
        self.forces_n: list[float] = []
        self.time_s = 0.0

    def push(self, axis: int, force_n: float) -> Moment:
        counts, step_ms, switch = self.way[len(self.forces_n) % len(self.way)]
        self.forces_n.append(force_n)
        self.time_s += 1e-3 * step_ms
        return Moment(self.time_s, counts * COUNT_M, counts, switch)


@given(
    way=st.lists(
        st.tuples(st.integers(-(2**31), 2**31 - 1) | st.integers(-100, 100), st.integers(5, 500), st.booleans()),
        min_size=1,
        max_size=30,
    ),
    routine=st.sampled_from(["check_sign", "find_stop", "find_switch", "here"]),
)
def test_whatever_a_handle_does_the_force_is_bounded_and_ends(way: list[tuple[int, int, bool]], routine: str) -> None:
    handle = Mad(way)
    drive = drive_of(handle)
    try:
        match routine:
            case "check_sign":
                motion.check_sign(drive)
            case "find_stop":
                motion.find_stop(drive, -1.0)
            case "find_switch":
                motion.find_switch(drive, 1.0)
            case "here":
                motion.here(drive)
    except DeviceFaultError:
        pass
    assert all(abs(force_n) <= BOUND_N for force_n in handle.forces_n)
    assert handle.forces_n[-1] == 0.0
    assert handle.time_s < 300.0


class Drifting(Handle):
    """A handle that goes a bit further with each push, whichever way it is pushed."""

    def __init__(self, with_n: float, against_n: float) -> None:
        super().__init__()
        self.with_n, self.against_n = with_n, against_n

    def push(self, axis: int, force_n: float) -> Moment:
        step_m = 0.0
        if force_n > 0.0:
            step_m = self.with_n
        elif force_n < 0.0:
            step_m = self.against_n
        self.time_s += 1e-3
        self.position_m += step_m
        self.forces_n.append(force_n)
        counts = round(self.position_m / COUNT_M)
        return Moment(self.time_s, counts * COUNT_M, counts, False)


@pytest.mark.parametrize("step_m", [1e-5, -1e-5])
def test_a_handle_that_moves_by_itself_is_told_in_either_direction(step_m: float) -> None:
    """T10."""
    with pytest.raises(DeviceFaultError, match="moves by itself"):
        motion.check_sign(drive_of(Drifting(step_m, step_m)))


@pytest.mark.parametrize(
    ("moves_m", "says"),
    [((1e-5, -1e-5), ""), ((1e-5, 0.0), ""), ((0.0, -1e-5), ""), ((-1e-5, 1e-5), "wrong way"),
     ((-1e-5, 0.0), "wrong way"), ((0.0, 1e-5), "wrong way"), ((0.0, 0.0), "does not move")],
)  # fmt: skip
def test_the_sign_is_told_from_one_direction_where_the_other_is_held(moves_m: tuple[float, float], says: str) -> None:
    drive = drive_of(Drifting(*moves_m))
    if says:
        with pytest.raises(DeviceFaultError, match=says):
            motion.check_sign(drive)
    else:
        motion.check_sign(drive)


def test_less_than_half_a_millimetre_tells_no_sign() -> None:
    """T10: a nudge lasts 0.5 s; 0.45 mm in it is play, and 0.55 mm a motor."""
    with pytest.raises(DeviceFaultError, match="does not move"):
        motion.check_sign(drive_of(Drifting(0.9e-6, -0.9e-6)))
    motion.check_sign(drive_of(Drifting(1.1e-6, -1.1e-6)))


def test_where_counts_are_coarse_eight_of_them_tell_the_sign() -> None:
    coarse = replace(drive_of(Drifting(1.4e-6, -1.4e-6)), count_m=1e-4)  # 0.7 mm are seven counts
    with pytest.raises(DeviceFaultError, match="does not move"):
        motion.check_sign(coarse)
    motion.check_sign(replace(drive_of(Drifting(1.7e-6, -1.7e-6)), count_m=1e-4))


def test_a_handle_is_at_rest_when_it_has_not_moved_for_a_tenth_of_a_second() -> None:
    still = Handle()
    motion.here(drive_of(still))
    assert still.time_s == pytest.approx(motion.REST_S, abs=3e-3)
    assert motion.REST_S == 0.1
    rolling = Handle()
    rolling.speed_m_per_s = 0.3
    count = motion.here(drive_of(rolling))
    assert rolling.speed_m_per_s == 0.0
    assert count == round(rolling.position_m / COUNT_M)
    assert rolling.time_s > 0.15


def test_a_handle_that_never_rests_is_told_after_three_seconds() -> None:
    class Restless(Handle):
        def push(self, axis: int, force_n: float) -> Moment:
            self.position_m = 1e-3 * math.sin(30.0 * self.time_s)
            self.time_s += 1e-3
            return Moment(self.time_s, self.position_m, round(self.position_m / COUNT_M), False)

    handle = Restless()
    with pytest.raises(DeviceFaultError, match="does not come to rest"):
        motion.here(drive_of(handle))
    assert handle.time_s == pytest.approx(3.0, abs=0.01)


def test_a_handle_that_creeps_for_ever_is_given_up_in_time() -> None:
    """Twice the time of the longest way at the speed of the drive, and 5 s."""
    handle = Drifting(1e-7, -1e-7)
    handle.time_s = began_s = 1000.0
    with pytest.raises(DeviceFaultError, match="got nowhere within 17 s"):
        motion.find_switch(drive_of(handle), 1.0)
    assert handle.time_s - began_s == pytest.approx(2.0 * (1.5 * 0.08 + motion.LAG_M) / 0.02 + 5.0, abs=0.02)
    assert handle.forces_n[-1] == 0.0


class Sprung(Handle):
    """A handle that once it has been pressed against its lower end is another.

    Args:
        free_m: how far it comes off that end from then on.
        back_m: how far it springs back when it is let go of there.
        shift_m: how much further down the end is from then on.
    """

    def __init__(self, free_m: float = 0.08, back_m: float = 0.0, shift_m: float = 0.0) -> None:
        super().__init__()
        self.free_m, self.back_m, self.shift_m = free_m, back_m, shift_m
        self.pressed = False
        self.turned_at_m = math.nan

    def push(self, axis: int, force_n: float) -> Moment:
        if force_n < 0.0 and math.isnan(self.turned_at_m):
            self.turned_at_m = self.position_m
        if force_n < 0.0 and self.position_m == self.stops_m[0]:
            self.pressed = True
        elif force_n == 0.0 and self.pressed:
            self.pressed = False
            low_m = -0.03 - self.shift_m
            self.stops_m = (low_m, low_m + self.free_m)
            self.position_m += self.back_m
        return super().push(axis, force_n)


def test_a_handle_that_does_not_come_off_its_end_is_stuck() -> None:
    """From half of the way on that it should come off, it is free enough."""
    with pytest.raises(DeviceFaultError, match=r"is stuck: .* = 0\.5 N does not move it"):
        motion.find_stop(drive_of(Sprung(free_m=2e-3)), -1.0)
    assert motion.find_stop(drive_of(Sprung(free_m=3e-3)), -1.0) == -3000


def test_a_handle_that_springs_back_from_its_end_has_another_end_than_where_it_rests() -> None:
    with pytest.raises(DeviceFaultError, match=r"moves \+3.0 mm by itself: let go of it"):
        motion.find_stop(drive_of(Sprung(back_m=3e-3)), -1.0)
    assert motion.find_stop(drive_of(Sprung(back_m=2e-3)), -1.0) == -2800


def test_an_end_is_at_one_place_within_three_tenths_of_a_millimetre_or_four_counts() -> None:
    motion.find_stop(drive_of(Sprung(shift_m=0.25e-3)), -1.0)
    shifted = drive_of(Sprung(shift_m=0.35e-3))
    with pytest.raises(DeviceFaultError, match=r"two places 0\.35 mm apart"):
        motion.find_stop(shifted, -1.0)
    motion.find_stop(replace(drive_of(Sprung(shift_m=0.35e-3)), count_m=1e-4), -1.0)
    with pytest.raises(DeviceFaultError, match="two places"):
        motion.find_stop(replace(drive_of(Sprung(shift_m=0.45e-3)), count_m=1e-4), -1.0)


def test_a_handle_at_its_end_is_taken_off_it_first_and_each_drive_begins_without_force() -> None:
    handle = Sprung()
    handle.position_m = -0.03
    motion.find_stop(drive_of(handle), -1.0)
    assert handle.turned_at_m > -0.03 + 0.8 * motion.BACK_OFF_M
    assert max(map(abs, handle.forces_n[:10])) < 0.2 * BOUND_N
    switched = Handle(switch_m=-0.02)
    motion.find_switch(drive_of(switched), -1.0)
    assert max(map(abs, switched.forces_n[:10])) < 0.2 * BOUND_N


def test_a_switch_that_never_closes_is_told_once_the_handle_has_been_held_up_for_long_enough() -> None:
    """0.3 s, and the time that the drive takes to pull with its whole force; then 0.1 s at rest."""
    handle = Handle(stops_m=(-1e-6, 1e-6))
    with pytest.raises(DeviceFaultError, match="the home switch does not close"):
        motion.find_switch(drive_of(handle), -1.0)
    assert handle.time_s == pytest.approx(0.3 + 2e-3 / 0.02 + 0.1, abs=0.01)
    assert min(handle.forces_n) == pytest.approx(-BOUND_N, rel=0.01)


def test_a_nudge_rises_alike_both_ways() -> None:
    handle = Drifting(0.0, 0.0)
    with pytest.raises(DeviceFaultError, match="does not move"):
        motion.check_sign(drive_of(handle))
    forward = [force_n for force_n in handle.forces_n if force_n > 0.0]
    backward = [-force_n for force_n in handle.forces_n if force_n < 0.0]
    assert forward[:400] == pytest.approx(backward[:400])
    assert forward.index(BOUND_N) == pytest.approx(1e3 * motion.NUDGE_RAMP_S, abs=2.0)
    assert max(forward) == max(backward) == BOUND_N
