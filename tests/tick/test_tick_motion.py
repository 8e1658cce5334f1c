"""Time and speed as a device tells them: frozen, running back, after a gap, too fast."""

from __future__ import annotations

import pytest

from hapticd.config.models import VelocityConfig
from hapticd.device import Sample
from hapticd.errors import ConfigError
from hapticd.tick.event import EventCode
from hapticd.tick.motion import FROZEN_S, Motion
from tests.tick.rig import PERIOD_S, Rig, device, wall
from tests.tick.transitions import pressed


@pytest.mark.parametrize("kind", ["has_clock", "has_sequence"])
def test_a_device_that_repeats_itself_is_frozen_after_twenty_milliseconds(kind: str) -> None:
    rig = pressed(**{kind: True})
    sample = Sample(1)
    sample.position_m[0], sample.time_ns, sample.sequence = -2e-3, rig.sample.time_ns, rig.sample.sequence
    for count in range(round(FROZEN_S / PERIOD_S)):
        assert rig.tick.fault == 0, count
        assert rig.tick.step(sample, PERIOD_S) != [0.0]
        assert rig.tick.motion.dt_s == 0.0
    assert rig.tick.fault == EventCode.DEVICE_FROZEN
    assert rig.tick.guard.latched


def test_a_device_that_is_still_frozen_fails_again_when_it_is_armed() -> None:
    rig = pressed(has_clock=True)
    for _ in range(100):
        rig.tick.step(rig.sample, PERIOD_S)
    assert rig.tick.fault == EventCode.DEVICE_FROZEN
    rig.tick.fault = 0
    rig.tick.guard.clear()
    assert rig.tick.arm()
    rig.tick.step(rig.sample, PERIOD_S)
    assert rig.tick.fault == EventCode.DEVICE_FROZEN


def test_a_clock_that_once_runs_back_is_one_bad_sample_and_no_fault() -> None:
    rig = pressed(has_clock=True)
    rig.force(-2e-3, dt_s=-5.0)
    assert rig.tick.motion.dt_s == 0.0
    assert rig.force(-2e-3, ticks=30) == 4.0
    assert rig.tick.fault == 0


def test_after_a_long_gap_velocity_is_what_it_was_over_the_gap_and_laws_reckon_with_one_period() -> None:
    """A computer that slept for 3 s finds the hand 30 mm further: that was 10 mm/s, and not 30 m/s."""
    rig = Rig(wall(2000.0), at_m=0.0, has_clock=True, safety={"max_speed_m_per_s": 1.0})
    rig.force(0.03, dt_s=3.0)
    assert rig.tick.motion.velocity_m_per_s == [pytest.approx(0.01)]
    assert rig.tick.motion.dt_s == PERIOD_S
    rig.force(0.03)
    assert rig.tick.motion.velocity_m_per_s == [0.0]
    assert rig.tick.fault == 0


def test_while_the_clock_stands_still_the_last_velocity_stands() -> None:
    rig = Rig(wall(2000.0), at_m=0.0, has_clock=True)
    rig.force(1e-3)
    rig.force(3e-3, dt_s=0.0)
    assert rig.tick.motion.velocity_m_per_s == [pytest.approx(1.0)]


@pytest.mark.parametrize("back_s", [3600.0, 1.0, 1.2e-3])
@pytest.mark.parametrize("stood", [0, 3])
def test_a_clock_that_is_set_back_doubles_no_speed(back_s: float, stood: int) -> None:
    """The sample after it tells of the way of two, and also of those in which the clock had stood still before."""
    rig = Rig(wall(2000.0), at_m=0.0, has_clock=True, safety={"max_speed_m_per_s": 0.6})
    places = iter(0.5e-3 * n for n in range(1, 100))
    for _ in range(5):
        rig.force(next(places))
    for _ in range(stood):
        next(places)
        rig.tick.step(rig.sample, PERIOD_S)
    rig.sample.time_ns -= round(back_s * 1e9)
    rig.sample.position_m[0] = next(places)
    rig.tick.step(rig.sample, PERIOD_S)
    assert rig.tick.motion.dt_s == 0.0
    for _ in range(5):
        rig.force(next(places))
        assert rig.tick.motion.velocity_m_per_s == [pytest.approx(0.5)]
    assert rig.tick.fault == 0


def test_a_clock_that_stood_still_and_goes_on_is_believed() -> None:
    """Only after one that ran back this computer's own counts."""
    rig = Rig(wall(2000.0), at_m=0.0, has_clock=True)
    rig.force(1e-3)
    rig.force(1e-3, dt_s=-5.0)
    rig.force(2e-3)
    rig.force(2e-3, dt_s=0.0)
    rig.sample.position_m[0] = 5e-3
    rig.sample.time_ns += 6_000_000
    rig.tick.step(rig.sample, PERIOD_S)
    assert rig.tick.motion.velocity_m_per_s == [pytest.approx(0.5)]


def test_a_device_that_begins_anew_has_a_clock_that_never_ran_back() -> None:
    motion = Motion(VelocityConfig(), device(has_clock=True), PERIOD_S)
    sample = Sample(1)
    sample.time_ns = 10**9
    assert motion.start(sample)
    sample.time_ns = 0
    assert motion.see(sample, PERIOD_S, PERIOD_S, at_rest=False)
    assert motion.start(sample)
    sample.time_ns, sample.position_m[0] = 4_000_000, 2e-3
    assert motion.see(sample, PERIOD_S, PERIOD_S, at_rest=False)
    assert motion.velocity_m_per_s == [pytest.approx(0.5)]


