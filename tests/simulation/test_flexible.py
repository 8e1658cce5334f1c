"""A force that comes within a period, and a handle that hangs on a spring: exact, and the same in every engine."""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from hapticd.config.loading import parse
from hapticd.config.walls import WallConfig
from hapticd.errors import ConfigError
from hapticd.offline.outcome import balance, hand_share
from hapticd.offline.simulate import simulate
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.driver import _safe_damping
from hapticd.simulation.options import Flexible, SimulationOptions
from hapticd_studies.boundaries import Loop, is_stable
from tests.examples import TIMES, examples
from tests.simulation import exact
from tests.simulation.both_ways import Case, by_the_daemon, by_the_kernel, difference
from tests.simulation.loops import any_case

Array = npt.NDArray[np.float64]

T = 1e-3
BARE = {"model": "paper-simulation"}


def device(period_s: float = T, **keys: Any) -> SimulatedDevice:
    return SimulatedDevice(SimulationOptions.model_validate({**BARE, **keys}), period_s)


def flow(equation: Array, push: Array, time_s: float, start: Array) -> Array:
    """Z' = A z + push from a start, by SciPy's matrix exponential."""
    count = len(equation)
    whole = np.zeros((count + 1, count + 1))
    whole[:count, :count], whole[:count, count] = equation, push
    moved: Array = expm(whole * time_s) @ np.append(start, 1.0)
    return moved[:count]


class TwoMasses:
    """Motor and handle as a book has them, (x1, v1, x2, v2), with forces that come late."""

    def __init__(self, options: SimulationOptions, period_s: float) -> None:
        flexible, hand = options.flexible, options.hand
        assert flexible is not None
        m1 = options.mass_kg * (1.0 - flexible.handle_share)
        m2 = options.mass_kg * flexible.handle_share
        reduced = m1 * m2 / (m1 + m2)
        k = (math.tau * flexible.frequency_hz) ** 2 * reduced
        c = 2.0 * flexible.damping_ratio * math.tau * flexible.frequency_hz * reduced
        b, kh, bh = options.viscous_n_s_per_m, hand.stiffness_n_per_m, hand.damping_n_s_per_m
        held = m2 + hand.mass_kg
        self.equation = np.array([
            [0.0, 1.0, 0.0, 0.0],
            [-k / m1, -(b + c) / m1, k / m1, c / m1],
            [0.0, 0.0, 0.0, 1.0],
            [k / held, c / held, -(k + kh) / held, -(c + bh) / held],
        ])  # fmt: skip
        self.motor, self.hand = np.array([0.0, 1.0 / m1, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0 / held])
        self.state = np.array([options.initial_position_m, options.initial_velocity_m_per_s] * 2)
        self.sensor = 0 if flexible.sensor == "motor" else 2
        self.period_s, self.late = period_s, options.force_delay_s / period_s
        self.forces = [0.0] * 10

    def advance(self, force_n: float, hand_n: float) -> tuple[float, float]:
        self.forces = [force_n, *self.forces]
        whole = math.floor(self.late + 1e-9)
        rest_s = max(0.0, self.late - whole) * self.period_s
        for force, time_s in ((self.forces[whole + 1], rest_s), (self.forces[whole], self.period_s - rest_s)):
            self.state = flow(self.equation, force * self.motor + hand_n * self.hand, time_s, self.state)
        return float(self.state[self.sensor]), float(self.state[self.sensor + 1])


# --- mechanics -------------------------------------------------------------------------------------------------------


