"""Velocity from positions: what each estimator says of a motion that is known."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.config.models import VelocityConfig
from hapticd.tick.velocity import (
    AdaptiveWindow,
    DeviceVelocity,
    Difference,
    Estimator,
    LongDifference,
    LowPass,
    make_estimator,
)

STEPS_S = st.lists(st.floats(1e-5, 0.5), min_size=1, max_size=200)
ALL = [
    VelocityConfig(),
    VelocityConfig(samples=7),
    VelocityConfig(estimator="lowpass", cutoff_hz=50.0),
    VelocityConfig(estimator="foaw", samples=12),
]


def estimator(config: VelocityConfig, resolution_m: float = 1e-5) -> Estimator:
    made = make_estimator(config, resolution_m)
    made.start(0.0)
    return made


@pytest.mark.parametrize("config", ALL, ids=lambda config: f"{config.estimator}-{config.samples}")
def test_an_axis_that_stands_still_has_no_velocity_whatever_the_clock_does(config: VelocityConfig) -> None:
    made = make_estimator(config, 1e-5)
    made.start(0.3)
    assert [made.update(0.3, dt_s, 5.0) for dt_s in (1e-3, 0.0, 2e-3, 1e-9, 0.5, 100.0)] == [0.0] * 6


@pytest.mark.parametrize("config", ALL, ids=lambda config: f"{config.estimator}-{config.samples}")
def test_while_time_stands_still_the_last_velocity_stands(config: VelocityConfig) -> None:
    made = estimator(config)
    moving = made.update(1e-3, 1e-3, 0.0)
    assert moving > 0.0
    assert made.update(5e-3, 0.0, 0.0) == moving
    assert made.update(5e-3, -1e-3, 0.0) == moving


@pytest.mark.parametrize("config", ALL, ids=lambda config: f"{config.estimator}-{config.samples}")
def test_after_a_start_the_past_is_forgotten(config: VelocityConfig) -> None:
    made = estimator(config)
    for count in range(30):
        made.update(0.01 * count * count, 1e-3, 0.0)
    made.start(-4.0)
    assert made.update(-4.0, 1e-3, 0.0) == 0.0


@given(steps_s=STEPS_S, speed=st.floats(-2.0, 2.0), samples=st.integers(1, 64))
def test_a_straight_motion_is_seen_exactly_whatever_the_sampling(
    steps_s: list[float], speed: float, samples: int
) -> None:
    """Also by the first samples, when no full window has come yet, and when the time between samples varies."""
    made: list[Estimator] = [Difference(), LongDifference(samples), AdaptiveWindow(samples, 1e-5)]
    for each in made:
        each.start(0.25)
    now_s = 0.0
    for dt_s in steps_s:
        now_s += dt_s
        for each in made:
            assert each.update(0.25 + speed * now_s, dt_s, 0.0) == pytest.approx(speed, abs=1e-7)


def test_the_long_difference_is_late_by_half_its_window() -> None:
    made = LongDifference(4)
    made.start(0.0)
    period_s = 1e-3
    for count in range(1, 20):
        velocity = made.update((count * period_s) ** 2, period_s, 0.0)
    assert velocity == pytest.approx(2.0 * (19 - 2) * period_s)


def test_the_long_difference_stays_exact_over_hours() -> None:
    """Its clock is wound back every few seconds: 1 ms in eleven days of seconds is known to a part in ten million."""
    made = LongDifference(2)
    made.start(0.0)
    made.update(0.0, 1e6, 0.0)
    for count in range(1, 101):
        velocity = made.update(5e-5 * count, 1e-3, 0.0)
        assert count < 2 or velocity == pytest.approx(0.05, rel=1e-12)


@given(steps_s=STEPS_S)
def test_the_low_pass_answers_a_step_of_velocity_as_the_continuous_one_does(steps_s: list[float]) -> None:
    """v(t) = 1 - exp(-w t) at every sample, however far apart: exact for a step."""
    made = LowPass(3.0)
    made.start(0.0)
    now_s = 0.0
    for dt_s in steps_s:
        now_s += dt_s
        velocity = made.update(now_s, dt_s, 0.0)
        assert velocity == pytest.approx(-math.expm1(-2.0 * math.pi * 3.0 * now_s), rel=1e-6, abs=1e-9)


def longest_fit(track: list[tuple[float, float]], samples: int, noise_m: float) -> float:
    """The definition, word by word: try each window, look at each sample in it."""
    now_s, now_m = track[-1]
    velocity = 0.0
    for length in range(1, min(samples, len(track) - 1) + 1):
        start_s, start_m = track[-1 - length]
        slope = (now_m - start_m) / (now_s - start_s)
        inside = track[len(track) - length : -1]
        if any(abs(at_m - (now_m - slope * (now_s - at_s))) > noise_m * (1.0 + 1e-9) for at_s, at_m in inside):
            break
        velocity = slope
    return velocity


@given(
    moves=st.lists(st.tuples(st.integers(-3, 3), st.sampled_from([1, 1, 1, 2])), min_size=1, max_size=60),
    samples=st.integers(1, 20),
)
def test_the_adaptive_window_is_the_longest_line_that_misses_no_sample_by_more_than_the_noise(
    moves: list[tuple[int, int]], samples: int
) -> None:
    """Whole counts and whole milliseconds, at a noise that no error of rounding comes near."""
    made = AdaptiveWindow(samples, 1.0001)
    made.start(0.0)
    track = [(0.0, 0.0)]
    for counts, steps in moves:
        track.append((track[-1][0] + steps, track[-1][1] + counts))
        velocity = made.update(track[-1][1], float(steps), 0.0)
        assert velocity == pytest.approx(longest_fit(track, samples, 1.0001), rel=1e-12, abs=1e-12)


def test_the_adaptive_window_falls_back_to_one_sample_on_a_jump() -> None:
    made = AdaptiveWindow(16, 1e-5)
    made.start(0.0)
    for count in range(1, 30):
        made.update(1e-5 * count, 1e-3, 0.0)
    assert made.update(0.1, 1e-3, 0.0) == pytest.approx((0.1 - 29e-5) / 1e-3)


def test_the_adaptive_window_is_quieter_than_a_difference_on_a_slow_quantised_motion() -> None:
    """At 2.5 mm/s and 10 um a difference sees 0 or 10 mm/s; the window sees the slope."""
    made = AdaptiveWindow(32, 1e-5)
    difference = Difference()
    for each in (made, difference):
        each.start(0.0)
    worst = worst_difference = 0.0
    for count in range(1, 200):
        position_m = round(2.5e-3 * count * 1e-3 / 1e-5) * 1e-5
        if count > 64:
            worst = max(worst, abs(made.update(position_m, 1e-3, 0.0) - 2.5e-3))
            worst_difference = max(worst_difference, abs(difference.update(position_m, 1e-3, 0.0) - 2.5e-3))
        else:
            made.update(position_m, 1e-3, 0.0)
            difference.update(position_m, 1e-3, 0.0)
    assert worst < 0.4e-3
    assert worst_difference == pytest.approx(7.5e-3)


def test_the_noise_of_the_adaptive_window_is_the_resolution_unless_named() -> None:
    for named, expected in ((None, 2e-5), (1e-4, 1e-4), (0.0, 0.0)):
        made = make_estimator(VelocityConfig(estimator="foaw", samples=4, noise_m=named), 2e-5)
        assert isinstance(made, AdaptiveWindow)
        assert made._noise_m == pytest.approx(expected)


def test_the_devices_own_velocity_is_passed_on() -> None:
    made = make_estimator(VelocityConfig(estimator="device"), 1e-5)
    made.start(0.0)
    assert made.update(9.0, 1e-3, 0.125) == 0.125


@pytest.mark.parametrize(
    ("keys", "kind"),
    [
        ({}, Difference),
        ({"samples": 1}, Difference),
        ({"samples": 2}, LongDifference),
        ({"estimator": "lowpass"}, LowPass),
        ({"estimator": "lowpass", "samples": 8}, LowPass),
        ({"estimator": "foaw", "samples": 8}, AdaptiveWindow),
        ({"estimator": "device", "samples": 8}, DeviceVelocity),
    ],
)
def test_each_estimator_is_the_one_that_was_asked_for(keys: dict[str, Any], kind: type) -> None:
    assert type(make_estimator(VelocityConfig.model_validate(keys), 1e-5)) is kind


@pytest.mark.parametrize("samples", [1, 4])
def test_a_difference_spans_as_many_samples_as_it_was_asked_for(samples: int) -> None:
    made = make_estimator(VelocityConfig(samples=samples), 0.0)
    made.start(0.0)
    for count in range(1, 10):
        made.update(float(count * count), 1.0, 0.0)
    assert made.update(100.0, 1.0, 0.0) == pytest.approx((100.0 - (10.0 - samples) ** 2) / samples)


@pytest.mark.parametrize("keys", [{}, {"samples": 4}, {"estimator": "lowpass"}, {"estimator": "foaw", "samples": 4}])
def test_who_starts_anew_stands_where_it_is_told(keys: dict[str, Any]) -> None:
    made = make_estimator(VelocityConfig.model_validate(keys), 1e-5)
    made.start(0.0)
    for count in range(1, 10):
        made.update(1e-2 * count, 1e-3, 0.0)
    made.start(0.5)
    assert made.update(0.5, 0.0, 0.0) == 0.0
    assert made.update(0.5, 1e-3, 0.0) == 0.0
    assert 0.0 < made.update(0.501, 1e-3, 0.0) <= 1.0 + 1e-9


def test_a_low_pass_reckons_its_share_anew_where_the_period_is_another_one_and_only_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An exponential each tick is what it spares."""
    asked: list[float] = []

    def reckon(exponent: float, expm1: Callable[[float], float] = math.expm1) -> float:
        asked.append(exponent)
        return expm1(exponent)

    made = LowPass(3.0)
    made.start(0.0)
    monkeypatch.setattr(math, "expm1", reckon)
    for dt_s in (1e-3, 1e-3, 1e-3, 2e-3, 2e-3, 1e-3):
        made.update(1e-3, dt_s, 0.0)
    assert asked == pytest.approx([-math.tau * 3.0 * dt_s for dt_s in (1e-3, 2e-3, 1e-3)])
