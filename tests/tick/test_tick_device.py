"""Hostile devices: whatever the device says, what is written is finite, bounded and ramped."""

from __future__ import annotations

import itertools
import math
from types import ModuleType
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.config.models import VelocityConfig
from hapticd.tick.event import EventCode
from hapticd.tick.guard import Mode
from hapticd_controllers import energy_cycle, none, tdpa
from tests.examples import examples
from tests.tick.rig import LIMIT_N, RAMP_TICKS, Rig, largest_step, law, wall
from tests.tick.transitions import TRANSITIONS, pressed


def anything() -> st.SearchStrategy[float]:
    return st.one_of(
        st.floats(),
        st.floats(-0.15, 0.15),
        st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, -5e-324, 1e308, 0.05, -0.05, -1e-3]),
    )


@st.composite
def streams(draw: st.DrawFn) -> list[tuple[list[float], list[float], int, int, float]]:
    """Samples of a device with two axes that says whatever it likes: position, velocity, time, count, host's dt."""
    samples = []
    time_ns = sequence = 0
    for _ in range(draw(st.integers(1, 40))):
        time_ns += draw(st.one_of(st.just(1_000_000), st.integers(-(10**12), 10**12), st.sampled_from([0, 1, -1])))
        sequence += draw(st.sampled_from([0, 1, 1, 1, -5]))
        position_m = [draw(anything()), draw(anything())]
        samples.extend(
            [(position_m, [draw(anything())] * 2, time_ns, sequence, draw(anything()))]
            * draw(st.sampled_from([1, 1, 25]))
        )
    return samples


VELOCITIES = [
    VelocityConfig(),
    VelocityConfig(samples=5),
    VelocityConfig(estimator="lowpass", cutoff_hz=1e5),
    VelocityConfig(estimator="foaw", samples=8),
    VelocityConfig(estimator="device"),
]


@examples(100)
@given(
    stream=streams(),
    velocity=st.sampled_from(VELOCITIES),
    clock=st.sampled_from([{"has_clock": True}, {"has_sequence": True}, {}]),
    module=st.sampled_from([none, energy_cycle, tdpa]),
    workspace_m=st.sampled_from([(-0.1, 0.1), (-math.inf, math.inf), (-0.1, math.inf), (-1e300, 1e300)]),
    stiffness=st.sampled_from([2000.0, 1e9]),
)
def test_whatever_the_device_says_the_written_force_is_finite_and_bounded(
    stream: list[tuple[list[float], list[float], int, int, float]],
    velocity: VelocityConfig,
    clock: dict[str, Any],
    module: ModuleType,
    workspace_m: tuple[float, float],
    stiffness: float,
) -> None:
    """And nothing that is published or kept is anything but a number; and after all that it works again."""
    walls = (wall(stiffness, "x", damping_n_s_per_m=-50.0), wall(2000.0, "y", free_side="negative"))
    rig = Rig(
        *walls, axes="xy", module=module, velocity=velocity, workspace_m=(workspace_m,) * 2, has_velocity=True, **clock
    )
    tick, sample = rig.tick, rig.sample
    for position_m, velocity_m_per_s, sample.time_ns, sample.sequence, clock_dt_s in stream:
        sample.position_m[:] = position_m
        sample.velocity_m_per_s[:] = velocity_m_per_s
        force_n = tick.step(sample, clock_dt_s)
        assert math.hypot(*force_n) <= LIMIT_N * (1.0 + 1e-9)
        assert 0.0 <= tick.motion.dt_s < 1.0
        assert tick.motion.dt_s > 0.0 or tick.motion.repeated > 0
        assert all(contact.tick.dt_s > 0.0 for contact in tick.contacts), "a law is told that time has passed"
        numbers = [*tick.motion.position_m, *tick.motion.velocity_m_per_s, *tick.requested_n, *rig.books_j]
        assert all(map(math.isfinite, numbers))
        for contact in tick.contacts:
            assert math.isfinite(contact.damping_n_s_per_m + contact.felt_mass_kg + contact.applied_n)
    sample.velocity_m_per_s[:] = [0.0, 0.0]
    rig.at(0.05, -0.05, ticks=100)
    tick.guard.clear()
    assert tick.arm()
    rig.at(0.0, -0.05)
    assert rig.at(-1e-3, -0.05, ticks=100 if velocity.estimator == "lowpass" else 10)[-1][0] > 0.0
    assert tick.guard.mode is Mode.ARMED


def test_one_impossible_sample_lets_the_force_out_within_ten_milliseconds_and_latches() -> None:
    rig = pressed()
    forces = [4.0, *rig.forces(math.nan, 12)]
    assert forces == pytest.approx([4.0 * max(0.0, 1.0 - count / 10.0) for count in range(13)])
    assert rig.tick.fault == EventCode.SAMPLE_IMPOSSIBLE
    assert rig.tick.guard.mode is Mode.DISARMED
    assert rig.tick.guard.latched


