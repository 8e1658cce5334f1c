"""The simulated device obeys mechanics: exactly between samples, with friction that really sticks."""

from __future__ import annotations

import itertools
import math
from decimal import Decimal
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from hapticd.simulation.plant import flow, sine, terms
from tests.examples import examples
from tests.simulation import exact

T = 1e-3
BARE = {"model": "paper-simulation"}


def device(period_s: float = T, **keys: Any) -> SimulatedDevice:
    return SimulatedDevice(SimulationOptions.model_validate({**BARE, **keys}), period_s)


def pressed(newton: float, **hand: Any) -> dict[str, Any]:
    return {"force": {"profile": "constant", "newton": newton}, **hand}


# --- the closed form -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("beta", [0.0, 1e-300, 1e-16, 1e-8, 1e-6, 1e-4, 1e-3, 1e-2, 0.3, 1.0, 7.0, 40.0, 1e3, 1e6])
@pytest.mark.parametrize("omega", [0.0, 1e-200, 1e-12, 1e-6, 1e-2, 0.25, 1.0, 3.0, 30.0])
@pytest.mark.parametrize("time", [1e-4, 1e-3, 0.01, 1e3])
def test_the_step_is_exact_for_any_damping_and_spring(beta: float, omega: float, time: float) -> None:
    """stability.md: the naive 1-a-βa has no correct digit left at β = 1e-8; 4 terms of a series fail at 1e-2."""
    decay, stiffness = beta / time, (omega / time) ** 2
    truth = exact.flow(decay, stiffness, time)
    found = flow(decay, stiffness, time)
    # An angle of omega radians is known to omega * 1e-16 at best.
    tolerance = Decimal(str(2e-14 * max(1.0, omega)))
    for value, true, scale in zip(found, truth, (1.0, min(time, 1.0), min(time * time, 1.0)), strict=True):
        # relative where the motion is monotone, relative to the undamped size where it oscillates or dies out
        size = max(abs(true), Decimal(scale) * truth_scale(beta, omega))
        assert abs(Decimal(value) - true) <= tolerance * size


def truth_scale(beta: float, omega: float) -> Decimal:
    """Below this share of t (or t^2, or 1) an oscillation may cross zero, and relative accuracy has no meaning."""
    if omega * 2.0 > beta and omega > 0.5:
        return Decimal(1.0 / omega**2)
    return Decimal("1e-16")


@pytest.mark.parametrize("damping", [-200.0, -1.0, 0.5, 2.0])
def test_negative_damping_grows_as_fast_as_it_must(damping: float) -> None:
    mover = device(viscous_n_s_per_m=damping, mass_kg=0.5, initial_velocity_m_per_s=0.1)
    for _ in range(100):
        mover.advance(0.0)
    assert mover.v_m_per_s == pytest.approx(0.1 * math.exp(-damping / 0.5 * 0.1), rel=1e-12)


def test_a_bare_mass_under_constant_force_falls_as_galileo_says() -> None:
    mover = device(mass_kg=0.5)
    for _ in range(1000):
        mover.advance(-5.0)
    assert mover.x_m == pytest.approx(-5.0, rel=1e-13)
    assert mover.v_m_per_s == pytest.approx(-10.0, rel=1e-13)


@pytest.mark.parametrize("mass", [1e-6, 0.05, 1e4])
@pytest.mark.parametrize("damping", [0.0, 1e-9, 2.0, 50.0])
@pytest.mark.parametrize("spring", [0.0, 1e-6, 400.0, 4e5])
def test_ten_short_periods_are_one_long_one(mass: float, damping: float, spring: float) -> None:
    """Exactness does not know how finely time is cut."""
    hand = pressed(-2.0, stiffness_n_per_m=spring)
    start = {"initial_position_m": 0.01, "initial_velocity_m_per_s": 0.3}
    coarse = device(T, mass_kg=mass, viscous_n_s_per_m=damping, hand=hand, **start)
    fine = device(T / 10, mass_kg=mass, viscous_n_s_per_m=damping, hand=hand, **start)
    for _ in range(10):
        coarse.advance(1.0)
        for _ in range(10):
            fine.advance(1.0)
    swing = math.sqrt(spring / mass) * 10 * T
    size = abs(coarse.x_m) + 0.01 + 0.3 * T
    assert coarse.x_m == pytest.approx(fine.x_m, abs=1e-13 * max(1.0, swing) * size)


