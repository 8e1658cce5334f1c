"""Where exactly a calibration takes a handle for resting, too fast or too far: what it is shown decides."""

from __future__ import annotations

from dataclasses import replace

import pytest

from hapticd.errors import DeviceFaultError
from hapticd_drivers.rig import motion
from hapticd_drivers.rig.motion import Moment
from tests.drivers.rig.handle import COUNT_M, Handle, drive_of


class Shown:
    """A handle that is seen at these times and places, and stays at the last one."""

    def __init__(self, *seen: tuple[float, float]) -> None:
        self.seen = list(seen)
        self.now_s, self.now_m = seen[0]

    def push(self, axis: int, force_n: float) -> Moment:
        self.now_s, self.now_m = self.seen.pop(0) if self.seen else (self.now_s + 1.0, self.now_m)
        return Moment(self.now_s, self.now_m, round(self.now_m / COUNT_M), False)


def test_a_tenth_of_a_second_is_long_enough_to_be_at_rest() -> None:
    handle = Shown((0.0, 0.0), (0.1, 0.0))
    motion.here(drive_of(handle))
    assert handle.now_s == 0.1


@pytest.mark.parametrize(
    ("moves_m", "count_m", "rests_at_s"),
    [(0.9e-4, COUNT_M, 0.125), (1.1e-4, COUNT_M, 0.1875), (1.9e-4, 1e-4, 0.125), (2.1e-4, 1e-4, 0.1875)],
)
def test_a_handle_that_has_moved_by_a_fifth_of_a_nudge_or_two_counts_begins_to_rest_anew(
    moves_m: float, count_m: float, rests_at_s: float
) -> None:
    handle = Shown((0.0, 0.0), *((at / 16, moves_m) for at in range(1, 9)))
    motion.here(replace(drive_of(handle), count_m=count_m))
    assert handle.now_s == rests_at_s


def test_a_sample_that_is_shown_twice_tells_no_speed() -> None:
    class Twice(Handle):
        shown: Moment | None = None

        def push(self, axis: int, force_n: float) -> Moment:
            now, self.shown = self.shown, None
            if now is None:
                self.shown = now = super().push(axis, force_n)
            return now

    assert motion.find_stop(drive_of(Twice()), -1.0) == pytest.approx(-3000, abs=2)


@pytest.mark.parametrize(("jump_m", "too_fast"), [(0.6e-3, False), (0.8e-3, True)])
def test_one_move_from_sample_to_sample_is_a_fifth_of_the_speed(jump_m: float, too_fast: bool) -> None:
    """8 times 0.02 m/s are too fast; the drive makes 0.02 m/s already."""

    class Jumps(Handle):
        def push(self, axis: int, force_n: float) -> Moment:
            if 0.5 <= self.time_s < 0.501:
                self.position_m -= jump_m
            return super().push(axis, force_n)

    handle = Jumps()
    if too_fast:
        with pytest.raises(DeviceFaultError, match="as fast as it should"):
            motion.find_stop(drive_of(handle), -1.0)
    else:
        motion.find_stop(drive_of(handle), -1.0)


@pytest.mark.parametrize(("step_m", "ends"), [(2.0**-10, "does not close"), (1.01 * 2.0**-10, "as fast as it should")])
def test_eight_times_the_speed_is_not_more_than_that(step_m: float, ends: str) -> None:
    """A fifth of 1 m/s."""
    handle = Shown((0.0, 0.0), (0.0, 0.0), (2.0**-10, step_m))
    with pytest.raises(DeviceFaultError, match=ends):
        motion.find_switch(replace(drive_of(handle), speed_m_per_s=0.025), 1.0)


@pytest.mark.parametrize(("more_m", "ends"), [(0.0, "does not close"), (1e-4, "found no end")])
def test_one_and_a_half_spans_and_the_lag_are_the_farthest_that_a_handle_may_go(more_m: float, ends: str) -> None:
    handle = Shown((0.0, 0.0), (0.0, 0.0), (10.0, 1.5 * 0.08 + motion.LAG_M + more_m))
    with pytest.raises(DeviceFaultError, match=ends):
        motion.find_switch(drive_of(handle), 1.0)
