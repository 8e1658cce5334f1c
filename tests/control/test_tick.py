"""The tick as a whole: whatever the device says and the law does, what is written is finite, bounded and ramped."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from decimal import Decimal
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticd.config.models import SafetyConfig, VelocityConfig
from hapticd.contracts.driver import Sample
from hapticd.contracts.errors import ConfigError, PluginError
from hapticd.contracts.event import EventCode
from hapticd.contracts.record import Flag
from hapticd.control.tick import FROZEN_TICKS
from hapticd.guard import Guard, Mode
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from hapticd_controllers import energy_cycle, none, tdpa
from tests.control.rig import (
    LIMIT_N,
    PERIOD_S,
    RAMP_TICKS,
    Rig,
    device,
    largest_step,
    law,
    pushes,
    running,
    scene,
    wall,
)

REPEATABLE = settings(derandomize=True, deadline=None)

RAMP_STEP_N = LIMIT_N / RAMP_TICKS


# What the guard leaves alone


@pytest.mark.parametrize("start_m", [0.0, 0.01])
@pytest.mark.parametrize("module", [none, energy_cycle, tdpa])
def test_with_defaults_guard_and_ramps_change_no_bit_of_a_run_from_the_wall_or_from_outside(
    start_m: float, module: ModuleType
) -> None:
    """The closed loop through the tick, against the law asked by hand, with no guard in between."""
    options = SimulationOptions.model_validate(
        {
            "mass_kg": 0.25,
            "viscous_n_s_per_m": 2.0,
            "resolution_m": 1e-5,
            "max_force_n": 0.0,
            "initial_position_m": start_m,
            "hand": {"force": {"profile": "constant", "newton": -3.0}},
        }
    )
    guarded, bare = SimulatedDevice(options, PERIOD_S), SimulatedDevice(options, PERIOD_S)
    rig = Rig(wall(9000.0), module=module, at_m=guarded.measured_m, max_force_n=math.inf, simulated=True)
    alone = running(module)()
    contact = rig.tick.contacts[0]
    alone.start(contact.snapshot(0.0))
    shown = type(contact.tick)(0.0)
    shown.x_m = bare.measured_m
    force_n = bare_n = 0.0
    touched = 0
    for _ in range(1500):
        guarded.advance(force_n)
        bare.advance(bare_n)
        shown.moved_m = bare.measured_m - shown.x_m
        shown.velocity_m_per_s = shown.moved_m / PERIOD_S
        shown.dt_s = PERIOD_S
        shown.x_m = bare.measured_m
        shown.in_contact = shown.x_m < 0.0
        shown.contact_n = -9000.0 * shown.x_m if shown.in_contact else 0.0
        bare_n = alone.step(alone.state, alone.params, shown) if shown.in_contact else 0.0
        if not shown.in_contact:
            alone.step(alone.state, alone.params, shown)
        shown.applied_n, shown.applied_contact_n = bare_n, shown.contact_n
        force_n = rig.force(guarded.measured_m)
        assert force_n.hex() == bare_n.hex() or force_n == bare_n == 0.0
        touched += shown.in_contact
    assert touched > 100


def test_a_wall_met_in_the_first_tick_after_arming_is_there_at_once() -> None:
    """Armed outside, inside at the next sample: motion explains that force, so no ramp may hide it."""
    rig = Rig(wall(2000.0), at_m=0.0)
    assert rig.force(-1e-3) == 2.0


# Several walls


def test_two_walls_on_one_axis_add_up() -> None:
    rig = Rig(wall(2000.0), wall(1000.0, position_m=-1e-3), at_m=0.0)
    assert rig.force(-3e-3) == pytest.approx(6.0 + 2.0)


def test_a_wall_that_faces_the_negative_side_pushes_there() -> None:
    rig = Rig(wall(2000.0, free_side="negative", position_m=0.01, damping_n_s_per_m=2.0), at_m=0.0)
    assert rig.force(0.0095) == 0.0
    assert rig.force(0.0115) == pytest.approx(-2000.0 * 1.5e-3 - 2.0 * 2.0)
    assert rig.force(0.0115) == pytest.approx(-3.0)
    assert rig.force(0.009) == 0.0


def test_a_slot_between_two_facing_walls_pushes_to_its_middle() -> None:
    rig = Rig(wall(2000.0, position_m=-1e-3), wall(2000.0, position_m=1e-3, free_side="negative"), at_m=0.0)
    assert rig.force(-2e-3) == pytest.approx(2.0)
    assert rig.force(2e-3) == pytest.approx(-2.0)
    assert rig.force(0.0) == 0.0


@REPEATABLE
@given(
    depths_m=st.lists(st.floats(-0.02, 0.01), min_size=3, max_size=3),
    stiffnesses=st.lists(st.floats(0.0, 20000.0), min_size=4, max_size=4),
    releasing=st.booleans(),
)
def test_what_the_contacts_applied_sums_to_what_was_written(
    depths_m: list[float], stiffnesses: list[float], releasing: bool
) -> None:
    """A corner of three walls and a second one facing the other way, far beyond the limit, also in a release."""
    walls = [wall(stiffness, axis) for stiffness, axis in zip(stiffnesses, "xyz", strict=False)]
    rig = Rig(*walls, wall(stiffnesses[3], "x", free_side="negative", position_m=-5e-3), axes="xyz")
    rig.at(*depths_m)
    if releasing:
        rig.tick.release()
    force_n = rig.at(*depths_m, ticks=3)[-1]
    sums = [0.0, 0.0, 0.0]
    for contact in rig.tick.contacts:
        sums[contact.wall.axis] += contact.wall.outward * contact.applied_n
    assert sums == pytest.approx(force_n, abs=1e-9)
    assert math.hypot(*force_n) <= LIMIT_N * (1.0 + 1e-9)


def test_the_direction_into_a_corner_is_kept_when_it_is_limited() -> None:
    rig = Rig(wall(2000.0, "x"), wall(2000.0, "y"), axes="xy", at_m=0.0)
    force_n = rig.at(-0.03, -0.01)[-1]
    assert math.hypot(*force_n) == pytest.approx(LIMIT_N)
    assert force_n[0] == pytest.approx(3.0 * force_n[1])
    assert rig.tick.flags & Flag.LIMITED


def test_what_the_laws_asked_for_is_kept_beside_what_was_written() -> None:
    rig = Rig(wall(2000.0), at_m=0.0)
    assert rig.force(-0.01) == pytest.approx(LIMIT_N)
    assert rig.tick.requested_n == [20.0]


# Transitions of a hand that stands still: nothing but the ramp may change the force


def pressed(*walls: dict[str, Any], depth_m: float = 2e-3, **keys: Any) -> Rig:
    """A hand 2 mm inside a wall of 2 kN/m, at rest: 4 N."""
    rig = Rig(*(walls or (wall(2000.0),)), at_m=0.0, **keys)
    rig.force(-depth_m, ticks=2)
    return rig


def arm_again(rig: Rig) -> None:
    assert rig.tick.arm()


TRANSITIONS: dict[str, tuple[Callable[[Rig], Any], float]] = {
    "another law": (lambda rig: rig.tick.switch_law(running(pushes(11.0))), 11.0),
    "a law that pulls": (lambda rig: rig.tick.switch_law(running(pushes(-12.0))), -12.0),
    "a law beyond the limit": (lambda rig: rig.tick.switch_law(running(pushes(1e6))), 12.0),
    "a softer wall": (lambda rig: rig.tick.switch_scene(scene(wall(500.0))), 1.0),
    "a stiffer wall": (lambda rig: rig.tick.switch_scene(scene(wall(1e6))), 12.0),
    "no wall": (lambda rig: rig.tick.switch_scene(scene()), 0.0),
    "a wall elsewhere": (lambda rig: rig.tick.switch_scene(scene(wall(1000.0, position_m=3e-3))), 5.0),
    "a second wall": (lambda rig: rig.tick.switch_scene(scene(wall(2000.0), wall(1e5, position_m=1.0))), 12.0),
    "a release": (lambda rig: rig.tick.release(), 0.0),
    "a fault": (lambda rig: rig.tick.fail(EventCode.DEVICE_FAULT, "hot"), 0.0),
    "the fallback": (lambda rig: rig.tick.fail_law(EventCode.LAW_OVER_BUDGET, "slow"), 0.0),
    "a smaller limit": (lambda rig: rig.tick.switch(safety=SafetyConfig(max_force_n=1.0)), 1.0),
    "everything": (
        lambda rig: rig.tick.switch(scene(wall(9000.0)), SafetyConfig(max_force_n=6.0), running(pushes(1e9))),
        6.0,
    ),
}


@pytest.mark.parametrize("name", TRANSITIONS)
def test_a_transition_under_a_resting_hand_is_a_ramp_to_where_it_leads(name: str) -> None:
    """No tick changes the force by more than 2 limit / N, the first one least of all."""
    rig = pressed()
    change, expected_n = TRANSITIONS[name]
    forces = rig.forces(-2e-3, 3)
    change(rig)
    forces += rig.forces(-2e-3, 2 * RAMP_TICKS + 2)
    assert forces[0] == 4.0
    assert forces[-1] == pytest.approx(expected_n, abs=1e-9)
    assert largest_step(forces) <= 2.0 * RAMP_STEP_N + 1e-9
    assert abs(forces[3] - 4.0) <= RAMP_STEP_N + 1e-9


@pytest.mark.parametrize(
    ("first", "second", "after"), [(a, b, c) for a, b in itertools.permutations(TRANSITIONS, 2) for c in (1, 20)]
)
def test_a_transition_in_the_middle_of_another_is_no_step_either(first: str, second: str, after: int) -> None:
    rig = pressed()
    forces = rig.forces(-2e-3, 2)
    TRANSITIONS[first][0](rig)
    forces += rig.forces(-2e-3, after)
    TRANSITIONS[second][0](rig)
    forces += rig.forces(-2e-3, 3 * RAMP_TICKS)
    # Two contacts at most blend at once, while the gain falls and the limit moves.
    assert largest_step(forces) <= 6.0 * RAMP_STEP_N + 1e-9
    assert all(abs(force_n) <= LIMIT_N * (1.0 + 1e-9) for force_n in forces)


def test_arming_a_pressed_device_comes_in_by_a_ramp_however_deep_it_is() -> None:
    """The wall asks for 120 N where 12 are allowed: it must not come in ten times as fast for that."""
    rig = Rig(wall(12000.0), at_m=-0.01, arm=False)
    assert rig.forces(-0.01, 5) == [0.0] * 5
    arm_again(rig)
    forces = rig.forces(-0.01, RAMP_TICKS + 1)
    assert forces == pytest.approx([RAMP_STEP_N * step for step in range(RAMP_TICKS + 1)])


def test_arming_in_the_middle_of_a_release_goes_on_from_the_force_that_is_left() -> None:
    rig = pressed()
    rig.tick.release()
    forces = rig.forces(-2e-3, 30)
    arm_again(rig)
    forces += rig.forces(-2e-3, RAMP_TICKS + 1)
    assert forces[29] == pytest.approx(4.0 * 0.4)
    assert forces[30] == pytest.approx(forces[29])
    assert forces[-1] == pytest.approx(4.0)
    assert largest_step(forces) <= 2.0 * RAMP_STEP_N


def test_a_law_switch_during_a_release_neither_steps_nor_stops_it() -> None:
    """The blend must start from the force before the release's gain, or the gain would count twice."""
    rig = pressed(wall(5000.0))
    rig.tick.release()
    forces = rig.forces(-2e-3, 25)
    rig.tick.switch_law(running(pushes(12.0)))
    forces += rig.forces(-2e-3, 30)
    assert forces[24] - forces[25] == pytest.approx(10.0 / RAMP_TICKS)
    assert largest_step(forces) <= 2.0 * RAMP_STEP_N
    assert forces[-1] == 0.0
    assert rig.tick.guard.mode is Mode.DISARMED