def test_a_device_held_by_its_hand_in_balance_does_not_creep() -> None:
    mover = device(initial_position_m=0.01, viscous_n_s_per_m=1.0, hand=pressed(4.0, stiffness_n_per_m=400.0))
    for _ in range(10_000):
        mover.advance(0.0)
    assert mover.x_m == 0.01
    assert mover.v_m_per_s == 0.0


# --- Coulomb friction ------------------------------------------------------------------------------------------------


def test_friction_holds_any_force_up_to_its_own_for_ever() -> None:
    mover = device(coulomb_n=0.5, initial_position_m=0.003, hand=pressed(-0.2))
    for tick in range(20_000):
        mover.advance(0.7 if tick % 2 else -0.3)
        assert mover.x_m == 0.003
        assert mover.v_m_per_s == 0.0
    mover.advance(0.7000001)
    assert mover.v_m_per_s > 0.0


def test_a_sliding_device_stops_where_its_energy_is_used_up() -> None:
    """Its way s is m v^2 / 2 = f_c s, with the last period stopped in its middle and not at its end."""
    mover = device(mass_kg=0.5, coulomb_n=2.0, initial_velocity_m_per_s=0.1234)
    for _ in range(200):
        mover.advance(0.0)
    assert mover.v_m_per_s == 0.0
    assert mover.x_m == pytest.approx(0.5 * 0.5 * 0.1234**2 / 2.0, rel=1e-12)


def test_a_spring_with_friction_stops_off_centre_after_the_textbook_half_swings() -> None:
    """Each half swing loses 2 f_c / k of amplitude; it sticks once |x| <= f_c / k."""
    k, coulomb = 400.0, 0.5
    mover = device(mass_kg=0.2, coulomb_n=coulomb, initial_position_m=0.0107, hand={"stiffness_n_per_m": k})
    for _ in range(2000):
        mover.advance(0.0)
    amplitude = 0.0107
    side = 1
    while amplitude > coulomb / k:
        amplitude -= 2.0 * coulomb / k
        side = -side
    assert mover.v_m_per_s == 0.0
    assert mover.x_m == pytest.approx(side * amplitude, abs=1e-14)


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("damping", [0.7, 1.0, 30.0])
@pytest.mark.parametrize("spring", [1e4, 1e5])
def test_what_creeps_to_rest_within_a_period_rests_at_the_edge_of_friction(
    way: float, damping: float, spring: float
) -> None:
    """Overdamped it never swings, and the speed at the end of the period is rounded away, or to the other sign."""
    mover = device(0.01, mass_kg=1e-6, viscous_n_s_per_m=damping, coulomb_n=0.1, hand={"stiffness_n_per_m": spring})
    for _ in range(400):
        mover.advance(2.0 * way)
        assert 0.0 < mover.x_m * way <= 1.9 / spring * (1.0 + 1e-12)
    assert mover.x_m == pytest.approx(1.9 / spring * way, rel=1e-6)
    assert abs(mover.v_m_per_s) < 1e-12


@pytest.mark.parametrize("case", range(60))
def test_a_period_with_friction_is_the_one_that_an_event_integrator_finds(case: int) -> None:
    """Slides, stops, stops and turns, turns several times within one period."""
    random = np.random.default_rng(case)
    mass = float(10 ** random.uniform(-2, 0))
    coulomb = float(random.uniform(0.05, 1.0))
    damping = float(random.choice([0.0, 0.5, 5.0]))
    spring = float(random.choice([0.0, 100.0, mass * (float(random.uniform(0.5, 12.0)) / 0.01) ** 2]))
    force = float(random.uniform(-3, 3))
    period = 0.01
    v = float(random.choice([0.0, random.uniform(-1, 1) * coulomb * period / mass]))
    x = float(random.uniform(-1, 1)) * (2.0 / spring if spring else 1e-3)
    mover = device(
        period,
        mass_kg=mass,
        viscous_n_s_per_m=damping,
        coulomb_n=coulomb,
        initial_position_m=x,
        initial_velocity_m_per_s=v,
        hand={"stiffness_n_per_m": spring},
    )
    mover.advance(force)
    true_x, true_v = exact.period_with_friction(
        x, v, mass=mass, damping=damping, spring=spring, coulomb=coulomb, force=force, period=period
    )
    size = abs(x) + abs(v) * period + 3.0 / mass * period**2
    assert mover.x_m == pytest.approx(true_x, abs=1e-11 * size)
    assert mover.v_m_per_s == pytest.approx(true_v, abs=1e-10 * size / period)


