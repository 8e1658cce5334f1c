"""Which bounds make time-domain passivity control hold a wall, and what it never holds."""

from __future__ import annotations

from dataclasses import replace

import pytest

from hapticd.law import LawSnapshot
from hapticd_controllers import energy_cycle, none, tdpa
from hapticd_controllers.tdpa import Params

from .plant import PAPER, Device, Rig, held

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
