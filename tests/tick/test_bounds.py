"""What is just possible and what is not any more, to the last bit: places, speeds, times, forces of a law."""

from __future__ import annotations

import math
from typing import Any

import pytest

from hapticd.config.models import VelocityConfig
from hapticd.config.safety import SafetyConfig
from hapticd.device import Sample
from hapticd.tick.event import EventCode
from hapticd.tick.motion import Motion
from tests.tick.rig import PERIOD_S, Rig, device, law, returns, wall

BINARY_MS = 2.0**-10
"""About a millisecond, and a speed of 1 m/s over a step of as many metres is no bit off [s]."""


def at(position_m: float, velocity_m_per_s: float = 0.0) -> Sample:
    sample = Sample(1)
    sample.position_m[0], sample.velocity_m_per_s[0] = position_m, velocity_m_per_s
    return sample


@pytest.mark.parametrize(
    ("workspace_m", "low_m", "high_m"),
    [((-0.125, 0.125), -0.25, 0.25), ((0.0, 0.25), -0.125, 0.375), ((-math.inf, math.inf), -1e7, 1e7)],
)
@pytest.mark.parametrize("high", [False, True])
def test_a_device_may_be_at_the_very_bound_from_its_first_sample_on(
    workspace_m: tuple[float, float], low_m: float, high_m: float, high: bool
) -> None:
    """Half of its workspace outside; a sample that comes again is looked at as the first and a new one are."""
    inside_m, outwards = (high_m, math.inf) if high else (low_m, -math.inf)
    outside_m = math.nextafter(inside_m, outwards)
    info = device(workspace_m=(workspace_m,), has_sequence=True)
    assert not Motion(VelocityConfig(), info, PERIOD_S).start(at(outside_m))
    motion = Motion(VelocityConfig(), info, PERIOD_S)
    assert motion.start(at(inside_m))
    for repeats in (True, False):
        for position_m in (inside_m, outside_m):
            sample = at(position_m)
            sample.sequence += not repeats
            assert motion.see(sample, PERIOD_S, PERIOD_S, at_rest=False) == (position_m == inside_m)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_velocity_of_a_million_metres_a_second_is_none(sign: float) -> None:
    motion = Motion(VelocityConfig(estimator="device"), device(has_velocity=True), PERIOD_S)
    assert motion.start(at(0.0))
    assert motion.see(at(0.0, sign * math.nextafter(1e6, 0.0)), PERIOD_S, PERIOD_S, at_rest=False)
    assert not motion.see(at(0.0, sign * 1e6), PERIOD_S, PERIOD_S, at_rest=False)


@pytest.mark.parametrize(
    ("passed_ns", "reckoned_s"),
    [
        (500_000, 5e-4),
        (1_000_000, 1e-3),
        (999_999_999, 0.999999999),
        (1_000_000_000, PERIOD_S),
        (3_000_000_000, PERIOD_S),
    ],
)
def test_any_time_of_a_devices_clock_counts_and_laws_reckon_with_less_than_a_second(
    passed_ns: int, reckoned_s: float
) -> None:
    motion = Motion(VelocityConfig(), device(has_clock=True), PERIOD_S)
    sample = at(0.0)
    sample.time_ns = 0
    assert motion.start(sample)
    sample = at(1e-6)
    sample.time_ns = passed_ns
    assert motion.see(sample, PERIOD_S, PERIOD_S, at_rest=False)
    assert motion.dt_s == pytest.approx(reckoned_s)
    assert motion.velocity_m_per_s == [pytest.approx(1e3 / passed_ns)]


@pytest.mark.parametrize("passed_s", [0.0, 0.9e-9, -1.0, math.inf, math.nan])
def test_where_no_time_has_passed_that_could_be_reckoned_with_the_last_velocity_stands(passed_s: float) -> None:
    motion = Motion(VelocityConfig(), device(), PERIOD_S)
    assert motion.start(at(0.0))
    assert motion.see(at(2e-3), PERIOD_S, PERIOD_S, at_rest=False)
    assert motion.see(at(3e-3), passed_s, PERIOD_S, at_rest=False)
    assert motion.velocity_m_per_s == [pytest.approx(2.0)]
    assert motion.dt_s == PERIOD_S


def test_the_very_limit_of_speed_is_allowed() -> None:
    rig = Rig(at_m=0.0, safety={"max_speed_m_per_s": 1.0})
    rig.force(BINARY_MS, dt_s=BINARY_MS)
    assert rig.tick.motion.velocity_m_per_s == [1.0]
    assert rig.tick.fault == 0
    rig.force(math.nextafter(2.0 * BINARY_MS, 1.0), dt_s=BINARY_MS)
    assert rig.tick.fault == EventCode.OVER_SPEED


def test_speed_is_watched_where_there_is_a_limit_of_it_and_nowhere_else() -> None:
    """It costs a tick something."""
    limited, free = SafetyConfig(max_speed_m_per_s=1.0), SafetyConfig(profile="simulation")
    rig = Rig(simulated=True, safety=free.model_dump() | {"max_speed_m_per_s": None})
    seen = [rig.tick.motion.watches_speed]
    for safety in (limited, free):
        rig.switch(safety=safety)
        seen.append(rig.tick.motion.watches_speed)
    assert seen == [False, True, False]


def test_a_ramp_that_is_shorter_than_a_tick_takes_one() -> None:
    rig = Rig(wall(2000.0), at_m=-1e-3, safety={"ramp_s": 0.001})
    assert rig.tick.ramp_ticks == 1
    rig.tick.period_s = 0.01
    assert rig.tick.ramp_ticks == 1
    rig.tick.period_s = 0.0004
    assert rig.tick.ramp_ticks == 2


@pytest.mark.parametrize("field", ["", "damping_n_s_per_m", "felt_mass_kg"])
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_law_may_say_a_number_just_below_a_million_million_million(field: str, sign: int) -> None:
    """Asked for or published, in whatever class of numbers it says it."""
    said: list[Any] = [sign * 5, float(sign), sign * math.nextafter(1e18, 0.0), sign * 1e18]

    def step(state: Any, _params: Any, tick: Any) -> Any:
        if field:
            setattr(state, field, said[0])
        return tick.contact_n if field else said[0]

    rig = Rig(wall(2000.0), at_m=0.0, module=law(step, fields={field: float} if field else None))
    contact = rig.tick.contacts[0]
    while len(said) > 1:
        rig.force(-1e-3)
        number = getattr(contact, field or "requested_n")
        assert number == said.pop(0)
        assert type(number) is float
        assert rig.tick.fault == 0
    rig.force(-1e-3)
    assert rig.tick.fault == EventCode.LAW_FAILED
    rig = Rig(wall(2000.0), at_m=0.0, module=law(returns(sign * 10**18)))
    rig.force(-1e-3)
    assert rig.tick.fault == EventCode.LAW_FAILED, "a whole number as well"
