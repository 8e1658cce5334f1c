"""Which bounds make time-domain passivity control hold a wall, and what it never holds."""

from __future__ import annotations

import statistics
from dataclasses import replace
from types import ModuleType
from typing import Any, Literal

import pytest

from hapticd.law import LawSnapshot, LawTick, fresh_state, plain_object, scalar_params
from hapticd_controllers import energy_cycle, none, tdpa
from hapticd_controllers.tdpa import Params, step

from . import machine
from .plant import PAPER, Device, Rig, held, rests

DROPS_M = (0.0, 0.5e-3, 1e-3, 1.5e-3, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3, 7e-3, 8.5e-3, 10e-3)
AS_PUBLISHED = Params(damping_cap_n_s_per_m=0.0, min_speed_m_per_s=0.0, reset="never")


def starts(hand_n: float) -> list[Device]:
    return [Device(hand_n=hand_n, x_m=drop_m) for drop_m in DROPS_M]


@pytest.mark.parametrize("hand_n", [-1.0, -3.0, -6.0])
def test_bounded_it_holds_12_kn_per_m_in_every_start(hand_n: float) -> None:
    assert all(held(tdpa, device) for device in starts(hand_n))


def test_as_published_it_loses_12_kn_per_m_in_most_starts() -> None:
    """The paper's Fig. 10; chaotic, so that only a share over starts is a fact."""
    lost = [device for device in starts(-3.0) if not held(tdpa, device, AS_PUBLISHED)]
    assert len(lost) > len(DROPS_M) / 2


def test_without_damping_in_the_device_it_leaves_the_wall_lossless() -> None:
    """It forbids generation and asks for nothing more: Fig. 6 never comes to rest, bounded or not."""
    for params in (Params(), AS_PUBLISHED):
        peak_to_peak_m = Rig(tdpa, PAPER, params).run(3.0).peak_to_peak_m
        assert 1e-3 < peak_to_peak_m < 10e-3


def test_one_sample_of_delay_that_it_does_not_know_defeats_it() -> None:
    """It pays k dt / 2 where k 3 dt / 2 is due; the energy cycles identify the delay."""
    late = Device(stiffness_n_per_m=15e3, delay_samples=1)
    assert not held(tdpa, late)
    assert held(energy_cycle, late)


def test_the_printed_observer_is_no_control() -> None:
    """Eq. 2 pairs F(n) with v(n): never below zero at 12 kN/m, so that the controller never acts."""
    device = Device(x_m=0.003)
    printed = Rig(tdpa, device, Params(observer="printed"))
    assert printed.run(4.0) == Rig(none, device).run(4.0)


def test_a_debt_that_is_forgiven_is_never_paid() -> None:
    assert not any(held(tdpa, device, Params(carry_debt=False)) for device in starts(-3.0))


def test_a_debt_is_carried_over_and_a_credit_ends_with_the_contact() -> None:
    rig = Rig(tdpa, replace(PAPER, x_m=0.001))
    tdpa.start(rig.state, rig.params, LawSnapshot(debt_j=0.001))
    assert rig.state.energy_j == -0.001
    rig.state.energy_j = 1.0
    rig.run(1e-3)
    assert rig.state.energy_j == 0.0


def test_the_bounds_bind() -> None:
    rig = Rig(tdpa, Device(), Params(damping_cap_n_s_per_m=20.0, min_speed_m_per_s=0.005))
    for _ in range(2000):
        rig.run(1e-3)
        assert rig.state.damping_n_s_per_m <= 20.0
        assert rig.state.damping_n_s_per_m == 0.0 or abs(rig.tick.velocity_m_per_s) >= 0.005


def outside(rig: Rig, seconds: float = 0.05) -> None:
    """Draw the device out of the wall and hold it there."""
    rig.change(hand_n=20.0)
    while rig.tick.in_contact:
        rig.run(1e-3)
    rig.change(hand_n=0.0, v_m_per_s=0.0)
    rig.run(seconds)
    assert not rig.tick.in_contact


@pytest.mark.parametrize("reset", ["contact", "never"])
def test_a_debt_survives_the_loss_of_contact(reset: Literal["contact", "never"]) -> None:
    """T1: it is paid in the next contact: leaving the wall forgives nothing."""
    rig = Rig(tdpa, Device(), Params(reset=reset))
    rig.run(0.5)
    rig.state.energy_j = -0.5
    outside(rig)
    owed_j = -rig.state.energy_j
    assert owed_j > 0.4
    rig.change(hand_n=-3.0)
    while not rig.tick.in_contact:
        rig.run(1e-3)
    assert rig.state.damping_n_s_per_m == 50.0
    rig.run(0.05)
    assert -rig.state.energy_j < owed_j


@pytest.mark.parametrize(("reset", "kept"), [("contact", False), ("never", True)])
def test_only_a_law_that_never_resets_keeps_a_credit_without_contact(
    reset: Literal["contact", "never"], kept: bool
) -> None:
    """T1."""
    rig = Rig(tdpa, Device(), Params(reset=reset))
    rig.run(0.5)
    rig.state.energy_j = 0.5
    outside(rig)
    credit_j = rig.state.energy_j
    assert (credit_j > 0.4) is kept
    outside(rig, 1.0)
    assert rig.state.energy_j == credit_j
    assert kept or credit_j == 0.0


REFERENCE = Params(reference="stored")