def test_a_stop_in_the_middle_of_a_blend_is_over_in_its_own_time() -> None:
    rig = pressed()
    rig.tick.switch_scene(scene(wall(6000.0)))
    forces = rig.forces(-2e-3, 20)
    rig.tick.release(0.02)
    forces += rig.forces(-2e-3, 21)
    assert forces[-1] == 0.0
    assert largest_step(forces) <= LIMIT_N / 20.0 + 2.0 * RAMP_STEP_N


def test_a_fault_in_the_middle_of_a_release_latches_and_the_release_goes_on() -> None:
    rig = pressed()
    rig.tick.release()
    forces = rig.forces(-2e-3, 10)
    rig.tick.fail(EventCode.DEVICE_FAULT, "hot")
    forces += rig.forces(-2e-3, 45)
    assert forces[49] == pytest.approx(0.0, abs=1e-12)
    assert largest_step(forces) == pytest.approx(4.0 / RAMP_TICKS)
    assert not rig.tick.arm()


def test_at_the_tick_of_a_law_switch_the_force_moves_as_the_device_did_and_no_further() -> None:
    rig = pressed()
    rig.tick.switch_law(running(pushes(11.0)))
    assert rig.force(-2e-3) == 4.0
    rig = pressed()
    rig.tick.switch_law(running(pushes(11.0)))
    assert rig.force(-1.5e-3) == pytest.approx(3.0)