@pytest.mark.parametrize(("coulomb", "spring"), [(0.0, 0.0), (0.0, 90.0), (0.08, 0.0), (0.08, 90.0)])
def test_a_second_against_a_wall_is_the_one_that_an_event_integrator_finds(coulomb: float, spring: float) -> None:
    """Bounces, slides and sticks, the force held between samples; the difference stays under a nanometre."""
    period = 4e-3
    mover = device(
        period,
        mass_kg=0.25,
        viscous_n_s_per_m=1.5,
        coulomb_n=coulomb,
        initial_position_m=0.01,
        hand=pressed(-0.8, stiffness_n_per_m=spring),
    )
    x, v = 0.01, 0.0
    worst = 0.0
    for _ in range(250):
        force = -400.0 * min(0.0, mover.x_m)
        mover.advance(force)
        x, v = exact.period_with_friction(
            x,
            v,
            mass=0.25,
            damping=1.5,
            spring=spring,
            coulomb=coulomb,
            force=-400.0 * min(0.0, x) - 0.8,
            period=period,
        )
        worst = max(worst, abs(mover.x_m - x))
    assert worst < 1e-11


def test_friction_only_ever_takes_energy() -> None:
    random = np.random.default_rng(7)
    mover = device(mass_kg=0.1, coulomb_n=0.3, viscous_n_s_per_m=0.1, hand={"stiffness_n_per_m": 5000.0})
    for _ in range(3000):
        force = float(random.normal(0.0, 1.0))
        x, v = mover.x_m, mover.v_m_per_s
        mover.advance(force)
        stored = 0.5 * 0.1 * (mover.v_m_per_s**2 - v**2) + 0.5 * 5000.0 * (mover.x_m**2 - x**2)
        assert stored <= force * (mover.x_m - x) + 1e-15


# --- actuator and sensor ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("delay", [0, 1, 2, 7, 64])
def test_a_delayed_force_arrives_that_many_periods_late_and_not_changed(delay: int) -> None:
    mover = device(force_delay_samples=delay)
    felt = []
    for tick in range(200):
        mover.advance(float(tick + 1))
        felt.append(mover.applied_n)
    assert felt == [0.0] * delay + [float(tick + 1) for tick in range(200 - delay)]


def test_the_actuator_saturates_at_its_limit_on_both_sides() -> None:
    mover = device(max_force_n=12.0)
    for command, felt in ((100.0, 12.0), (-100.0, -12.0), (11.5, 11.5), (-12.0, -12.0)):
        mover.advance(command)
        assert mover.applied_n == felt


def test_a_slow_actuator_gives_the_impulse_of_a_first_order_lag() -> None:
    """After a step of the command to 1 N the impulse is t - tau (1 - exp(-t / tau)), at every sample."""
    mover = device(bandwidth_hz=50.0, mass_kg=2.0)
    tau = 1.0 / (2.0 * math.pi * 50.0)
    for tick in range(1, 30):
        mover.advance(1.0)
        assert 2.0 * mover.v_m_per_s == pytest.approx(tick * T - tau * (1.0 - math.exp(-tick * T / tau)), rel=1e-12)


def test_the_sensor_rounds_to_the_nearest_step_and_ties_to_even() -> None:
    step = 2.0**-16
    for steps, shown in ((0.49, 0), (0.5, 0), (0.51, 1), (1.5, 2), (2.5, 2), (-0.5, 0), (-1.5, -2), (-2.51, -3)):
        mover = device(resolution_m=step, initial_position_m=steps * step)
        assert mover.measured_m == shown * step


def test_noise_has_the_asked_deviation_no_mean_no_memory_and_repeats_with_its_seed() -> None:
    def noise(seed: int, count: int = 20_000) -> np.ndarray[Any, Any]:
        mover = device(noise_m=1e-5, seed=seed)
        shown = []
        for _ in range(count):
            mover.advance(0.0)
            shown.append(mover.measured_m)
        return np.array(shown)

    first = noise(3)
    assert first.std() == pytest.approx(1e-5, rel=0.03)
    assert abs(first.mean()) < 4e-5 / math.sqrt(len(first))
    assert abs(np.corrcoef(first[:-1], first[1:])[0, 1]) < 0.03
    assert np.abs(first).max() <= 1e-5 * math.sqrt(12.0)
    assert (noise(3, 100) == first[:100]).all()
    assert abs(np.corrcoef(first, noise(4))[0, 1]) < 0.03


