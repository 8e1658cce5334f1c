"""Laws that start in a wall that is pressed: what the spring gives back is no gain and no debt."""

from __future__ import annotations

import math
from types import ModuleType
from typing import Any

import pytest

from hapticd.law import LawSnapshot, LawTick, fresh_state, plain_object, scalar_params
from hapticd_controllers import energy_cycle, none, ring_damping, tdpa
from hapticd_controllers.energy_cycle import Params
from tests.tick.rig import Rig, running, wall

STIFFNESS_N_PER_M = 5e3
LEAK_N_S_PER_M = 0.5 * STIFFNESS_N_PER_M * 1e-3


def trembles(rig: Rig, ticks: int, hz: float = 1.0) -> float:
    """The damping after a hand has pressed 1.5 mm deep, more and less by 0.5 mm [N s/m]."""
    for n in range(ticks):
        rig.force(-1.5e-3 - 5e-4 * math.sin(2e-3 * math.pi * hz * n))
    return rig.tick.contacts[0].damping_n_s_per_m


def pressed(module: ModuleType = energy_cycle, arm: bool = True) -> Rig:
    rig = Rig(wall(STIFFNESS_N_PER_M), module=module, at_m=0.005, arm=arm)
    for n in range(100):
        rig.force(0.005 - 6.5e-5 * (n + 1))
    return rig


def test_a_hand_that_presses_when_the_device_is_armed_gets_the_damping_of_one_that_came_later() -> None:
    later = pressed()
    armed = pressed(arm=False)
    assert armed.tick.arm()
    assert trembles(armed, 2000) == pytest.approx(trembles(later, 2000), rel=0.1)
    assert armed.tick.contacts[0].damping_n_s_per_m == pytest.approx(LEAK_N_S_PER_M, rel=0.1)


@pytest.mark.parametrize("resolution_m", [0.0, 1e-5])
def test_a_law_that_takes_over_under_a_hand_damps_what_the_wall_makes_and_no_more(resolution_m: float) -> None:
    rig = Rig(wall(STIFFNESS_N_PER_M), module=ring_damping, at_m=0.005, resolution_m=resolution_m)
    trembles(rig, 1000)
    rig.switch(make_law=running(energy_cycle))
    assert trembles(rig, 2000) <= 1.1 * LEAK_N_S_PER_M


START_M = -1.5e-3
STORED_J = 0.5 * STIFFNESS_N_PER_M * START_M**2


def first(x_m: float, start_m: float = START_M, debt_j: float = 0.0, **readings: str) -> Any:
    """What is remembered after a start and one sample, in which the device has moved without a force."""
    params = plain_object("Params", scalar_params(Params.model_validate(readings)))
    state = fresh_state(energy_cycle)
    energy_cycle.start(state, params, LawSnapshot(x_m=start_m, debt_j=debt_j, damping_n_s_per_m=7.0))
    pushed_n = -STIFFNESS_N_PER_M * x_m
    tick = LawTick(x_m=x_m, moved_m=x_m - start_m, in_contact=True, contact_n=pushed_n, spring_n=pushed_n)
    energy_cycle.step(state, params, tick)
    return state


@pytest.mark.parametrize("x_m", [START_M, -1e-3, -2e-3])
def test_it_begins_with_what_the_spring_held_at_its_start_less_what_is_owed(x_m: float) -> None:
    assert first(x_m).energy_j == pytest.approx(STORED_J, rel=1e-12)
    assert first(x_m, debt_j=1e-3).energy_j == pytest.approx(STORED_J - 1e-3, rel=1e-12)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_along_a_surface_a_spring_is_stretched_either_way(side: float) -> None:
    held = first(side * 1e-3, side * 1.5e-3)
    assert held.energy_j == pytest.approx(STORED_J, rel=1e-12)


@pytest.mark.parametrize("start_m", [0.0, 2e-3])
def test_a_device_that_has_come_in_since_found_a_spring_that_held_nothing(start_m: float) -> None:
    assert first(-1e-3, start_m).energy_j == 0.0


@pytest.mark.parametrize(("start_m", "kept"), [(START_M, 7.0), (1e-3, 0.0)])
def test_a_touch_that_was_there_at_the_start_is_no_new_one(start_m: float, kept: float) -> None:
    state = first(-1e-3, start_m, new_contact="damping")
    assert state.damping_n_s_per_m == kept


def swallowed_j(rig: Rig, ticks: int = 30) -> float:
    """What a hand does not get back of the spring that retreats from 1.5 mm, after the ramps."""
    rig.force(START_M, ticks=200)
    swallowed_j = 0.0
    for n in range(ticks):
        x_m = START_M * (1.0 - (n + 1) / ticks)
        pulled_n = -STIFFNESS_N_PER_M * x_m - rig.force(x_m)
        swallowed_j -= pulled_n * START_M / ticks
    return swallowed_j


@pytest.mark.parametrize("switched", [False, True])
def test_passivity_control_that_starts_in_a_pressed_wall_takes_no_more_than_one_that_came_free(switched: bool) -> None:
    """Of 5.6 mJ it swallowed 4.0: the spring's return was a debt."""
    rig = pressed(none if switched else tdpa, arm=switched)
    if switched:
        rig.switch(make_law=running(tdpa))
    else:
        assert rig.tick.arm()
    assert swallowed_j(rig) <= swallowed_j(pressed(tdpa))


def retreated(ticks: int) -> Rig:
    """A hand that was in the wall when the device was armed, and has come back by 1.4 mm of 1.5."""
    rig = pressed(none, arm=False)
    assert rig.tick.arm()
    rig.force(START_M, ticks=200)
    for n in range(ticks):
        rig.force(START_M + 1.4e-3 * (n + 1) / ticks)
    return rig


def test_what_the_ramp_put_into_a_spring_is_no_debt_of_who_retreats() -> None:
    """It was 5.1 mJ, all that the spring gave back."""
    rig = retreated(200)
    leaked_j = 200 * 0.5 * STIFFNESS_N_PER_M * 7e-6**2
    assert rig.tick.contacts[0].ledger.debt_j <= leaked_j


def test_armed_again_the_spring_counts_once() -> None:
    rig = retreated(200)
    for _ in range(3):
        rig.force(START_M)
        rig.tick.release(0.0)
        rig.force(START_M, ticks=5)
        assert rig.tick.arm()
        rig.force(START_M, ticks=100)
    contact = rig.tick.contacts[0]
    before_j = contact.ledger.energy_j
    rig.force(-1e-6)
    given_j = before_j - contact.ledger.energy_j
    assert contact.ledger.debt_j == pytest.approx(given_j - STORED_J, rel=1e-6)