@examples(30)
@given(
    mass=st.floats(0.01, 10.0),
    hertz=st.floats(0.5, 2000.0),
    share=st.floats(0.01, 0.99),
    ratio=st.floats(0.0, 3.0),
    sensor=st.sampled_from(["motor", "handle"]),
    late=st.sampled_from([0.0, 1.0]) | st.floats(0.0, 3.0),
    viscous=st.floats(0.0, 50.0),
    hand=st.fixed_dictionaries(
        {},
        optional={
            "mass_kg": st.floats(0.0, 1.0),
            "damping_n_s_per_m": st.floats(0.0, 20.0),
            "stiffness_n_per_m": st.floats(0.0, 1000.0),
        },
    ),
    forces=st.lists(st.floats(-10.0, 10.0), min_size=4, max_size=6),
)
def test_a_flexible_device_moves_as_the_exponential_of_its_equation(
    mass: float, hertz: float, share: float, ratio: float, sensor: str, late: float, viscous: float,
    hand: dict[str, float], forces: list[float],
) -> None:  # fmt: skip
    keys: dict[str, Any] = {
        "mass_kg": mass,
        "viscous_n_s_per_m": viscous,
        "force_delay_s": late * T,
        "flexible": {"frequency_hz": hertz, "handle_share": share, "damping_ratio": ratio, "sensor": sensor},
        "initial_position_m": 0.01,
        "initial_velocity_m_per_s": -0.2,
        "hand": {**hand, "force": {"profile": "constant", "newton": -2.0}},
    }
    mover = device(**keys)
    truth = TwoMasses(mover.options, T)
    for force in forces:
        mover.advance(force)
        x, v = truth.advance(force, -2.0)
        light = min(share, 1.0 - share) * mass
        size = 12.0 / light * T
        assert mover.x_m == pytest.approx(x, abs=1e-11 * (0.01 + size * T))
        assert mover.v_m_per_s == pytest.approx(v, abs=1e-10 * (0.2 + size))


@examples(30)
@given(
    mass=st.floats(0.01, 10.0),
    viscous=st.floats(-5.0, 50.0),
    spring=st.just(0.0) | st.floats(0.0, 1e5),
    late=st.floats(0.0, 3.0),
    forces=st.lists(st.floats(-10.0, 10.0), min_size=4, max_size=6),
)
def test_a_late_force_acts_from_its_instant_on(
    mass: float, viscous: float, spring: float, late: float, forces: list[float]
) -> None:
    keys: dict[str, Any] = {
        "viscous_n_s_per_m": viscous,
        "hand": {"stiffness_n_per_m": spring},
        "initial_position_m": 0.01,
    }
    mover = device(mass_kg=mass, force_delay_s=late * T, **keys)
    equation, push = np.array([[0.0, 1.0], [-spring / mass, -viscous / mass]]), np.array([0.0, 1.0 / mass])
    whole, state, sent = math.floor(late + 1e-9), np.array([0.01, 0.0]), [0.0] * 10
    for force in forces:
        mover.advance(force)
        sent = [force, *sent]
        rest_s = max(0.0, late - whole) * T
        for newton, time_s in ((sent[whole + 1], rest_s), (sent[whole], T - rest_s)):
            state = flow(equation, newton * push, time_s, state)
        assert mover.x_m == pytest.approx(state[0], abs=1e-12 * (0.01 + 10.0 / mass * T * T))
        assert mover.v_m_per_s == pytest.approx(state[1], abs=1e-11 * (10.0 + 10.0 / mass * T))
        share = rest_s / T
        assert mover.applied_n == pytest.approx(share * sent[whole + 1] + (1.0 - share) * sent[whole], abs=1e-12)


@pytest.mark.parametrize("case", range(12))
def test_with_friction_a_late_force_is_the_one_that_an_event_integrator_finds(case: int) -> None:
    """Two pieces a period, either with standstills in it."""
    dice = np.random.default_rng(case)
    values = {"damping": float(dice.choice([0.0, 2.0])), "coulomb": float(dice.uniform(0.1, 0.6)), "mass": 0.05}
    values["spring"] = float(dice.choice([0.0, 300.0]))
    late_s, period_s = float(dice.uniform(1e-4, 3.9e-3)), 4e-3
    mover = device(
        period_s,
        mass_kg=values["mass"],
        viscous_n_s_per_m=values["damping"],
        coulomb_n=values["coulomb"],
        force_delay_s=late_s,
        hand={"stiffness_n_per_m": values["spring"]},
    )
    x = v = before = 0.0
    for force in dice.uniform(-1.0, 1.0, 12).tolist():
        mover.advance(force)
        x, v = exact.period_with_friction(x, v, force=before, period=late_s, **values)
        x, v = exact.period_with_friction(x, v, force=force, period=period_s - late_s, **values)
        before = force
        assert mover.x_m == pytest.approx(x, abs=1e-10)
        assert mover.v_m_per_s == pytest.approx(v, abs=1e-8)