def test_sight_that_comes_back_does_not_bring_the_force_back() -> None:
    rig = pressed()
    rig.force(math.nan)
    forces = rig.forces(-2e-3, 60)
    assert forces[:9] == pytest.approx([4.0 * (1.0 - count / 10.0) for count in range(2, 11)], abs=1e-12)
    assert forces[9:] == [0.0] * 51


def test_after_a_blind_moment_neither_velocity_nor_books_see_a_jump() -> None:
    """The hand has moved meanwhile; that is no motion of 20 m/s, and no energy either."""
    rig = pressed(velocity=VelocityConfig(samples=4))
    energy_j = rig.books_j[0]
    rig.forces(math.nan, 20)
    for _ in range(6):
        rig.force(-22e-3)
        assert rig.tick.motion.velocity_m_per_s == [0.0]
    assert rig.books_j[0] == energy_j


def test_after_a_blind_moment_a_law_is_told_that_nothing_was_applied_and_nothing_moved() -> None:
    """The one that was there, and the one that comes with the next arming."""
    shown: list[tuple[float, float, float]] = []

    def step(_state: Any, _params: Any, tick: Any) -> float:
        shown.append((tick.applied_n, tick.applied_contact_n, tick.moved_m))
        force_n: float = tick.contact_n
        return force_n

    rig = pressed(module=law(step))
    assert shown[-1] == (4.0, 4.0, 0.0)
    rig.forces(math.nan, 20)
    rig.force(-3e-3)
    rig.tick.guard.clear()
    assert rig.tick.arm()
    rig.force(-3e-3)
    assert shown[-2:] == [(0.0, 0.0, 0.0)] * 2


def test_a_device_that_does_not_know_where_it_is_is_said_to_rest_at_the_origin() -> None:
    motion = Rig(wall(2000.0), at_m=math.nan, arm=False).tick.motion
    assert (motion.position_m, motion.velocity_m_per_s) == ([0.0], [0.0])


def test_where_positions_count_from_elsewhere_nothing_is_asked_for_until_there_is_a_new_sample() -> None:
    rig = pressed(has_sequence=True)
    rig.tick.release(0.001)
    rig.force(-2e-3, ticks=3)
    assert rig.tick.requested_n == [4.0]
    assert rig.tick.tare()
    rig.tick.step(rig.sample, 1e-3)
    assert rig.tick.requested_n == [0.0]
    assert rig.tick.contacts[0].force_n == 0.0


@pytest.mark.parametrize("name", TRANSITIONS)
@pytest.mark.parametrize("after", [1, 10, 40])
def test_a_blind_moment_in_the_middle_of_a_transition_goes_to_zero_in_tenths(name: str, after: int) -> None:
    rig = pressed()
    TRANSITIONS[name][0](rig)
    forces = rig.forces(-2e-3, after)
    forces += rig.forces(math.nan, 10)
    forces += rig.forces(-2e-3, 60)
    assert largest_step(forces[after:]) <= abs(forces[after - 1]) / 10.0 + 1e-12
    assert forces[after + 10 :] == [0.0] * 60


@pytest.mark.parametrize("name", TRANSITIONS)
def test_a_transition_that_comes_while_blind_changes_nothing_of_how_the_force_is_let_out(name: str) -> None:
    rig = pressed()
    forces = [4.0, *rig.forces(math.nan, 3)]
    TRANSITIONS[name][0](rig)
    forces += rig.forces(math.nan, 3)
    TRANSITIONS[name][0](rig)
    forces += rig.forces(-2e-3, 30)
    assert forces == pytest.approx([4.0 * max(0.0, 1.0 - count / 10.0) for count in range(37)], abs=1e-12)
    assert rig.tick.guard.mode is Mode.DISARMED
    assert rig.tick.guard.latched


def test_arming_a_blind_device_fails_anew_and_never_pushes() -> None:
    rig = pressed()
    rig.forces(math.nan, 20)
    rig.tick.fault = 0
    rig.tick.guard.clear()
    assert rig.tick.arm()
    assert rig.forces(math.nan, 5) == [0.0] * 5
    assert rig.tick.fault == EventCode.SAMPLE_IMPOSSIBLE
    assert not rig.tick.arm()


def test_a_pressed_device_that_was_armed_while_blind_comes_in_by_a_ramp() -> None:
    """The arming falls between the last bad sample and the first good one."""
    rig = pressed()
    rig.forces(math.nan, 20)
    rig.tick.guard.clear()
    assert rig.tick.arm()
    assert rig.forces(-2e-3, RAMP_TICKS + 1) == pytest.approx([4.0 * n / RAMP_TICKS for n in range(RAMP_TICKS + 1)])


def test_arming_while_the_blind_force_is_let_out_does_not_bring_it_back() -> None:
    rig = pressed()
    forces = [4.0, *rig.forces(math.nan, 3)]
    rig.tick.guard.clear()
    rig.tick.arm()
    forces += rig.forces(-2e-3, 40)
    assert all(b <= a for a, b in itertools.pairwise(forces))
    assert forces[-1] == 0.0


