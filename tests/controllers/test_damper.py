"""What a constant damper does as well as any law, and what it costs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from hapticd_controllers import damper, none
from hapticd_controllers.damper import Params

from . import machine
from .plant import DROPS_M, Device, Rig, rests


def all_held(damping_n_s_per_m: float, device: Device) -> bool:
    return all(rest.held for rest in rests(damper, device, Params(damping_n_s_per_m=damping_n_s_per_m), machine.drive))


@pytest.mark.parametrize("hand_n", [-1.0, -3.0, -6.0])
@pytest.mark.parametrize("stiffness_n_per_m", [12e3, 20e3])
@pytest.mark.parametrize("damping_n_s_per_m", [20.0, 50.0])
def test_it_holds_every_still_hand(damping_n_s_per_m: float, stiffness_n_per_m: float, hand_n: float) -> None:
    """So a table of still hands cannot show that an adaptive law is worth having."""
    device = Device(stiffness_n_per_m=stiffness_n_per_m, hand_n=hand_n)
    assert all_held(damping_n_s_per_m, device)
    assert not any(rest.held for rest in rests(none, device, drive=machine.drive))


def test_one_sample_late_20_is_too_little_and_50_still_enough() -> None:
    late = Device(stiffness_n_per_m=20e3, delay_samples=1)
    assert not any(rest.still for rest in rests(damper, late, Params(damping_n_s_per_m=20.0), machine.drive))
    assert all_held(50.0, late)


def test_the_stiffest_wall_is_that_of_the_closed_form() -> None:
    """Without damping in the device, K < (2 B / T) (1 - u) / (1 + u), u = B T / (2 m)."""
    damping, mass_kg, period_s = 50.0, 0.25, 1e-3
    u = damping * period_s / (2.0 * mass_kg)
    limit = 2.0 * damping / period_s * (1.0 - u) / (1.0 + u)
    bare = Device(viscous_n_s_per_m=0.0, resolution_m=0.0, limit_n=0.0, x_m=-0.3e-3, hand_n=-30.0)
    for share, stays in ((0.99, True), (1.01, False)):
        rig = Rig(damper, replace(bare, stiffness_n_per_m=share * limit), Params(), machine.drive)
        assert rig.run(2.0).still is stays


@pytest.mark.parametrize(
    ("damping_n_s_per_m", "pull_n", "speed_m_per_s"), [(20.0, 0.96, 0.083), (50.0, 2.1, 0.036), (100.0, 1.7, 0.003)]
)
def test_it_pulls_back_whoever_leaves(damping_n_s_per_m: float, pull_n: float, speed_m_per_s: float) -> None:
    """Let go from 6 N at 12 kN/m: at 100 N s/m the device is glued to the wall."""
    rig = Rig(damper, Device(hand_n=-6.0), Params(damping_n_s_per_m=damping_n_s_per_m), machine.drive)
    rig.run(1.0)
    left = rig.let_go()
    assert left.pull_n == pytest.approx(pull_n, rel=0.03)
    assert left.speed_m_per_s == pytest.approx(speed_m_per_s, abs=1.5e-3)


def shake_um(damping_n_s_per_m: float, resolution_m: float) -> float:
    """Median over starts of the motion between 100 and 300 Hz, as the peak of a sine of the same power."""
    peaks = []
    for x_m in DROPS_M:
        device = Device(stiffness_n_per_m=20e3, resolution_m=resolution_m, x_m=x_m)
        rig = Rig(damper, device, Params(damping_n_s_per_m=damping_n_s_per_m), machine.drive)
        assert rig.run(3.0).held
        positions_m = np.empty(1000)
        for i in range(positions_m.size):
            rig.run(1e-3)
            positions_m[i] = rig.plant.x_m
        lines = np.fft.rfft(positions_m - positions_m.mean()) / positions_m.size
        peaks.append(2e6 * math.sqrt(float((np.abs(lines[100:301]) ** 2).sum())))
    return float(np.median(peaks))


def test_a_wall_that_is_called_still_may_be_felt_to_hum() -> None:
    """A pen in the hand is felt to move from 0.2 um at 100 Hz and 0.06 um at 300 Hz on; the count here is 10 um."""
    assert shake_um(200.0, 1e-5) > 1.2
    assert 0.2 < shake_um(50.0, 1e-5) < 0.6
    assert shake_um(50.0, 1e-6) < 0.06