@pytest.mark.parametrize("keys", [{}, {"coulomb_n": 0.3}, {"flexible": {"frequency_hz": 90, "handle_share": 0.4}}])
def test_whole_periods_of_delay_are_samples_of_delay(keys: dict[str, Any]) -> None:
    by_time, by_samples = device(force_delay_s=2e-3, **keys), device(force_delay_samples=2, **keys)
    for tick in range(50):
        for mover in (by_time, by_samples):
            mover.advance(math.sin(0.4 * tick))
        assert by_time.x_m == by_samples.x_m


def test_a_handle_on_a_hard_spring_is_part_of_a_rigid_device() -> None:
    spring = {"frequency_hz": 5e4, "handle_share": 0.3, "damping_ratio": 0.7}
    rigid, bends = (
        device(mass_kg=0.3, viscous_n_s_per_m=2.0, hand={"mass_kg": 0.1, "stiffness_n_per_m": 300.0}, flexible=one)
        for one in (None, spring)
    )
    for tick in range(300):
        for mover in (rigid, bends):
            mover.advance(math.sin(0.1 * tick))
    assert bends.x_m == pytest.approx(rigid.x_m, rel=1e-4)


def test_with_free_ends_it_swings_at_its_frequency_and_dies_out_at_its_ratio() -> None:
    mover = device(flexible={"frequency_hz": 40.0, "handle_share": 0.25, "damping_ratio": 0.03})
    mover.advance(100.0)
    stretches = []
    for _ in range(1000):
        mover.advance(0.0)
        stretches.append(mover.state.stretch_m)
    found = np.array(stretches)
    down = np.flatnonzero((found[:-1] > 0.0) & (found[1:] <= 0.0))
    at = down + found[down] / (found[down] - found[down + 1])
    assert 1.0 / (np.diff(at).mean() * T) == pytest.approx(40.0 * math.sqrt(1.0 - 0.03**2), rel=1e-4)
    peaks = [found[a:b].max() for a, b in itertools.pairwise(down)]
    ratio = math.tau * 0.03 / math.sqrt(1.0 - 0.03**2)
    assert math.log(peaks[0] / peaks[20]) / 20.0 == pytest.approx(ratio, rel=2e-2)


# --- one model in all engines ----------------------------------------------------------------------------------------


def bending_case(seed: int) -> Case:
    """A loop of the wide family, on a device that bends, or whose force comes within a period, or both."""
    case, dice = any_case("awkward", seed), random.Random(f"bending {seed}")
    before = case.point.device
    keys: dict[str, Any] = {"bandwidth_hz": 0.0, "integrator": "exact", "substeps": 1}
    if seed % 3 != 1:
        keys["force_delay_s"] = dice.uniform(0.0, 2.5) * case.point.period_s
    if seed % 3 != 0:
        keys["flexible"] = Flexible(
            frequency_hz=dice.uniform(20.0, 400.0),
            handle_share=dice.uniform(0.05, 0.95),
            damping_ratio=dice.choice([0.0, 0.02, 0.5]),
            sensor=dice.choice(["motor", "handle"]),
        )
        kept = [one.model_copy(update={"coulomb_n": None}) for one in before.changes]
        keys |= {"coulomb_n": 0.0, "changes": tuple(one for one in kept if one.values())}
    options = SimulationOptions.model_validate(before.model_copy(update=keys).model_dump())
    return replace(case, point=replace(case.point, device=options))