def test_a_blend_ends_with_the_contact_and_never_pulls_the_hand_in() -> None:
    """Armed deep inside, drawn back quickly: a ramp that subtracts what is still to come would pull."""
    rig = Rig(wall(2000.0), at_m=-5e-3, arm=False)
    rig.force(-5e-3, ticks=2)
    arm_again(rig)
    forces = []
    for count in range(12):
        forces.append(rig.force(-5e-3 + 0.5e-3 * count))
    assert min(forces) >= 0.0
    assert forces[-1] == 0.0
    assert rig.force(-1e-3) == 2.0


MOVES = st.floats(-1e-3, 1e-3)
DEEDS = st.sampled_from(
    [*TRANSITIONS, "arm", "clear", "nan", "dark", "faster", "nothing", "nothing", "nothing", "nothing", "nothing"]
)


@settings(REPEATABLE, max_examples=400)
@given(path=st.lists(st.tuples(DEEDS, st.integers(1, 15), MOVES), min_size=1, max_size=25))
def test_whatever_is_asked_in_whatever_order_the_force_goes_by_ramps(path: list[tuple[str, int, float]]) -> None:
    """Motion explains k dx for each wall, and a blind moment a tenth of the limit; the rest is ramps.

    Bound of a tick: 2 limit / N for every wall that blends, limit / N each for the gain of a release and for a
    moving limit; for the motion k |dx| of every wall, twice in a blend (the old force and the new one), and b |dv| of
    the damping that the fallback puts on every wall.
    """
    rig = pressed()
    position_m = -2e-3
    last_n = 4.0
    for deed, ticks, move_m in path:
        if deed in TRANSITIONS:
            TRANSITIONS[deed][0](rig)
        elif deed == "arm":
            rig.tick.arm()
        elif deed == "clear":
            rig.tick.guard.clear()
        elif deed == "faster":
            rig.tick.release(0.02)
        for count in range(ticks):
            before_m, before_m_per_s = position_m, rig.tick.velocity_m_per_s[0]
            moving = deed == "nothing"
            position_m = min(0.01, max(-0.01, position_m + move_m)) if moving else position_m
            shown_m = math.nan if deed == "dark" or (deed == "nan" and count < 4) else position_m
            force_n = rig.force(shown_m)
            contacts = [*rig.tick.contacts, *rig.tick.leaving]
            spring = sum(max(contact.wall.stiffness_n_per_m, 6000.0) for contact in contacts) + 6000.0
            ramps = (2.0 * len(contacts) + 4.0) * RAMP_STEP_N + LIMIT_N / 20.0
            blind = LIMIT_N / 10.0 if rig.tick.guard.mode is not Mode.ARMED else 0.0
            moved = 2.0 * spring * abs(position_m - before_m)
            moved += len(contacts) * 10.0 * abs(rig.tick.velocity_m_per_s[0] - before_m_per_s)
            # A law that pushes alike at every depth starts and ends with the contact, by itself.
            edges = LIMIT_N * 2.0 if (before_m < 0.0) != (position_m < 0.0) or position_m >= 0.0 else 0.0
            assert abs(force_n - last_n) <= ramps + blind + moved + edges + 1e-9
            assert abs(force_n) <= LIMIT_N * (1.0 + 1e-9)
            last_n = force_n


