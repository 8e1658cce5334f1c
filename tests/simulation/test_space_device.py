"""The simulated device with several axes, against independent solutions of its equations of motion."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from hapticd.simulation.space import linkage
from hapticd.simulation.space.device import SpatialDevice

PERIOD_S = 1e-3
MATRIX = [[0.3, 0.05, -0.02], [0.05, 0.2, 0.03], [-0.02, 0.03, 0.25]]
HAND = {"stiffness_n_per_m": [300.0, 200.0, 100.0], "damping_n_s_per_m": [2.0, 1.0, 3.0], "mass_kg": [0.1, 0.0, 0.2]}


def device(space: dict[str, Any] | None = None, **keys: Any) -> SpatialDevice:
    options = {"model": "paper-simulation", "axes": 3, **keys, "space": space or {}}
    return SpatialDevice(SimulationOptions.model_validate(options), PERIOD_S)


def forces(seed: int, ticks: int) -> list[list[float]]:
    draw = np.random.default_rng(seed)
    return [list(map(float, row)) for row in draw.normal(0.0, 3.0, (ticks, 3))]


def test_axes_by_themselves_are_one_axis_devices_to_the_last_bit() -> None:
    keys = {"viscous_n_s_per_m": 4.0, "coulomb_n": 0.2, "resolution_m": 1e-5, "max_force_n": 5.0, "bandwidth_hz": 80.0}
    space = {"mass_kg": [0.2, 0.3, 0.4], "position_m": [0.01, -0.02, 0.0], "force_delay_samples": [0, 1, 2]}
    whole = device(space, **keys)
    alone = [
        SimulatedDevice(
            SimulationOptions.model_validate(
                {"model": "paper-simulation", "mass_kg": mass, "initial_position_m": at, "force_delay_samples": late}
                | keys
            ),
            PERIOD_S,
        )
        for mass, at, late in ((0.2, 0.01, 0), (0.3, -0.02, 1), (0.4, 0.0, 2))
    ]
    for force in forces(1, 500):
        whole.advance(force)
        for one, newton in zip(alone, force, strict=True):
            one.advance(newton)
        assert whole.position_m == tuple(one.x_m for one in alone)
        assert whole.measured_m == [one.measured_m for one in alone]


def test_a_mass_matrix_is_stepped_as_the_matrix_exponential_says() -> None:
    one = device({"mass_matrix_kg": MATRIX, "hand": HAND, "velocity_m_per_s": [0.1, -0.2, 0.05]}, viscous_n_s_per_m=4.0)
    mass = np.array(MATRIX) + np.diag(HAND["mass_kg"])
    inverse = np.linalg.inv(mass)
    rate = np.zeros((9, 9))
    rate[:3, 3:6] = np.eye(3)
    rate[3:6, :3] = -inverse @ np.diag(HAND["stiffness_n_per_m"])
    rate[3:6, 3:6] = -inverse @ np.diag([4.0 + b for b in HAND["damping_n_s_per_m"]])
    rate[3:6, 6:] = inverse
    after = expm(rate * PERIOD_S)
    state = np.array([0.0, 0.0, 0.0, 0.1, -0.2, 0.05])
    for force in forces(2, 1000):
        one.advance(force)
        state = after[:6, :6] @ state + after[:6, 6:] @ force
        assert one.position_m == pytest.approx(state[:3], abs=1e-12)
        assert one.velocity_m_per_s == pytest.approx(state[3:], abs=1e-10)


def test_a_matrix_with_nothing_beside_its_diagonal_is_axes_by_themselves() -> None:
    coupled = device({"mass_matrix_kg": [[0.2, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.4]], "hand": HAND})
    alone = device({"mass_kg": [0.2, 0.3, 0.4], "hand": HAND})
    for force in forces(3, 500):
        coupled.advance(force)
        alone.advance(force)
    assert coupled.position_m == pytest.approx(alone.position_m, abs=1e-12)


def test_a_delta_linkage_weighs_what_its_arms_say() -> None:
    """Against the turn of each arm found by solving |platform - elbow| = rod, and its slope by differences."""

    def turns(at: np.ndarray[Any, Any]) -> list[float]:
        found = []
        for arm in range(3):
            angle = 2.0 * np.pi * arm / 3.0
            turn = np.array(
                [[np.cos(angle), np.sin(angle), 0.0], [-np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]]
            )
            p = turn @ at + [-linkage.OFFSET_M, 0.0, linkage.MIDDLE_M]

            def off(q: float, p: np.ndarray[Any, Any] = p) -> float:
                elbow = linkage.ARM_M * np.array([np.cos(q), 0.0, np.sin(q)])
                return float(np.linalg.norm(p - elbow) - linkage.ROD_M)

            low, high = np.arctan2(p[2], p[0]) - np.pi, np.arctan2(p[2], p[0])
            for _ in range(200):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if off(middle) > 0.0 else (low, middle)
            found.append(0.5 * (low + high))
        return found

    for at in itertools.product((-0.06, 0.0, 0.05), (-0.04, 0.06), (-0.05, 0.03)):
        step = 1e-6
        slopes = np.array(
            [
                (np.array(turns(np.array(at) + step * e)) - turns(np.array(at) - step * e)) / (2.0 * step)
                for e in np.eye(3)
            ]
        ).T
        assert np.array(linkage.jacobian(*at)) == pytest.approx(slopes, rel=1e-4, abs=1e-4)
        matrix = np.array(linkage.mass_matrix(0.25, (0.0, 0.0, 0.0), *at))
        assert matrix == pytest.approx(matrix.T)
        assert np.linalg.eigvalsh(matrix).min() > 0.125
    middle = linkage.mass_matrix(0.25, (0.0, 0.0, 0.0), 0.0, 0.0, 0.0)
    assert sum(middle[i][i] for i in range(3)) == pytest.approx(3 * 0.25)


def test_a_hand_traces_its_circle() -> None:
    """The held force of a moving rest point, against the equation with the force held as well."""
    aim = {"path": "circle", "centre_m": [0.0, 0.01, 0.0], "radius_m": 0.02, "about": "z", "frequency_hz": 2.0}
    one = device(
        {"hand": {"aim": aim, "stiffness_n_per_m": [400.0] * 3, "damping_n_s_per_m": [5.0] * 3}, "mass_kg": [0.2] * 3}
    )
    state = np.zeros(6)
    for tick in range(400):
        turn = 2.0 * np.pi * 2.0 * tick * PERIOD_S
        rest = np.array([0.02 * np.cos(turn), 0.01 + 0.02 * np.sin(turn), 0.0])

        def slope(_t: float, z: np.ndarray[Any, Any], rest: np.ndarray[Any, Any] = rest) -> np.ndarray[Any, Any]:
            return np.concatenate([z[3:], (400.0 * (rest - z[:3]) - 5.0 * z[3:]) / 0.2])

        state = solve_ivp(slope, (0.0, PERIOD_S), state, rtol=1e-10, atol=1e-12).y[:, -1]
        one.advance([0.0, 0.0, 0.0])
    assert one.position_m == pytest.approx(state[:3], abs=1e-9)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"space": {"mass_kg": [0.1, 0.2]}}, "has 2 elements for 3 axes"),
        ({"space": {"mass_matrix_kg": [[0.1, 0.2, 0.0], [0.2, 0.1, 0.0], [0.0, 0.0, 0.1]]}}, "positive definite"),
        ({"space": {"mass_matrix_kg": [[0.1, 0.0], [0.0, 0.1]]}}, "three rows of three"),
        ({"space": {"linkage": "delta"}, "coulomb_n": 0.1}, "no Coulomb friction"),
        ({"initial_position_m": 0.1}, "space.position_m"),
        ({"hand": {"force": {"profile": "constant", "newton": -1.0}}}, "space.hand.force"),
        ({"axes": 1, "space": {"mass_kg": [0.1, 0.1, 0.1]}}, "needs axes = 2 or 3"),
        ({"axes": 2, "space": {"linkage": "delta"}}, "needs axes = 3"),
        (
            {
                "space": {
                    "hand": {
                        "force": {"profile": "tap", "newton": [0.0, 0.0, -1.0]},
                        "aim": {"path": "line", "from_m": [0.0] * 3, "to_m": [0.0, 0.0, 0.1]},
                        "stiffness_n_per_m": [1.0, 1.0, 1.0],
                    }
                }
            },
            "both change along z",
        ),
    ],
)
def test_what_cannot_be_is_said_in_one_line(keys: dict[str, Any], says: str) -> None:
    with pytest.raises((ValidationError, ValueError), match=says):
        device(**keys)