def test_a_press_leaves_a_credit_and_with_reference_energy_none() -> None:
    """What went into the spring is there to be spent, unless it is asked for back."""
    spent = {}
    for params in (Params(), REFERENCE):
        rig = Rig(tdpa, Device(x_m=0.005), params)
        while not rig.tick.in_contact:
            rig.run(1e-3)
        rig.run(3e-3)
        spent[params.reference] = rig.state.damping_n_s_per_m
    assert spent["zero"] == 0.0
    assert spent["stored"] > 0.0


@pytest.mark.parametrize("hand_n", [-1.0, -3.0, -6.0])
@pytest.mark.parametrize("stiffness_n_per_m", [12e3, 20e3])
def test_bounded_with_reference_energy_it_holds_every_start(stiffness_n_per_m: float, hand_n: float) -> None:
    device = Device(stiffness_n_per_m=stiffness_n_per_m, hand_n=hand_n)
    assert all(rest.held for rest in rests(tdpa, device, REFERENCE, machine.drive))


def test_bounded_with_reference_energy_it_hardly_pulls_who_leaves() -> None:
    """Let go from 6 N at 12 kN/m; without the reference the debt of the whole press falls due at the exit."""
    pulls_n = {}
    for params in (Params(), REFERENCE):
        rig = Rig(tdpa, Device(hand_n=-6.0), params)
        rig.run(1.0)
        pulls_n[params.reference] = rig.let_go().pull_n
    assert pulls_n["zero"] == pytest.approx(2.4, abs=0.1)
    assert pulls_n["stored"] == pytest.approx(0.25, abs=0.05)


def test_unbounded_with_reference_energy_it_holds_still_in_a_wall_ten_times_too_soft() -> None:
    params = Params(damping_cap_n_s_per_m=0.0, min_speed_m_per_s=0.0, reset="never", reference="stored")
    pressed = rests(tdpa, Device(hand_n=-6.0), params, machine.drive)
    assert all(rest.still for rest in pressed)
    assert not any(rest.held for rest in pressed)
    assert 0.9e3 < 6.0 / statistics.median(rest.depth_m for rest in pressed) < 1.4e3
    lighter = rests(tdpa, Device(), params, machine.drive)
    assert statistics.median(rest.peak_to_peak_m for rest in lighter) > 5e-3


def test_what_is_forgiven_is_what_is_missing_from_the_reference() -> None:
    rig = Rig(tdpa, Device(), Params(reference="stored", carry_debt=False))
    rig.run(0.5)
    stored_j = rig.state.reference_j
    assert stored_j == pytest.approx(6e3 * rig.tick.x_m**2)
    rig.state.energy_j = -1.0
    rig.run(1e-3)
    assert rig.state.energy_j == pytest.approx(stored_j, abs=1e-6)


@pytest.mark.parametrize("stiffness_n_per_m", [12e3, 20e3])
def test_reference_energy_is_no_help_against_a_delay_that_it_does_not_know(stiffness_n_per_m: float) -> None:
    late = Device(stiffness_n_per_m=stiffness_n_per_m, delay_samples=1)
    for params in (Params(), REFERENCE):
        assert not any(rest.still for rest in rests(tdpa, late, params, machine.drive))


class AwareState(tdpa.State):
    """Of a law that is told which force acts: the one of the sample before."""

    earlier_n: float


def aware_step(state: Any, params: Any, tick: Any) -> float:
    commanded_n = tick.applied_n
    tick.applied_n, state.earlier_n = state.earlier_n, commanded_n
    return step(state, params, tick)


def test_told_of_the_delay_both_hold_most_starts_at_20_kn_per_m_and_the_plain_one_all() -> None:
    """It is the right force in the observer that helps, and not the reference."""
    aware = ModuleType("aware")
    vars(aware).update(Params=Params, State=AwareState, start=tdpa.start, step=aware_step)
    late = Device(stiffness_n_per_m=20e3, delay_samples=1)
    assert all(rest.held for rest in rests(aware, late, Params(), machine.drive))
    assert 11 <= sum(rest.held for rest in rests(aware, late, REFERENCE, machine.drive)) < 21


@pytest.mark.parametrize(("cap_n_s_per_m", "injected_n_s_per_m"), [(0.5, 0.5), (20.0, 20.0), (0.0, 1e5)])
def test_the_cap_is_the_most_that_is_injected_and_0_is_none(cap_n_s_per_m: float, injected_n_s_per_m: float) -> None:
    """A debt of 1 J at 0.1 m/s: 1e5 N s/m would pay it in a tick."""
    state, params = fresh_state(tdpa), Params(damping_cap_n_s_per_m=cap_n_s_per_m)
    tdpa.start(state, params, LawSnapshot(debt_j=1.0))
    step(state, params, LawTick(x_m=-1e-3, velocity_m_per_s=0.1, in_contact=True, contact_n=10.0, spring_n=10.0))
    assert state.damping_n_s_per_m == pytest.approx(injected_n_s_per_m, rel=0.01)


@pytest.mark.parametrize("carry_debt", [False, True])
@pytest.mark.parametrize("start_m", [-1e-3, 0.0, 1e-3])
def test_a_law_that_takes_over_begins_with_what_a_pressed_spring_holds(carry_debt: bool, start_m: float) -> None:
    state, params = fresh_state(tdpa), plain_object("Params", scalar_params(Params(carry_debt=carry_debt)))
    tdpa.start(state, params, LawSnapshot(x_m=start_m, debt_j=5e-3))
    held_j = 2e-3 if start_m < 0.0 else 0.0
    for _ in range(2):
        tdpa.step(state, params, LawTick(x_m=-1e-3, in_contact=True, contact_n=4.0, spring_n=4.0))
        assert state.energy_j == pytest.approx(held_j - 5e-3 if carry_debt else held_j, abs=1e-15)