# Hostile devices


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


@settings(REPEATABLE, max_examples=100)
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
        assert 0.0 < tick.dt_s < 1.0
        numbers = [*tick.position_m, *tick.velocity_m_per_s, *tick.requested_n, *rig.books_j]
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
        assert rig.tick.velocity_m_per_s == [0.0]
    assert rig.books_j[0] == energy_j


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


def test_a_device_that_is_calibrated_and_still_makes_no_sense_is_a_fault() -> None:
    rig = uncalibrated(at_m=5.0)
    rig.forces(5.0, 30)
    rig.sample.calibrated = True
    assert rig.force(5.0) == 0.0
    assert rig.tick.fault == EventCode.SAMPLE_IMPOSSIBLE
    assert rig.tick.guard.latched


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


@pytest.mark.parametrize("kind", ["has_clock", "has_sequence"])
def test_a_device_that_repeats_itself_is_frozen_after_twenty_samples(kind: str) -> None:
    rig = pressed(**{kind: True})
    sample = Sample(1)
    sample.position_m[0], sample.time_ns, sample.sequence = -2e-3, rig.sample.time_ns, rig.sample.sequence
    for count in range(FROZEN_TICKS):
        assert rig.tick.fault == 0, count
        assert rig.tick.step(sample, PERIOD_S) != [0.0]
        assert rig.tick.dt_s == PERIOD_S
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
    assert rig.tick.dt_s == PERIOD_S
    assert rig.force(-2e-3, ticks=30) == 4.0
    assert rig.tick.fault == 0


def test_after_a_long_gap_velocity_is_what_it_was_over_the_gap_and_laws_reckon_with_one_period() -> None:
    """A computer that slept for 3 s finds the hand 30 mm further: that was 10 mm/s, and not 30 m/s."""
    rig = Rig(wall(2000.0), at_m=0.0, has_clock=True, safety={"max_speed_m_per_s": 1.0})
    rig.force(0.03, dt_s=3.0)
    assert rig.tick.velocity_m_per_s == [pytest.approx(0.01)]
    assert rig.tick.dt_s == PERIOD_S
    rig.force(0.03)
    assert rig.tick.velocity_m_per_s == [0.0]
    assert rig.tick.fault == 0


