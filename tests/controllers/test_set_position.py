"""Passive set-position modulation pays for jumps of the set position, and for nothing else."""

from __future__ import annotations

from dataclasses import replace

import pytest

from hapticd.law import LawSnapshot, LawTick, fresh_state
from hapticd_controllers import damper, set_position
from hapticd_controllers.set_position import Params

from . import machine
from .plant import Device, Rig, rests


@pytest.mark.parametrize("stiffness_n_per_m", [12e3, 20e3])
@pytest.mark.parametrize("damping_n_s_per_m", [20.0, 50.0])
def test_a_damper_of_k_dt_over_2_pays_for_every_jump_and_nothing_else_is_left_of_the_law(
    damping_n_s_per_m: float, stiffness_n_per_m: float
) -> None:
    """At the first sample inside the device has moved at least as far as it is deep: B dx^2 / T >= k x^2 / 2."""
    device = Device(stiffness_n_per_m=stiffness_n_per_m, x_m=0.003)
    modulated = Rig(set_position, device, Params(damping_n_s_per_m=damping_n_s_per_m))
    damped = Rig(damper, device, damper.Params(damping_n_s_per_m=damping_n_s_per_m))
    for seconds, hand_n in ((0.3, -3.0), (0.2, -6.0), (0.2, 2.0), (0.5, -1.0)):
        for rig in (modulated, damped):
            rig.change(hand_n=hand_n)
        for _ in range(round(seconds * 1e3)):
            modulated.run(1e-3)
            damped.run(1e-3)
            assert modulated.tick.applied_n == pytest.approx(damped.tick.applied_n, abs=1e-9)


def test_without_a_damper_it_rings_for_ever() -> None:
    """The local spring leaks as ever: only jumps are in the books."""
    for rest in rests(set_position, Device(), Params(damping_n_s_per_m=0.0), machine.drive):
        assert 1.1e-3 < rest.peak_to_peak_m < 1.4e-3


def test_without_a_damper_the_surface_is_where_the_device_was_first_seen_inside() -> None:
    """A jump to the surface would put k x^2 / 2 into the spring, which was not paid for."""
    rig = Rig(set_position, Device(x_m=0.003), Params(damping_n_s_per_m=0.0))
    while not rig.tick.in_contact:
        rig.run(1e-3)
    assert rig.tick.applied_n == 0.0
    assert rig.state.set_position_m == rig.tick.x_m
    rig.run(1e-3)
    assert 0.0 < rig.tick.applied_n < rig.tick.contact_n


@pytest.mark.parametrize("damping_n_s_per_m", [0.0, 1.0, 3.0, 50.0])
def test_the_energy_never_falls_below_zero(damping_n_s_per_m: float) -> None:
    for x_m in (0.0, 0.001, 0.005):
        rig = Rig(set_position, replace(Device(), x_m=x_m), Params(damping_n_s_per_m=damping_n_s_per_m))
        for _ in range(1000):
            rig.run(1e-3)
            assert rig.state.energy_j >= 0.0
            assert rig.tick.x_m >= 0.0 or rig.tick.x_m <= rig.state.set_position_m <= 0.0


def test_it_pulls_back_as_its_damper_does() -> None:
    rig = Rig(set_position, Device(hand_n=-6.0), drive=machine.drive)
    rig.run(1.0)
    assert rig.let_go().pull_n == pytest.approx(2.1, abs=0.1)


def test_a_debt_is_dissipated_before_the_wall_stands_where_it_should() -> None:
    rig = Rig(set_position, Device(x_m=0.003), Params(damping_n_s_per_m=20.0))
    set_position.start(rig.state, rig.params, LawSnapshot(debt_j=5e-3))
    while not rig.tick.in_contact:
        rig.run(1e-3)
    assert rig.state.set_position_m < 0.0
    rig.run(2.0)
    assert rig.state.set_position_m == 0.0


def test_what_a_jump_does_not_cost_is_left_for_the_next_one() -> None:
    """E(n) = E(n-1) + B dx^2 / dt - k x^2 / 2 once the spring stands on the surface, less what it held before."""
    state, params = fresh_state(set_position), Params(damping_n_s_per_m=50.0)
    set_position.start(state, params, LawSnapshot())
    for x_m, moved_m, left_j in ((-1e-3, -2e-3, 0.2 - 0.005), (-2e-3, -1e-3, 0.195 + 0.05 + 0.02 - 0.02)):
        force_n = -1e4 * x_m
        tick = LawTick(x_m=x_m, moved_m=moved_m, in_contact=True, contact_n=force_n, spring_n=force_n)
        assert set_position.step(state, params, tick) == pytest.approx(force_n)
        assert state.energy_j == pytest.approx(left_j)


def test_a_jump_that_cannot_be_paid_for_goes_as_far_as_all_that_is_left() -> None:
    """K (x - x_s)^2 / 2 = B dx^2 / dt, and nothing is kept of it."""
    state, params = fresh_state(set_position), Params(damping_n_s_per_m=50.0)
    set_position.start(state, params, LawSnapshot())
    tick = LawTick(x_m=-1e-3, moved_m=-1e-4, in_contact=True, contact_n=10.0, spring_n=10.0)
    assert set_position.step(state, params, tick) == pytest.approx((2.0 * 1e4 * 50.0 * 1e-8 / 1e-3) ** 0.5)
    assert state.set_position_m == pytest.approx(-1e-3 + (2.0 * 5e-4 / 1e4) ** 0.5)
    assert state.energy_j == 0.0


def test_a_new_touch_begins_as_slack_as_the_first_one() -> None:
    """What the spring held when the device was pulled out of the wall is gone."""
    state, params = fresh_state(set_position), Params(damping_n_s_per_m=0.0)
    set_position.start(state, params, LawSnapshot())
    for x_m in (-1e-3, 1e-3, -3e-3):
        inside = x_m < 0.0
        force_n = -1e4 * x_m if inside else 0.0
        tick = LawTick(x_m=x_m, moved_m=-2e-3, in_contact=inside, contact_n=force_n, spring_n=force_n)
        assert set_position.step(state, params, tick) == 0.0
    assert state.set_position_m == -3e-3