# --- the hand --------------------------------------------------------------------------------------------------------


def hand_forces(profile: dict[str, Any], ticks: int, period_s: float = T) -> list[float]:
    """What the hand really does to a free mass of 1 kg, from its change of velocity."""
    mover = device(period_s, mass_kg=1.0, hand={"force": profile})
    forces = []
    for _ in range(ticks):
        v = mover.v_m_per_s
        mover.advance(0.0)
        forces.append((mover.v_m_per_s - v) / period_s)
    return forces


def test_each_hand_profile_is_the_function_that_it_names() -> None:
    def expect(profile: dict[str, Any], function: Any) -> None:
        forces = hand_forces(profile, 1500)
        truth = [function(tick * T) for tick in range(1500)]
        assert forces == pytest.approx(truth, abs=1e-9)

    expect({"profile": "constant", "newton": -3}, lambda t: -3.0)
    expect({"profile": "step", "newton": -3, "from_newton": 1, "at_s": 0.2}, lambda t: -3.0 if t >= 0.2 - 1e-9 else 1.0)
    expect(
        {"profile": "ramp", "newton": -3, "from_newton": 1, "at_s": 0.2, "duration_s": 0.5},
        lambda t: float(np.interp(t, [0.2, 0.7], [1.0, -3.0])),
    )
    expect(
        {"profile": "sine", "newton": 2, "offset_newton": -1, "frequency_hz": 7.3},
        lambda t: -1.0 + 2.0 * math.sin(2 * math.pi * 7.3 * t),
    )
    expect(
        {"profile": "chirp", "newton": 2, "start_hz": 1, "end_hz": 21, "duration_s": 1},
        lambda t: 2.0 * math.sin(2 * math.pi * ((t + 10 * t * t) if t < 1 else (11 + 21 * (t - 1)))),
    )
    expect(
        {"profile": "press-and-release", "newton": -4, "release_newton": 1, "period_s": 0.8},
        lambda t: 1.0 - 5.0 * (0.5 - 0.5 * math.cos(2 * math.pi * t / 0.8)),
    )
    expect(
        {"profile": "recorded", "points": [[0.1, 1], [0.3, -2], [0.9, 5]]},
        lambda t: float(np.interp(t, [0.1, 0.3, 0.9], [1.0, -2.0, 5.0])),
    )
    expect(
        {"profile": "recorded", "points": [[0.0, 1], [0.25, -2], [0.5, 1]], "repeat": True},
        lambda t: float(np.interp((t + 1e-12) % 0.5, [0.0, 0.25, 0.5], [1.0, -2.0, 1.0])),
    )


def test_a_recorded_hand_is_read_from_a_file(tmp_path: Any) -> None:
    file = tmp_path / "hand.csv"
    file.write_text("t_s,force_n\n0.0,0.0\n0.1,-1.0\n")
    forces = hand_forces({"profile": "recorded", "file": str(file)}, 200)
    assert forces[50] == pytest.approx(-0.5)
    assert forces[150] == pytest.approx(-1.0)


@given(st.floats(-1e6, 1e6))
def test_sine_is_the_sine(turns: float) -> None:
    truth = math.sin(2.0 * math.pi * math.fmod(turns, 1.0))
    assert sine(turns) == pytest.approx(truth, abs=2e-15)


def test_the_hand_adds_its_mass_and_damping_to_the_device() -> None:
    together = device(mass_kg=0.2, viscous_n_s_per_m=1.0, hand=pressed(-1.0, mass_kg=0.3, damping_n_s_per_m=2.0))
    alone = device(mass_kg=0.5, viscous_n_s_per_m=3.0, hand=pressed(-1.0))
    for _ in range(100):
        together.advance(0.5)
        alone.advance(0.5)
    assert together.x_m == pytest.approx(alone.x_m, rel=1e-14)