def test_while_the_clock_stands_still_the_last_velocity_stands() -> None:
    rig = Rig(wall(2000.0), at_m=0.0, has_clock=True)
    rig.force(1e-3)
    rig.force(3e-3, dt_s=0.0)
    assert rig.tick.velocity_m_per_s == [pytest.approx(1.0)]


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


# Hostile laws


class UnprintableError(Exception):
    def __str__(self) -> str:
        raise RuntimeError("not even this")


class Rude(BaseException):
    pass


def raises(error: BaseException) -> Callable[[Any, Any, Any], Any]:
    def step(_state: Any, _params: Any, _tick: Any) -> Any:
        raise error

    return step


def returns(value: Any) -> Callable[[Any, Any, Any], Any]:
    return lambda _state, _params, _tick: value


def spoils(value: Any) -> Callable[[Any, Any, Any], Any]:
    """Writes nonsense into all that it is shown, then fails."""

    def step(_state: Any, _params: Any, tick: Any) -> Any:
        for field in tick.__slots__:
            setattr(tick, field, value)
        raise ValueError("spoilt")

    return step


def recurses(state: Any, params: Any, tick: Any) -> Any:
    return recurses(state, params, tick)


BAD_LAWS: dict[str, Callable[[Any, Any, Any], Any]] = {
    "raises": raises(ValueError("no")),
    "raises what cannot be printed": raises(UnprintableError()),
    "exits": raises(SystemExit(3)),
    "ends a generator": raises(GeneratorExit()),
    "raises a base exception": raises(Rude()),
    "stops an iteration": raises(StopIteration()),
    "recurses": recurses,
    "divides": lambda _state, _params, tick: 1.0 / (tick.dt_s - tick.dt_s),
    "None": returns(None),
    "text": returns("5.0"),
    "NaN": returns(math.nan),
    "infinity": returns(math.inf),
    "minus infinity": returns(-math.inf),
    "1e300": returns(1e300),
    "complex": returns(1.0 + 0.0j),
    "a huge whole number": returns(10**400),
    "a list": returns([1.0]),
    "an array": returns(np.array([1.0])),
    "a decimal": returns(Decimal(1)),
    "an object": returns(object()),
    "spoils with NaN": spoils(math.nan),
    "spoils with text": spoils("x"),
    "spoils with None": spoils(None),
}


@pytest.mark.parametrize("name", BAD_LAWS)
def test_a_law_that_fails_is_replaced_by_damping_and_the_force_ramped_to_zero(name: str) -> None:
    """It fails pressed at 4 N: the loop goes on, no step, zero after one ramp, latched; then all is well again."""
    fails = BAD_LAWS[name]
    failing = False

    def step(state: Any, params: Any, tick: Any) -> Any:
        return fails(state, params, tick) if failing else tick.contact_n

    rig = pressed(module=law(step))
    forces = rig.forces(-2e-3, 3)
    failing = True
    forces += rig.forces(-2e-3, 1)
    assert rig.tick.fault == EventCode.LAW_FAILED
    assert rig.tick.fault_text.startswith("law tests.some_law: ")
    assert rig.tick.flags & Flag.FALLBACK
    assert rig.tick.flags & Flag.LATCHED
    forces += rig.forces(-2e-3, RAMP_TICKS)
    assert forces[:3] == [4.0] * 3
    assert largest_step(forces) <= 4.0 / RAMP_TICKS + 1e-9
    assert forces[RAMP_TICKS + 2] == pytest.approx(0.0, abs=1e-12)
    assert rig.forces(-2e-3, 10) == [0.0] * 10
    assert not rig.tick.arm()
    assert all(map(math.isfinite, rig.books_j))

    failing = False
    rig.tick.guard.clear()
    assert rig.tick.arm()
    assert not rig.tick.fallback
    assert rig.forces(-2e-3, RAMP_TICKS + 1) == pytest.approx([4.0 * n / RAMP_TICKS for n in range(RAMP_TICKS + 1)])


@pytest.mark.parametrize("value", [-0.0, 0, 5, True, np.float64(2.0), 1e17])
def test_what_is_a_number_is_taken_for_one(value: Any) -> None:
    rig = Rig(wall(2000.0), module=law(returns(value)), at_m=0.0)
    written_n = rig.force(-2e-3)
    assert written_n == min(float(value), LIMIT_N)
    assert type(written_n) is float
    assert type(rig.tick.requested_n[0]) is float
    assert rig.tick.fault == 0