def test_a_device_that_starts_with_nonsense_starts_with_a_fault_and_can_be_cleared() -> None:
    rig = Rig(wall(2000.0), at_m=math.nan, arm=False)
    assert rig.tick.fault == EventCode.SAMPLE_IMPOSSIBLE
    assert not rig.tick.arm()
    assert rig.forces(0.01, 5) == [0.0] * 5
    rig.tick.guard.clear()
    assert rig.tick.arm()
    rig.force(0.0)
    assert rig.force(-1e-3) == 2.0
    assert all(map(math.isfinite, rig.books_j))


def uncalibrated(*, at_m: float) -> Rig:
    """A disarmed device that does not know where it is."""
    rig = Rig(wall(2000.0), at_m=0.05, arm=False)
    rig.sample.calibrated = False
    rig.sample.position_m[:] = [at_m]
    rig.tick.start(rig.sample)
    return rig


@pytest.mark.parametrize("at_m", [math.nan, 5.0, -math.inf])
def test_a_device_that_is_not_calibrated_may_say_anything_and_calibrated_it_needs_no_clearing(at_m: float) -> None:
    rig = uncalibrated(at_m=at_m)
    assert rig.forces(at_m, 30) == [0.0] * 30
    assert rig.forces(0.0, 3) == [0.0] * 3
    assert rig.forces(at_m, 30) == [0.0] * 30
    assert rig.tick.fault == 0
    assert not rig.tick.guard.latched
    rig.sample.calibrated = True
    rig.force(0.01)
    assert rig.tick.fault == 0
    assert rig.tick.arm()
    rig.force(0.0)
    assert rig.force(-1e-3) == 2.0


@pytest.mark.parametrize("ticks", [0, 30])
def test_a_device_that_is_calibrated_and_still_makes_no_sense_is_a_fault(ticks: int) -> None:
    """T4."""
    rig = uncalibrated(at_m=5.0)
    rig.forces(5.0, ticks)
    rig.sample.calibrated = True
    assert rig.force(5.0) == 0.0
    assert rig.tick.fault == EventCode.SAMPLE_IMPOSSIBLE
    assert rig.tick.guard.latched


def test_one_that_forgot_where_it_is_while_disarmed_and_still_makes_no_sense_when_calibrated_is_a_fault() -> None:
    rig = Rig(wall(2000.0), at_m=0.05, arm=False)
    rig.sample.calibrated = False
    assert rig.forces(5.0, 3) == [0.0] * 3
    assert rig.tick.fault == 0
    rig.sample.calibrated = True
    assert rig.force(5.0) == 0.0
    assert rig.tick.fault == EventCode.SAMPLE_IMPOSSIBLE
    assert rig.tick.guard.latched


def test_one_that_does_not_know_where_it_is_is_not_tared_before_its_first_tick_either() -> None:
    rig = uncalibrated(at_m=0.02)
    assert not rig.tick.tare()
    rig.force(0.02)
    assert not rig.tick.tare()
    rig.sample.calibrated = True
    rig.force(0.02)
    assert rig.tick.tare()


def test_an_armed_device_that_forgets_where_it_is_is_a_fault() -> None:
    rig = pressed()
    rig.sample.calibrated = False
    forces = rig.forces(5.0, 12)
    assert forces[:2] == pytest.approx([3.6, 3.2])
    assert forces[-1] == 0.0
    assert rig.tick.fault == EventCode.SAMPLE_IMPOSSIBLE
    assert rig.tick.guard.latched


def test_a_device_may_be_half_its_workspace_outside_of_it_and_no_further() -> None:
    rig = Rig(wall(2000.0), workspace_m=((-0.1, 0.1),))
    rig.force(0.19, dt_s=0.1)
    assert rig.tick.fault == 0
    rig.force(0.21, dt_s=0.1)
    assert rig.tick.fault == EventCode.SAMPLE_IMPOSSIBLE


@pytest.mark.parametrize("span_m", [(-math.inf, math.inf), (0.0, math.inf)])
def test_also_an_endless_workspace_ends_before_infinity(span_m: tuple[float, float]) -> None:
    rig = Rig(wall(2000.0), workspace_m=(span_m,))
    rig.force(3.0, dt_s=0.1)
    assert rig.tick.fault == 0
    rig.force(math.inf)
    assert rig.tick.fault == EventCode.SAMPLE_IMPOSSIBLE


def test_once_it_knows_where_it_is_an_impossible_position_is_a_fault() -> None:
    """Of a device that was not calibrated when the loop began, disarmed as it is."""
    rig = Rig(wall(2000.0), at_m=0.0, arm=False)
    rig.sample.calibrated = False
    rig.sample.position_m[0] = math.nan
    rig.tick.start(rig.sample)
    rig.force(math.nan, ticks=5)
    assert rig.tick.fault == 0
    rig.sample.calibrated = True
    rig.force(math.nan)
    assert rig.tick.fault == EventCode.SAMPLE_IMPOSSIBLE
    assert rig.tick.guard.latched