def test_a_change_comes_at_the_first_period_at_or_after_its_time() -> None:
    mover = device(initial_velocity_m_per_s=1.0, mass_kg=0.5, changes=[{"at_s": 0.2, "viscous_n_s_per_m": 5.0}])
    for _ in range(200):
        mover.advance(0.0)
    assert mover.v_m_per_s == 1.0
    mover.advance(0.0)
    assert mover.v_m_per_s == pytest.approx(math.exp(-5.0 / 0.5 * T), rel=1e-13)


# --- terms that are not there ----------------------------------------------------------------------------------------


def test_a_term_that_is_not_there_is_not_executed() -> None:
    bare = device()._move.__code__
    full = device(
        coulomb_n=0.1,
        force_delay_samples=1,
        bandwidth_hz=100.0,
        max_force_n=1.0,
        hand=pressed(1.0, stiffness_n_per_m=1),
    )._move.__code__
    assert len(bare.co_code) < len(full.co_code) / 2
    assert not {"hand_force", "slide"} & set(bare.co_names)
    assert bare.co_filename == full.co_filename


NEUTRAL: list[dict[str, Any]] = [
    {"changes": [{"at_s": 1e6, "coulomb_n": 1.0}]},
    {"changes": [{"at_s": 1e6, "max_force_n": 1.0}]},
    {"changes": [{"at_s": 1e6, "hand_stiffness_n_per_m": 1.0}]},
]


@pytest.mark.parametrize("keys", NEUTRAL)
def test_a_term_that_is_there_but_zero_changes_no_bit(keys: dict[str, Any]) -> None:
    start: dict[str, Any] = {"initial_velocity_m_per_s": 0.37, "viscous_n_s_per_m": 1.7, "hand": pressed(-1.3)}
    assert terms(SimulationOptions.model_validate({**BARE, **keys})) != terms(SimulationOptions.model_validate(BARE))
    plain, loaded = device(**start), device(**start, **keys)
    for tick in range(2000):
        force = -3000.0 * min(0.0, plain.x_m) + 0.1 * (tick % 3)
        plain.advance(force)
        loaded.advance(force)
        assert (plain.x_m, plain.v_m_per_s, plain.measured_m) == (loaded.x_m, loaded.v_m_per_s, loaded.measured_m)


# --- anything at all -------------------------------------------------------------------------------------------------

small = st.floats(0.0, 1e3)
anything = st.fixed_dictionaries(
    {},
    optional={
        "mass_kg": st.floats(1e-9, 1e6),
        "viscous_n_s_per_m": st.floats(0.0, 1e9),
        "coulomb_n": st.just(0.0) | st.floats(1e-12, 1e6),
        "resolution_m": st.just(0.0) | st.floats(1e-12, 1.0),
        "noise_m": st.floats(0.0, 1.0),
        "seed": st.integers(0, 2**53),
        "max_force_n": st.floats(0.0, 1e6),
        "bandwidth_hz": st.just(0.0) | st.floats(1e-3, 1e9),
        "force_delay_samples": st.integers(0, 128),
        "initial_position_m": st.floats(-1e3, 1e3),
        "initial_velocity_m_per_s": st.floats(-1e3, 1e3),
        "hand": st.fixed_dictionaries(
            {
                "force": st.just({"profile": "press-and-release"})
                | st.just({"profile": "sine", "newton": 2, "frequency_hz": 9.9})
            },
            optional={"mass_kg": small, "damping_n_s_per_m": small, "stiffness_n_per_m": small},
        ),
    },
)


@examples(150)
@given(keys=anything, period=st.floats(1e-4, 1e-2), forces=st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=30))
def test_finite_goes_in_and_finite_comes_out(keys: dict[str, Any], period: float, forces: list[float]) -> None:
    try:
        mover = SimulatedDevice(SimulationOptions.model_validate(keys), period)
    except ValueError:
        # Only one thing is refused: a hand that swings many times within a period, where there is friction.
        assert keys["coulomb_n"] > 0.0
        assert keys["hand"]["stiffness_n_per_m"] > 0.0
        return
    limit = mover.options.max_force_n or math.inf
    for force in itertools.islice(itertools.cycle(forces), 30):
        mover.advance(force)
        assert math.isfinite(mover.x_m)
        assert math.isfinite(mover.v_m_per_s)
        assert math.isfinite(mover.measured_m)
        assert abs(mover.applied_n) <= limit