@pytest.mark.parametrize("value", [math.nan, "x", None, 0.0, -5e-324, 1e308])
def test_what_a_law_writes_into_its_tick_reaches_neither_force_nor_books_nor_the_next_tick(value: Any) -> None:
    def step(_state: Any, _params: Any, tick: Any) -> float:
        force_n: float = tick.contact_n
        for field in tick.__slots__:
            setattr(tick, field, value)
        return force_n

    honest, spoilt = Rig(wall(2000.0), at_m=0.0), Rig(wall(2000.0), at_m=0.0, module=law(step))
    for count in range(200):
        position_m = 4e-3 * math.sin(0.1 * count)
        assert spoilt.at(position_m) == honest.at(position_m)
        assert spoilt.books_j == honest.books_j
    assert spoilt.tick.fault == 0


@pytest.mark.parametrize("value", [math.nan, math.inf, "x", None, 1e300, 2.0j])
@pytest.mark.parametrize("field", ["damping_n_s_per_m", "felt_mass_kg"])
def test_a_law_that_publishes_nonsense_has_failed(field: str, value: Any) -> None:
    def step(state: Any, _params: Any, tick: Any) -> float:
        setattr(state, field, value)
        force_n: float = tick.contact_n
        return force_n

    rig = Rig(wall(2000.0), at_m=0.01, module=law(step, fields={field: float}))
    rig.force(0.01)
    assert rig.tick.fault == EventCode.LAW_FAILED
    contact = rig.tick.contacts[0]
    assert type(contact.damping_n_s_per_m) is float
    assert contact.damping_n_s_per_m == 10.0
    assert contact.felt_mass_kg == 0.0


def test_one_law_of_several_that_fails_takes_all_of_them_with_it_and_no_force_steps() -> None:
    calls = 0

    def step(_state: Any, _params: Any, tick: Any) -> float:
        nonlocal calls
        calls += 1
        if calls > 40 and tick.x_m > -1.5e-3:
            raise ValueError("only here")
        force_n: float = tick.contact_n
        return force_n

    rig = Rig(wall(2000.0, "x"), wall(1000.0, "y"), axes="xy", at_m=0.0, module=law(step))
    forces = rig.at(-2e-3, -1e-3, ticks=80)
    assert rig.tick.fault == EventCode.LAW_FAILED
    for axis, newton in ((0, 4.0), (1, 1.0)):
        assert forces[0][axis] == pytest.approx(newton)
        assert largest_step([force_n[axis] for force_n in forces]) == pytest.approx(newton / RAMP_TICKS)
        assert forces[-1][axis] == 0.0


def test_the_fallback_damps_while_the_force_is_ramped_out() -> None:
    rig = pressed(module=law(returns(math.nan)), depth_m=1e-3)
    for count in range(1, 30):
        before_n = rig.tick.force_n[0]
        force_n = rig.force(-1e-3 - 1e-5 * count)
    assert rig.tick.requested_n[0] == pytest.approx(2000.0 * (1e-3 + 29e-5) + 10.0 * 0.01)
    assert force_n < before_n


def test_an_interrupt_from_the_keyboard_is_no_fault_of_the_law() -> None:
    """A study is stopped by it; the control process never sees one."""
    rig = Rig(wall(2000.0), at_m=0.0, module=law(raises(KeyboardInterrupt())))
    with pytest.raises(KeyboardInterrupt):
        rig.force(-1e-3)


@pytest.mark.parametrize("error", [ValueError("no"), SystemExit(2), Rude()])
def test_a_law_that_cannot_start_changes_nothing(error: BaseException) -> None:
    def start(_state: Any, _params: Any, _snapshot: Any) -> None:
        raise error

    broken = running(law(returns(9.0), start))
    rig = pressed(wall(2000.0), wall(500.0, position_m=-1.0))
    before_n = rig.force(-2e-3)
    contacts = list(rig.tick.contacts)
    deeds: list[Callable[[], None]] = [
        lambda: rig.tick.switch_law(broken),
        lambda: rig.tick.switch(scene(wall(7.0)), SafetyConfig(max_force_n=2.0, ramp_s=0.5), broken),
    ]
    for deed in deeds:
        with pytest.raises(PluginError, match=r"law tests\.some_law cannot start"):
            deed()
    assert rig.force(-2e-3) == before_n
    assert rig.tick.contacts == contacts
    assert rig.tick.ramp_s == 0.05
    assert rig.tick.guard.max_force_n == LIMIT_N
    rig.tick.release()
    rig.force(-2e-3, ticks=60)
    assert rig.tick.arm()


def test_a_law_that_cannot_start_cannot_be_armed() -> None:
    allowed = True

    def start(_state: Any, _params: Any, _snapshot: Any) -> None:
        if not allowed:
            raise ValueError("not now")

    rig = Rig(wall(2000.0), module=law(returns(1.0), start), arm=False)
    allowed = False
    with pytest.raises(PluginError):
        rig.tick.arm()
    assert rig.tick.guard.mode is Mode.DISARMED


