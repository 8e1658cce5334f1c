"""The tick as a whole: which walls push where, what the guard leaves alone, which fault is told."""

from __future__ import annotations

import math
from types import ModuleType

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from hapticd.tick.event import EventCode
from hapticd.tick.flags import Flag
from hapticd_controllers import energy_cycle, none, tdpa
from tests.tick.rig import LIMIT_N, PERIOD_S, Rig, running, wall
from tests.tick.transitions import pressed

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
