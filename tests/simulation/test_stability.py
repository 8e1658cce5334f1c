"""The model shows the instabilities that theory predicts, where it predicts them, and no others."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions

T = 1e-3

# K_max [N/m] of a sampled spring on a mass m [kg] with damping b [N s/m]: no delay / one sample of delay.
LIMITS = {
    (1e-4, 0.5): ("10000.8/3333.8", "10000.3/3333.5", "10000.2/3333.4", "10000.1/3333.4"),
    (1e-4, 1.0): ("20003.3/6668.5", "20001.3/6667.4", "20000.7/6667.0", "20000.3/6666.9"),
    (1e-4, 5.0): ("100083/33380", "100033/33352", "100017/33343", "100008/33338"),
    (1e-3, 0.5): ("1000.8/333.8", "1000.3/333.5", "1000.2/333.4", "1000.1/333.4"),
    (1e-3, 1.0): ("2003.3/668.5", "2001.3/667.4", "2000.7/667.0", "2000.3/666.9"),
    (1e-3, 5.0): ("10084/3378.9", "10033/3351.7", "10017/3342.6", "10008/3338.0"),
    (1e-2, 0.5): ("100.84/33.79", "100.33/33.52", "100.17/33.43", "100.08/33.38"),
    (1e-2, 1.0): ("203.39/68.46", "201.34/67.40", "200.67/67.03", "200.33/66.85"),
    (1e-2, 5.0): ("1090.5/373.2", "1034.5/350.8", "1016.9/342.3", "1008.4/337.9"),
}
TABLE = [
    (period, damping, mass, delay, float(cell.split("/")[delay]))
    for (period, damping), row in LIMITS.items()
    for mass, cell in zip((0.1, 0.25, 0.5, 1.0), row, strict=True)
    for delay in (0, 1)
]


def device(period: float = T, **keys: Any) -> SimulatedDevice:
    return SimulatedDevice(SimulationOptions.model_validate({"model": "paper-simulation", **keys}), period)


def growth(keys: dict[str, Any], period: float, feedback: Callable[[float, float], float]) -> float:
    """Largest factor per sample by which a linear loop grows: eigenvalues of the map that the model itself shows."""
    delay = keys.get("force_delay_samples", 0)
    size = 3 + delay

    def step(state: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        x, v, last_x = (float(value) for value in state[:3])
        mover = device(period, initial_position_m=x, initial_velocity_m_per_s=v, **keys)
        for waiting in state[3:]:
            mover.buffers.line[mover.state.line_at] = float(waiting)
            mover.state.line_at = (mover.state.line_at + 1) % (delay + 1)
        force = feedback(x, (x - last_x) / period)
        mover.advance(force)
        return np.array([mover.x_m, mover.v_m_per_s, x, *[*state[3:], force][len(state[3:]) + 1 - delay :]])

    scales = np.array([1.0, 1.0, 1.0] + [1.0] * delay)
    matrix = np.column_stack([step(unit) for unit in np.diag(scales)])
    assert matrix.shape == (size, size)
    return float(np.abs(np.linalg.eigvals(matrix)).max())


@pytest.mark.parametrize(("period", "damping", "mass", "delay", "limit"), TABLE)
def test_a_spring_turns_unstable_at_its_exact_limit(
    period: float, damping: float, mass: float, delay: int, limit: float
) -> None:
    keys = {"mass_kg": mass, "viscous_n_s_per_m": damping, "force_delay_samples": delay}

    def spring(stiffness: float) -> Callable[[float, float], float]:
        return lambda x, v: -stiffness * x

    assert growth(keys, period, spring(0.999 * limit)) <= 1.0 + 1e-12
    assert growth(keys, period, spring(1.001 * limit)) > 1.0


@pytest.mark.parametrize("delay", [0, 1])
@pytest.mark.parametrize("mass", [0.1, 1.0])
@pytest.mark.parametrize("stiffness", [10.0, 3000.0])
def test_without_any_damping_every_sampled_spring_is_unstable(mass: float, delay: int, stiffness: float) -> None:
    assert growth({"mass_kg": mass, "force_delay_samples": delay}, T, lambda x, v: -stiffness * x) > 1.0 + 1e-7


# (delay, largest K in m/T^2, at B in m/T), and the ceiling of a pure damper in m/T
PEAKS = [(0, 0.68629, 0.8284, 2.0), (1, 0.14447, 0.425, 0.8284), (2, 0.06243, 0.291, 0.5359), (3, 0.035, 0.22, 0.3978)]


@pytest.mark.parametrize(("delay", "peak", "best", "ceiling"), PEAKS)
def test_a_digital_damper_carries_a_spring_up_to_its_peak_and_no_further(
    delay: int, peak: float, best: float, ceiling: float
) -> None:
    mass = 0.25
    keys = {"mass_kg": mass, "force_delay_samples": delay}

    def grows(stiffness: float, damping: float) -> bool:
        k, b = stiffness * mass / T**2, damping * mass / T
        return growth(keys, T, lambda x, v: -k * x - b * v) > 1.0 + 1e-12

    digits = 0.5e-5 if delay < 3 else 0.5e-3
    assert not grows(peak - 2 * digits, best)
    assert all(grows(peak + 2 * digits, best * share) for share in (0.8, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2))
    assert not grows(1e-9, ceiling - 2e-4)
    assert grows(1e-9, ceiling + 2e-4)


@pytest.mark.parametrize("share", [0.1, 0.3, 0.6, 0.8284, 1.2, 1.8])
def test_spring_and_damper_without_delay_follow_the_closed_form(share: float) -> None:
    """K < (2B/T)(1-u)/(1+u), u = BT/2m; its peak is 4 (sqrt 2 - 1)^2 m/T^2."""
    mass = 0.25
    b = share * mass / T
    limit = 2.0 * b / T * (1.0 - share / 2.0) / (1.0 + share / 2.0)
    assert limit <= 4.0 * (math.sqrt(2.0) - 1.0) ** 2 * mass / T**2 * (1.0 + 1e-12)
    for factor, stable in ((1.0 - 1e-6, True), (1.0 + 1e-6, False)):

        def force(x: float, v: float, k: float = factor * limit) -> float:
            return -k * x - b * v

        assert (growth({"mass_kg": mass}, T, force) <= 1.0) is stable


@pytest.mark.parametrize(("share", "calm"), [(0.10, False), (0.25, False), (0.45, False), (0.51, True)])
@pytest.mark.parametrize("damping_share", [1.05, 4.0])
def test_friction_stills_a_quantised_spring_from_half_a_step_of_its_force_on(
    share: float, calm: bool, damping_share: float
) -> None:
    """Abbott & Okamura 2005: f_c >= K resolution / 2 is necessary and sufficient; K <= 2b/T is the other half."""
    stiffness, step = 5000.0, 1e-5
    moved = []
    for bias in np.linspace(0.0, 1.0, 21):  # of a step's force: half of it sits between two steps
        mover = device(
            mass_kg=0.25,
            viscous_n_s_per_m=damping_share * stiffness * T / 2.0,
            coulomb_n=share * stiffness * step,
            resolution_m=step,
            hand={"force": {"profile": "constant", "newton": float(bias) * stiffness * step}},
            initial_velocity_m_per_s=0.02,
        )
        positions = []
        for tick in range(6000):
            mover.advance(-stiffness * mover.measured_m)
            if tick >= 5000:
                positions.append(mover.x_m)
        moved.append(max(positions) - min(positions))
    if calm:
        assert max(moved) == 0.0
    else:
        assert max(moved) > 1e-9


def test_a_held_spring_leaks_half_a_period_of_damping() -> None:
    """Over one bounce the wall gives back (kT/2) sum v^2 T more than it took: what alpha = kT/2 would dissipate."""
    stiffness = 3000.0
    mover = device(mass_kg=0.5, initial_position_m=1e-6, initial_velocity_m_per_s=-0.2)
    force = energy = motion = 0.0
    x = mover.measured_m
    touched = False
    for _ in range(500):
        mover.advance(force)
        moved = mover.measured_m - x
        energy -= force * moved
        if force != 0.0 or mover.measured_m < 0.0:
            motion += moved * moved / T
        x = mover.measured_m
        touched = touched or x < 0.0
        if touched and x >= 0.0:
            break
        force = -stiffness * min(0.0, x)
    # The samples that cross the surface belong to the bounce only in part: that is the tolerance.
    assert -energy / motion == pytest.approx(stiffness * T / 2.0, rel=0.02)


def test_the_identity_of_the_leak_is_exact_for_a_spring_that_holds_both_ways() -> None:
    stiffness = 3000.0
    mover = device(mass_kg=0.5, initial_position_m=0.003)
    energy = squares = 0.0
    first = x = mover.measured_m
    for _ in range(5000):
        force = -stiffness * x
        mover.advance(force)
        energy -= force * (mover.measured_m - x)
        squares += (mover.measured_m - x) ** 2
        x = mover.measured_m
    stored = 0.5 * stiffness * (x * x - first * first)
    assert energy == pytest.approx(stored - 0.5 * stiffness * squares, rel=1e-10)


def bounce_after_s(seconds: float, drop_m: float, stiffness: float, **keys: Any) -> float:
    """Peak to peak over the last 300 samples of pressing an undamped mass onto a wall [m]."""
    mover = device(initial_position_m=drop_m, **keys)
    positions = []
    for _ in range(round(seconds / T)):
        mover.advance(-stiffness * min(0.0, mover.measured_m))
        positions.append(mover.x_m)
    return max(positions[-300:]) - min(positions[-300:])


def test_the_uncontrolled_wall_of_the_paper_swings_as_far_as_the_exact_plant_says() -> None:
    """55.6 mm at 3 s from the wall, 84.1 mm after a 5 mm drop; semi-implicit Euler would show 3.3 mm, Euler 189."""
    hand = {"force": {"profile": "constant", "newton": -5}}
    assert bounce_after_s(3.0, 0.0, 3000.0, hand=hand) == pytest.approx(55.6e-3, abs=0.1e-3)
    assert bounce_after_s(3.0, 5e-3, 3000.0, hand=hand) == pytest.approx(84.1e-3, abs=0.1e-3)


@pytest.mark.parametrize("newton", [-1.0, -3.0, -6.0])
@pytest.mark.parametrize("drop_m", [0.0, 0.003, 0.01])
def test_the_omega7_model_holds_8_kn_per_m_alone_and_not_9(newton: float, drop_m: float) -> None:
    """The paper's native limit; at 8 a few counts of the quantiser go on, at 9 it swings when it arrives moving."""
    keys = {"model": "omega7", "hand": {"force": {"profile": "constant", "newton": newton}}}
    assert bounce_after_s(6.0, drop_m, 7000.0, **keys) < 6e-5
    assert bounce_after_s(6.0, drop_m, 8000.0, **keys) < 2e-4
    if drop_m > 0.0 and newton < -1.0:
        assert bounce_after_s(6.0, drop_m, 9000.0, **keys) > 2.5e-4