# Faults


def test_the_first_fault_is_the_one_that_is_told() -> None:
    rig = pressed()
    rig.tick.fail(EventCode.OVER_SPEED, "first")
    rig.tick.fail(EventCode.DEVICE_FROZEN, "second")
    assert (rig.tick.fault, rig.tick.fault_text) == (EventCode.OVER_SPEED, "first")


def test_a_fault_that_goes_on_is_told_once_until_it_is_cleared() -> None:
    """A loop that stays over its budget would else send an event every tick."""
    rig = pressed()
    told = 0
    for _ in range(100):
        rig.tick.fail_law(EventCode.LAW_OVER_BUDGET, "slow")
        told += rig.tick.fault != 0
        rig.tick.fault = 0
        rig.force(-2e-3)
    assert told == 1
    rig.tick.fail(EventCode.OVER_SPEED, "another one")
    assert rig.tick.fault == EventCode.OVER_SPEED
    rig.tick.fault = 0
    rig.tick.guard.clear()
    rig.tick.fail_law(EventCode.LAW_OVER_BUDGET, "slow")
    assert rig.tick.fault == EventCode.LAW_OVER_BUDGET


def test_what_the_flags_say_follows_the_guard() -> None:
    rig = Rig(wall(12000.0), at_m=0.0, arm=False)
    assert rig.tick.flags == 0
    rig.tick.arm()
    rig.force(-5e-3)
    assert rig.tick.flags == Flag.ARMED | Flag.LIMITED
    rig.tick.fail(EventCode.OVER_SPEED, "")
    rig.force(-5e-3)
    assert rig.tick.flags == Flag.RELEASING | Flag.LIMITED | Flag.LATCHED
    rig.force(-5e-3, ticks=60)
    assert rig.tick.flags == Flag.LATCHED


# Scene switches


def test_an_unchanged_wall_keeps_its_clock_its_law_and_its_books_wherever_it_stands_in_the_list() -> None:
    changing = wall(2000.0, changes=[{"at_s": 0.03, "stiffness_n_per_m": 4000.0}])
    rig = pressed(wall(100.0, position_m=-1.0), changing, depth_m=1e-3)
    kept = rig.tick.contacts[1]
    rig.force(-1e-3, ticks=10)
    rig.tick.switch_scene(scene(changing, wall(300.0, position_m=-2.0)))
    assert rig.tick.contacts[0] is kept
    assert rig.forces(-1e-3, 18) == [2.0] * 18
    assert rig.forces(-1e-3, 1) == [4.0]


def test_a_wall_that_changed_in_place_keeps_law_and_books_and_starts_its_clock_anew() -> None:
    rig = pressed(module=energy_cycle)
    contact = rig.tick.contacts[0]
    law_before, energy_j = contact.law, contact.ledger.energy_j
    rig.tick.switch_scene(scene(wall(1000.0, changes=[{"at_s": 0.1, "stiffness_n_per_m": 3000.0}])))
    assert rig.tick.contacts == [contact]
    assert contact.law is law_before
    assert contact.ledger.energy_j == energy_j
    rig.force(-2e-3, ticks=100)
    assert contact.wall.stiffness_n_per_m == 1000.0
    rig.force(-2e-3)
    assert contact.wall.stiffness_n_per_m == 3000.0


def test_of_two_equal_walls_each_finds_itself() -> None:
    rig = Rig(wall(100.0), wall(100.0))
    before = list(rig.tick.contacts)
    rig.tick.switch_scene(scene(wall(100.0), wall(100.0)))
    assert rig.tick.contacts == before


def test_a_scene_that_does_not_fit_changes_nothing() -> None:
    rig = pressed()
    contacts = list(rig.tick.contacts)
    with pytest.raises(ConfigError, match=r"scene\.walls\[1\]"):
        rig.tick.switch_scene(scene(wall(9.0), wall(9.0, "x")))
    assert rig.tick.contacts == contacts
    assert rig.force(-2e-3) == 4.0


def test_a_limit_that_does_not_fit_changes_nothing() -> None:
    rig = pressed()
    with pytest.raises(ConfigError, match="max_force_n"):
        rig.tick.switch(scene(wall(9.0)), SafetyConfig(max_force_n=500.0), running(pushes(1.0)))
    assert rig.force(-2e-3) == 4.0


def test_a_scene_that_comes_during_the_fallback_gets_the_fallback() -> None:
    rig = pressed()
    rig.tick.fail_law(EventCode.LAW_OVER_BUDGET, "slow")
    rig.tick.switch(scene(wall(1000.0), wall(2000.0, position_m=-1.0)), None, running(pushes(-5.0)))
    assert {contact.law.module.__name__ for contact in rig.tick.contacts} == {"hapticd.control.fallback"}
    rig.force(-2e-3, ticks=60)
    rig.tick.guard.clear()
    rig.tick.arm()
    assert {contact.law.module.__name__ for contact in rig.tick.contacts} == {"tests.some_law"}