@pytest.mark.parametrize("step_s", [1e-9, 2e-6, 1e-4])
def test_a_step_of_the_clock_that_is_hardly_one_makes_no_blow_of_a_count(step_s: float) -> None:
    """10 um in 2 us are 5 m/s, which under a damper of 50 N s/m is 250 N."""
    rig = Rig(wall(2000.0), at_m=0.0, has_clock=True, safety={"max_speed_m_per_s": 1.0})
    rig.force(0.0, ticks=100)
    rig.force(1e-5, dt_s=step_s)
    assert rig.tick.motion.velocity_m_per_s[0] == pytest.approx(0.02, rel=0.1)
    assert rig.tick.motion.dt_s == pytest.approx(0.5e-3, rel=0.1)
    assert rig.tick.fault == 0
    rig.force(2e-5)
    assert rig.tick.motion.velocity_m_per_s[0] == pytest.approx(0.01)


@pytest.mark.parametrize("has_clock", [True, False])
@pytest.mark.parametrize(("slow_s", "samples"), [(3e-3, 1), (5e-3, 2), (10e-3, 3)])
def test_short_times_in_a_row_are_another_rate_which_is_followed(has_clock: bool, slow_s: float, samples: int) -> None:
    """Each of them halves what is believed. A computer that was busy for a while reads in time again, too."""
    rig = Rig(wall(2000.0), at_m=0.0, has_clock=has_clock)
    rig.force(0.0, ticks=200, dt_s=slow_s)
    rig.at(0.0, ticks=samples - 1)
    rig.force(1e-4)
    assert rig.tick.motion.dt_s > 1.05 * PERIOD_S
    rig.force(2e-4)
    assert rig.tick.motion.velocity_m_per_s == [pytest.approx(0.1)]


def test_short_times_that_are_not_in_a_row_are_none() -> None:
    rig = Rig(wall(2000.0), at_m=0.0, has_clock=True)
    for n in range(50):
        rig.force(1e-5 * (n % 2), dt_s=2e-6 if n % 2 else 2e-3)
        assert rig.tick.motion.dt_s > 0.4e-3


def test_a_device_that_is_too_fast_is_let_go_by_a_ramp() -> None:
    rig = Rig(wall(2000.0), at_m=0.0, safety={"max_speed_m_per_s": 1.0})
    rig.force(-0.9e-3)
    assert rig.tick.fault == 0
    forces = rig.forces(-2e-3, 60)
    assert rig.tick.fault == EventCode.OVER_SPEED
    assert "1.1 m/s" in rig.tick.fault_text
    assert forces[0] == pytest.approx(4.0 * 0.98)
    assert forces[-1] == 0.0
    assert rig.tick.guard.latched


def test_speed_counts_over_all_axes() -> None:
    rig = Rig(axes="xyz", at_m=0.0, safety={"max_speed_m_per_s": 1.0})
    rig.at(0.6e-3, 0.6e-3, 0.0)
    assert rig.tick.fault == 0
    rig.at(1.3e-3, 1.3e-3, 0.7e-3)
    assert rig.tick.fault == EventCode.OVER_SPEED


def test_a_device_without_velocity_cannot_be_asked_for_it() -> None:
    with pytest.raises(ConfigError, match=r"velocity\.estimator.*a device does not measure"):
        Rig(velocity=VelocityConfig(estimator="device"))
    Rig(velocity=VelocityConfig(estimator="device"), has_velocity=True)


def test_an_adaptive_window_that_there_is_no_time_for_is_refused() -> None:
    """C14: each sample of it is looked at in every tick."""
    longest = VelocityConfig(estimator="foaw", samples=64)
    Motion(longest, device("xyz"), 1e-3)
    Motion(longest, device("z"), 1.0 / 4000.0)
    Motion(VelocityConfig(samples=64), device("xyz"), 1.0 / 8000.0)
    Motion(VelocityConfig(estimator="foaw", samples=10), device("xyz"), 1.0 / 8000.0)
    with pytest.raises(ConfigError, match=r"velocity\.samples = 64: foaw .* has time for 10$"):
        Motion(longest, device("xyz"), 1.0 / 8000.0)


def test_a_speed_that_is_watched_from_now_on_knows_nothing_of_the_way_until_then() -> None:
    """Also under a filter, which goes on: 50 mm on the way would be 50 m/s, and a fault."""
    motion = Motion(VelocityConfig(estimator="lowpass", cutoff_hz=50.0), device("z"), PERIOD_S)
    sample = Sample(1)
    assert motion.start(sample)
    sample.position_m[0] = 0.05
    assert motion.see(sample, PERIOD_S, PERIOD_S, at_rest=False)
    motion.watch_speed(True)
    assert motion.see(sample, PERIOD_S, PERIOD_S, at_rest=False)
    assert motion.speed_squared == 0.0


def test_from_a_new_origin_on_positions_count_from_there() -> None:
    motion = Motion(VelocityConfig(), device("z"), PERIOD_S)
    sample = Sample(1)
    sample.position_m[0] = 0.03
    assert motion.start(sample)
    motion.move_origin([0.02])
    assert motion.position_m == [pytest.approx(0.01)]
    assert motion.see(sample, PERIOD_S, PERIOD_S, at_rest=False)
    assert motion.position_m == [pytest.approx(0.01)]
    assert motion.velocity_m_per_s == [pytest.approx(0.0)]
