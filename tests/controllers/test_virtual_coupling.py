"""What a virtual coupling shows of a wall, and why its published rule needs the exact limit beside it."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import pytest

from hapticd.law import LawSnapshot, LawTick, fresh_state
from hapticd_controllers import damper, virtual_coupling
from hapticd_controllers.virtual_coupling import Params

from . import machine
from .plant import Device, Rig, rests

RIGID_N_PER_M = 1e12
DEVICE = Device()
SMOOTH = Device(resolution_m=0.0, x_m=-0.3e-3, stiffness_n_per_m=RIGID_N_PER_M)


def coupling(stiffness_n_per_m: float, damping_n_s_per_m: float) -> Params:
    return Params(coupling_stiffness_n_per_m=stiffness_n_per_m, coupling_damping_n_s_per_m=damping_n_s_per_m)


@pytest.mark.parametrize("stiffness_n_per_m", [2e3, 12e3, 20e3, RIGID_N_PER_M])
def test_it_shows_wall_and_coupling_in_series(stiffness_n_per_m: float) -> None:
    series = 1.0 / (1.0 / stiffness_n_per_m + 1.0 / 6600.0)
    for rest in rests(virtual_coupling, Device(stiffness_n_per_m=stiffness_n_per_m, hand_n=-6.0), drive=machine.drive):
        assert rest.still
        assert 6.0 / rest.depth_m == pytest.approx(series, rel=0.005)


@pytest.mark.parametrize("damping_n_s_per_m", [20.0, 50.0])
def test_before_a_rigid_wall_it_is_the_constant_damper(damping_n_s_per_m: float) -> None:
    pressed = Rig(virtual_coupling, SMOOTH, coupling(12e3, damping_n_s_per_m))
    damped = Rig(damper, replace(SMOOTH, stiffness_n_per_m=12e3), damper.Params(damping_n_s_per_m=damping_n_s_per_m))
    for rig in (pressed, damped):
        rig.run(0.002)  # how it touches first is another matter: the proxy starts at the device
    damped.change(x_m=pressed.plant.x_m, v_m_per_s=pressed.plant.v_m_per_s, measured_m=pressed.plant.measured_m)
    for _ in range(200):
        assert pressed.plant.x_m == pytest.approx(damped.plant.x_m, abs=1e-9)
        pressed.run(1e-3)
        damped.run(1e-3)


def test_it_never_pulls_where_the_constant_damper_does() -> None:
    """A proxy without mass that the device pulls away from the wall is free."""
    rig = Rig(virtual_coupling, Device(hand_n=-6.0, stiffness_n_per_m=RIGID_N_PER_M), coupling(12e3, 50.0))
    rig.run(1.0)
    left = rig.let_go()
    assert left.pull_n == 0.0
    assert left.speed_m_per_s > 0.05


def tustin_rule_allows(stiffness_n_per_m: float, damping_n_s_per_m: float) -> bool:
    """Adams & Hannaford: Re(1 / Zc) >= (1 - c) c / (2 b), c = cos(w T / 2), Zc = Bc + Kc T z / (z - 1), w to pi / T."""
    period_s, b = DEVICE.period_s, DEVICE.viscous_n_s_per_m
    for i in range(1, 1001):
        half = 0.5 * math.pi * i / 1000
        z = cmath.exp(2j * half)
        impedance = damping_n_s_per_m + stiffness_n_per_m * period_s * z / (z - 1.0)
        if (1.0 / impedance).real < (1.0 - math.cos(half)) * math.cos(half) / (2.0 * b) - 1e-12:
            return False
    return True


def test_the_rule_by_tustin_allows_four_times_what_the_loop_bears() -> None:
    """It takes device and hold by the bilinear rule, which hides the leak: 8 b / T, not 2 b / T (1 + b T / 6 m)."""
    b, period_s = DEVICE.viscous_n_s_per_m, DEVICE.period_s
    assert tustin_rule_allows(0.999 * 8.0 * b / period_s, 0.0)
    assert not tustin_rule_allows(1.01 * 8.0 * b / period_s, 0.0)
    limit = 2.0 * b / period_s * (1.0 + b * period_s / (6.0 * DEVICE.mass_kg))
    assert limit == pytest.approx(8826.0, abs=1.0)

    def swing_m(share: float) -> tuple[float, float]:
        rig = Rig(virtual_coupling, SMOOTH, coupling(share * limit, 0.0), machine.drive)
        return rig.run(1.0).peak_to_peak_m, rig.run(4.0).peak_to_peak_m

    early_m, late_m = swing_m(0.99)
    assert late_m < early_m
    early_m, late_m = swing_m(1.01)
    assert late_m > early_m
    for stiffness_n_per_m in (12e3, 20e3, 35e3):
        assert tustin_rule_allows(stiffness_n_per_m, 0.0)
        rings = rests(
            virtual_coupling,
            replace(DEVICE, stiffness_n_per_m=RIGID_N_PER_M),
            coupling(stiffness_n_per_m, 0.0),
            machine.drive,
        )
        assert all(rest.peak_to_peak_m > 1e-3 for rest in rings)


@pytest.mark.parametrize("stiffness_n_per_m", [12e3, 20e3, RIGID_N_PER_M])
def test_one_sample_late_the_defaults_ring(stiffness_n_per_m: float) -> None:
    late = Device(stiffness_n_per_m=stiffness_n_per_m, delay_samples=1)
    assert not any(rest.still for rest in rests(virtual_coupling, late, drive=machine.drive))


def test_a_second_touch_is_as_the_first() -> None:
    """Outside the proxy goes with the device: where it was at the last touch counts for nothing."""
    state, params = fresh_state(virtual_coupling), Params()
    virtual_coupling.start(state, params, LawSnapshot(x_m=1e-3))
    touch = LawTick(x_m=-1e-3, moved_m=-2e-3, in_contact=True, contact_n=12.0, spring_n=12.0)
    first_n = virtual_coupling.step(state, params, touch)
    virtual_coupling.step(
        state, params, LawTick(x_m=-5e-3, moved_m=-4e-3, in_contact=True, contact_n=60.0, spring_n=60.0)
    )
    assert virtual_coupling.step(state, params, LawTick(x_m=1e-3, moved_m=6e-3)) == 0.0
    assert virtual_coupling.step(state, params, touch) == first_n > 1.0


def test_a_wall_as_soft_as_air_is_shown_as_it_is() -> None:
    state, params = fresh_state(virtual_coupling), Params()
    virtual_coupling.start(state, params, LawSnapshot(x_m=-1e-3))
    still = LawTick(x_m=-1e-3, in_contact=True, contact_n=0.5e-3, spring_n=0.5e-3)
    for _ in range(100):
        force_n = virtual_coupling.step(state, params, still)
    assert force_n == pytest.approx(0.5e-3, rel=1e-3)