@pytest.mark.parametrize("new", [scene(), scene(wall(500.0, position_m=1e-3))])
def test_the_sum_of_all_books_does_not_jump_when_walls_go(new: Any) -> None:
    """Energy is what the written force did to the device, at every tick, whichever walls there are."""
    rig = Rig(wall(2000.0), at_m=0.0)
    for count in range(300):
        if count in (55, 70):
            rig.tick.switch_scene(new if count == 55 else scene(wall(2000.0)))
        rig.force(-3e-3 * math.sin(0.05 * count))
        energy_j, stored_j, dissipated_j, generated_j = rig.books_j
        assert energy_j == pytest.approx(rig.energy_j, abs=1e-12)
        assert energy_j == pytest.approx(stored_j + dissipated_j - generated_j, abs=1e-12)
    assert not rig.tick.leaving
    assert rig.tick.past.energy_j != 0.0


# Books through everything


@settings(REPEATABLE, max_examples=100)
@given(path=st.lists(st.tuples(DEEDS, st.integers(1, 15), MOVES), min_size=1, max_size=20))
def test_the_books_are_the_work_of_the_written_force_through_every_transition(
    path: list[tuple[str, int, float]],
) -> None:
    rig = pressed()
    position_m = -2e-3
    for deed, ticks, move_m in path:
        if deed in TRANSITIONS:
            TRANSITIONS[deed][0](rig)
        elif deed in ("arm", "clear"):
            (rig.tick.arm if deed == "arm" else rig.tick.guard.clear)()
        for _ in range(ticks):
            position_m = min(0.01, max(-0.01, position_m + move_m))
            generated_j = rig.books_j[3]
            rig.force(position_m)
            energy_j, stored_j, dissipated_j, now_generated_j = rig.books_j
            assert energy_j == pytest.approx(rig.energy_j, abs=1e-9)
            assert energy_j == pytest.approx(stored_j + dissipated_j - now_generated_j, abs=1e-7)
            assert now_generated_j >= generated_j * (1.0 - 1e-12)


def test_a_release_under_a_moving_hand_generates_nothing_that_the_hold_did_not() -> None:
    """A spring that fades: what it made is at most k/2 dx^2 at every step, since fading only ever takes."""
    rig = pressed()
    rig.tick.release()
    made_j = rig.books_j[3]
    for count in range(60):
        before_m = rig.tick.position_m[0]
        rig.force(-2e-3 - 1e-3 * math.sin(0.3 * count))
        now_j = rig.books_j[3]
        assert now_j - made_j <= 0.5 * 2000.0 * (rig.tick.position_m[0] - before_m) ** 2 + 1e-12
        made_j = now_j
    assert rig.books_j[1] == 0.0


def test_a_debt_is_carried_to_the_next_law_and_a_credit_is_not() -> None:
    told: list[Any] = []
    watching = running(law(returns(0.0), lambda _state, _params, snapshot: told.append(snapshot)))
    rig = pressed()
    rig.force(-4e-3)
    rig.tick.switch_law(watching)
    assert rig.books_j[0] > 0.0
    assert told[-1].debt_j == 0.0
    rig = pressed()
    rig.force(-1e-3)
    rig.force(-1e-4)
    rig.tick.switch_law(watching)
    assert told[-1].debt_j == pytest.approx(-rig.books_j[0])
    assert told[-1].debt_j > 0.0
    assert told[-1].applied_n == pytest.approx(0.2)
    assert told[-1].velocity_m_per_s == pytest.approx(0.9)
    assert told[-1].x_m == -1e-4


def test_the_damping_that_was_reached_is_told_to_the_next_law() -> None:
    def step(state: Any, _params: Any, tick: Any) -> float:
        state.damping_n_s_per_m = 31.0
        force_n: float = tick.contact_n
        return force_n

    told: list[Any] = []
    rig = pressed(module=law(step, fields={"damping_n_s_per_m": float}))
    rig.tick.switch_law(running(law(returns(0.0), lambda _state, _params, snapshot: told.append(snapshot))))
    assert told[-1].damping_n_s_per_m == 31.0


def test_the_simulation_profile_lifts_the_limits_of_a_simulated_device() -> None:
    rig = Rig(wall(12000.0), at_m=0.0, simulated=True, safety={"profile": "simulation"})
    assert rig.force(-0.05) == pytest.approx(600.0)
    with pytest.raises(ConfigError):
        Guard(SafetyConfig(profile="simulation"), device())
