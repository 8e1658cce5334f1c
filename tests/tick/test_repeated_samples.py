"""A loop that is faster than its device sees each sample several times: the hand is no faster for that."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from hapticd.config.models import VelocityConfig
from tests.tick.rig import LIMIT_N, Rig, scene
from tests.tick.transitions import TRANSITIONS, pressed

PERIOD_S = 2.5e-4
SPEED_M_PER_S = 0.6
EVERY = 4


def speeds_m_per_s(velocity: VelocityConfig, **declared: Any) -> list[float]:
    """What a loop at 4 kHz makes of a hand that moves evenly, from a device that has news once a millisecond."""
    rig = Rig(at_m=0.0, velocity=velocity, safety={"max_speed_m_per_s": 2.0 * SPEED_M_PER_S}, **declared)
    seen = []
    for number in range(1, 200):
        if number % EVERY == 0:
            rig.sample.position_m[0] = SPEED_M_PER_S * number * PERIOD_S
            rig.sample.sequence += 1
            rig.sample.time_ns = round(number * PERIOD_S * 1e9)
        rig.tick.step(rig.sample, PERIOD_S)
        seen.append(rig.tick.motion.velocity_m_per_s[0])
    assert rig.tick.fault == 0
    return seen[EVERY * 16 :]


@pytest.mark.parametrize(
    "velocity",
    [{}, {"samples": 5}, {"estimator": "lowpass", "cutoff_hz": 300.0}, {"estimator": "foaw", "samples": 8}],
    ids=str,
)
@pytest.mark.parametrize("kind", ["has_clock", "has_sequence"])
def test_an_even_motion_has_an_even_velocity(kind: str, velocity: dict[str, Any]) -> None:
    seen = speeds_m_per_s(VelocityConfig.model_validate(velocity), **{kind: True, "resolution_m": 1e-9})
    assert seen == pytest.approx([SPEED_M_PER_S] * len(seen), rel=1e-3)


def test_without_clock_and_count_nobody_can_tell_a_repeated_sample_from_a_rest() -> None:
    rig = Rig(at_m=0.0)
    for number in range(1, 97):
        if number % EVERY == 0:
            rig.sample.position_m[0] += SPEED_M_PER_S * EVERY * PERIOD_S
        rig.tick.step(rig.sample, PERIOD_S)
    assert rig.tick.motion.velocity_m_per_s[0] == pytest.approx(EVERY * SPEED_M_PER_S)


@pytest.mark.parametrize("has_sequence", [False, True])
def test_a_tick_in_time_after_a_late_one_makes_nobody_ten_times_as_fast(has_sequence: bool) -> None:
    """A device that takes a sample a millisecond has a whole one more in the 0.1 ms that are left: 3 m/s of 0.3."""
    rig = Rig(at_m=0.0, has_sequence=has_sequence, safety={"max_speed_m_per_s": 1.0})
    at_s = 0.0
    for dt_s in [1e-3] * 50 + [1.9e-3, 0.1e-3] + [1e-3] * 20:
        at_s += dt_s
        samples = round(at_s * 1e3 - 0.05)
        rig.sample.position_m[0] = 0.3e-3 * samples
        rig.sample.sequence = samples
        rig.tick.step(rig.sample, dt_s)
        assert rig.tick.motion.velocity_m_per_s[0] <= 0.6 + 1e-9
    assert rig.tick.fault == 0
    assert rig.tick.motion.velocity_m_per_s[0] == pytest.approx(0.3)


def test_another_rate_of_a_device_without_a_clock_is_followed() -> None:
    rig = Rig(at_m=0.0, has_sequence=True)
    for every in (1, 10, 1):
        for number in range(2000):
            if number % every == 0:
                rig.sample.position_m[0] += 0.1e-3 * every
                rig.sample.sequence += 1
            rig.tick.step(rig.sample, 1e-3)
        assert rig.tick.motion.velocity_m_per_s[0] == pytest.approx(0.1)


def test_the_time_that_a_law_is_told_is_the_time_that_passed() -> None:
    rig = Rig(at_m=0.0, has_sequence=True)
    told = []
    for _, fresh in itertools.product(range(20), (False, False, True)):
        if fresh:
            rig.sample.sequence += 1
        rig.tick.step(rig.sample, PERIOD_S)
        if fresh:
            told.append(rig.tick.motion.dt_s)
    assert told == pytest.approx([3 * PERIOD_S] * 20)


def test_a_wall_that_goes_between_two_samples_holds_its_force_until_there_is_a_new_one_and_closes_its_books() -> None:
    """Also where its ramp is shorter than the time between them: its new law has not been asked yet. Then it ramps."""
    rig = pressed(has_sequence=True, safety={"ramp_s": 0.002})
    rig.switch(scene())
    for _ in range(6):
        assert rig.tick.step(rig.sample, 1e-3) == [4.0]
    assert [rig.force(-1e-3) for _ in range(3)] == [2.0, 1.0, 0.0]
    assert rig.tick.leaving == []
    energy_j, stored_j, dissipated_j, generated_j = rig.books_j
    assert energy_j == pytest.approx(rig.energy_j) == pytest.approx(-4e-3)
    assert energy_j == pytest.approx(stored_j + dissipated_j - generated_j)
    assert stored_j == 0.0


@pytest.mark.parametrize("transition", TRANSITIONS)
def test_a_ramp_that_is_shorter_than_the_time_between_two_samples_makes_no_step(transition: str) -> None:
    """It was over before the law had seen a sample of the new wall, or the new law any, and that came all at once."""
    change, goal_n = TRANSITIONS[transition]
    ramp, between = 12, 20
    rig = pressed(has_sequence=True, nominal_rate_hz=50.0, safety={"ramp_s": ramp * 1e-3})
    forces_n = []
    for number in range(5 * between):
        if number == 3:
            change(rig)
        rig.sample.sequence += number % between == 0
        forces_n.append(rig.tick.step(rig.sample, 1e-3)[0])
    most_n = 2.0 * LIMIT_N / ramp  # between any two forces that are within the limit
    assert max(abs(later - before) for before, later in itertools.pairwise(forces_n)) <= most_n * (1.0 + 1e-9)
    assert forces_n[-1] == pytest.approx(goal_n)
