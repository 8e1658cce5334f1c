"""Energy bounding shows no wall stiffer than what the device's damping pays for."""

from __future__ import annotations

import pytest

from hapticd.law import LawSnapshot, LawTick, fresh_state, plain_object, scalar_params
from hapticd_controllers import energy_bounding
from hapticd_controllers.energy_bounding import Params

from . import machine
from .plant import Device, Rig, rests

MOST_N_PER_M = 2.0 * 0.75 * 4.4 / 1e-3
"""2 p / T of the defaults."""


@pytest.mark.parametrize("stiffness_n_per_m", [4e3, 6e3, 8e3, 12e3, 20e3, 40e3])
def test_a_slow_press_is_shown_exactly_the_lesser_of_k_and_2p_over_t(stiffness_n_per_m: float) -> None:
    state, tick = fresh_state(energy_bounding), LawTick()
    params = plain_object("Params", scalar_params(Params()))
    energy_bounding.start(state, params, LawSnapshot())
    tick.dt_s, tick.in_contact, tick.moved_m = 1e-3, True, -1e-6
    for i in range(1, 1001):  # 1 mm/s, 1 um inside at the first sample
        tick.x_m = i * tick.moved_m
        tick.spring_n = tick.contact_n = -stiffness_n_per_m * tick.x_m
        tick.applied_n = energy_bounding.step(state, params, tick)
        allowed_n = -MOST_N_PER_M * (tick.x_m - tick.moved_m)
        if stiffness_n_per_m > MOST_N_PER_M:
            assert tick.applied_n == pytest.approx(allowed_n, rel=1e-9)
        elif i > 100:
            assert tick.applied_n == tick.contact_n


@pytest.mark.parametrize("hand_n", [-1.0, -3.0, -6.0])
@pytest.mark.parametrize("stiffness_n_per_m", [12e3, 20e3])
def test_at_three_quarters_of_b_it_is_still_and_far_too_deep(stiffness_n_per_m: float, hand_n: float) -> None:
    """Flicker of a count pays in as well, so that the force creeps a little above 2 p / T."""
    for rest in rests(energy_bounding, Device(stiffness_n_per_m=stiffness_n_per_m, hand_n=hand_n), drive=machine.drive):
        assert rest.still
        assert not rest.held
        assert 6.1e3 < -hand_n / rest.depth_m < 1.02 * MOST_N_PER_M


@pytest.mark.parametrize(("hand_n", "least_m", "most_m"), [(-1.0, 0.15e-3, 0.3e-3), (-6.0, 1.1e-3, 1.5e-3)])
def test_with_all_of_b_it_rings_for_ever(hand_n: float, least_m: float, most_m: float) -> None:
    """No margin is left: the device dissipates exactly what the wall makes."""
    for rest in rests(energy_bounding, Device(hand_n=hand_n), Params(share=1.0), machine.drive):
        assert least_m < rest.peak_to_peak_m < most_m


def test_with_half_of_b_it_shows_about_4_kn_per_m() -> None:
    for rest in rests(energy_bounding, Device(), Params(share=0.5), machine.drive):
        assert rest.still
        assert 4.0e3 < 3.0 / rest.depth_m < 4.45e3


def test_a_device_that_dissipates_less_than_assumed_rings() -> None:
    worn = Device(viscous_n_s_per_m=2.9)
    assert not any(rest.still for rest in rests(energy_bounding, worn, drive=machine.drive))


def test_one_sample_late_it_rings() -> None:
    """The delay trebles the leak; at a third of the stiffness it is still again."""
    late = Device(delay_samples=1)
    assert all(rest.peak_to_peak_m > 1e-3 for rest in rests(energy_bounding, late, drive=machine.drive))
    assert all(rest.still for rest in rests(energy_bounding, late, Params(share=0.25), machine.drive))


def test_it_never_pulls() -> None:
    rig = Rig(energy_bounding, Device(hand_n=-6.0), drive=machine.drive)
    rig.run(1.0)
    assert rig.let_go().pull_n == 0.0


def test_a_debt_is_dissipated_before_it_pushes() -> None:
    rig = Rig(energy_bounding, Device(x_m=0.001))
    energy_bounding.start(rig.state, rig.params, LawSnapshot(debt_j=1e-4))
    pushed = False
    for _ in range(50):
        rig.run(1e-3)
        pushed = pushed or rig.tick.applied_n > 0.0
        assert not (pushed and rig.state.energy_j < 0.0)
        assert not (rig.tick.applied_n > 0.0 and rig.state.energy_j <= 0.0)
    assert pushed