def test_the_interpreted_kernel_is_the_tick_to_the_last_bit() -> None:
    """With friction, a hand that changes, steps, noise and limits; test_batch.py has machine code."""
    long = 0
    for seed in range(12 * TIMES):
        case = bending_case(seed)
        daemon = by_the_daemon(case)
        assert difference(case, by_the_kernel(case), daemon) == "", seed
        long += len(daemon.rows) > 100
    assert long > 8


# --- what a run and a driver say of it -------------------------------------------------------------------------------


@pytest.mark.parametrize("sensor", ["motor", "handle"])
def test_a_press_rests_where_it_is_said_to(sensor: str) -> None:
    keys = {
        "resolution_m": 0.0,
        "flexible": {"frequency_hz": 25.0, "handle_share": 0.3, "damping_ratio": 0.3, "sensor": sensor},
        "hand": {
            "force": {"profile": "constant", "newton": -3.0},
            "stiffness_n_per_m": 300.0,
            "damping_n_s_per_m": 10.0,
        },
    }
    options = SimulationOptions.model_validate(keys)
    at = balance(options, [WallConfig(stiffness_n_per_m=800.0)])
    mover = SimulatedDevice(options, T)
    for _ in range(20_000):
        mover.advance(-800.0 * min(0.0, mover.x_m))
    assert mover.x_m == pytest.approx(at.x_m, rel=1e-9)
    assert (hand_share(options) < 0.9) == (sensor == "motor")


@pytest.mark.parametrize("sensor", ["motor", "handle"])
@pytest.mark.parametrize("hertz", [30.0, 90.0, 150.0, 260.0, 430.0])
@pytest.mark.parametrize("late", [0.0, 0.6, 1.0])
def test_twice_the_damping_that_is_declared_safe_shakes_no_mode(sensor: str, hertz: float, late: float) -> None:
    flexible = {"frequency_hz": hertz, "handle_share": 0.4, "damping_ratio": 0.01, "sensor": sensor}
    options = SimulationOptions.model_validate({**BARE, "flexible": flexible, "force_delay_s": late * T})
    safe = _safe_damping(options, T)
    assert 0.0 < safe <= _safe_damping(options.model_copy(update={"flexible": None}), T)
    loop = Loop(options.mass_kg, 0.01, T, 2.0 * safe, late_s=late * T, flexible=options.flexible)
    assert is_stable(loop, 1e-3)


REFUSED = [
    ("force_delay_s = -0.001", "device.options.force_delay_s = -0.001"),
    ("force_delay_s = 0.2", "force_delay_s = 0.2: must be at most 128 periods, 0.128 s"),
    ("force_delay_s = 0.0005\nbandwidth_hz = 300", "force_delay_s needs bandwidth_hz = 0"),
    ('force_delay_s = 0.0005\nintegrator = "rk4"', 'force_delay_s is stepped exactly: needs integrator = "exact"'),
    ("force_delay_s = 0.0005\naccuracy = { position_m = 1e-6 }", "force_delay_s is stepped exactly"),
    ("force_delay_s = 0.0005\naxes = 3", "force_delay_s needs axes = 1"),
    ("flexible = { frequency_hz = 150 }", "device.options.flexible.handle_share"),
    ("flexible = { frequency_hz = 150, handle_share = 1.2 }", "device.options.flexible.handle_share = 1.2"),
    ("flexible = { frequency_hz = 150, handle_share = 0.3 }\ncoulomb_n = 0.1", "flexible needs coulomb_n = 0"),
    ("flexible = { frequency_hz = 150, handle_share = 0.3 }\nbandwidth_hz = 300", "flexible needs bandwidth_hz = 0"),
]


@pytest.mark.parametrize(("lines", "expected"), REFUSED)
def test_what_cannot_be_stepped_exactly_is_refused_by_its_key(lines: str, expected: str) -> None:
    text = f'[device]\ndriver = "loopback"\n[device.options]\n{lines}\n[[scene.walls]]\nstiffness_n_per_m = 2000.0\n'
    with pytest.raises(ConfigError) as refused:
        simulate(parse(text, "lab.toml"), 0.01)
    assert expected in str(refused.value)
