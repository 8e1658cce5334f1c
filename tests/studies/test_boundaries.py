"""The analytic limits are where published closed forms and the simulated loop say they are."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from hapticd import plugins
from hapticd.config.walls import WallConfig
from hapticd.simulation.batch import Batch, Point
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import Flexible, SimulationOptions
from hapticd_studies import boundaries
from hapticd_studies.boundaries import Loop

Array = npt.NDArray[np.float64]

T = 1e-3
NONE = plugins.law("none")


@pytest.mark.parametrize(
    ("period_s", "damping", "mass", "prompt", "late"),
    [
        (1e-4, 5.0, 0.1, 100083.0, 33380.0),
        (1e-3, 1.0, 0.25, 2001.3, 667.4),
        (1e-3, 4.0, 0.25, 8021.0, 2678.0),
        (1e-2, 5.0, 0.1, 1090.5, 373.2),
    ],
)
def test_a_spring_alone_has_the_published_limits(
    period_s: float, damping: float, mass: float, prompt: float, late: float
) -> None:
    assert boundaries.spring_limit(mass, damping, period_s, 0) == pytest.approx(prompt, rel=1e-4)
    assert boundaries.spring_limit(mass, damping, period_s, 1) == pytest.approx(late, rel=2e-4)


@pytest.mark.parametrize("delay", [0, 1])
@pytest.mark.parametrize("mass", [0.05, 0.25, 2.0])
@pytest.mark.parametrize("damping", [0.5, 5.0, 60.0])
def test_the_roots_cross_the_circle_where_the_closed_form_says(delay: int, mass: float, damping: float) -> None:
    closed = boundaries.spring_limit(mass, damping, T, delay)
    assert boundaries.linear_limit(Loop(mass, damping, T, delay_samples=delay)) == pytest.approx(closed, rel=1e-8)


@pytest.mark.parametrize("damping", [1.0, 50.0, 207.0, 480.0])
def test_a_digital_damper_has_its_closed_form(damping: float) -> None:
    loop = Loop(0.25, 0.0, T, wall_damping_n_s_per_m=damping)
    assert boundaries.stable_limit(loop) == boundaries.damper_limit(0.25, damping, T)
    assert boundaries.linear_limit(loop) == pytest.approx(boundaries.damper_limit(0.25, damping, T), rel=1e-9)


@pytest.mark.parametrize("delay", [0, 1, 2, 3])
def test_no_wall_damping_does_better_than_the_peak(delay: int) -> None:
    limits = [boundaries.linear_limit(Loop(1.0, 0.0, 1.0, b, delay)) for b in np.linspace(0.02, 1.2, 119)]
    peak = boundaries.damper_peak(1.0, 1.0, delay)
    assert max(limits) == pytest.approx(peak, rel=2e-3)
    assert max(limits) <= peak * (1.0 + 1e-9)


@pytest.mark.parametrize(
    ("damping", "wall", "delay", "limit"),
    [(1.0, 5.0, 0, 11771.0), (1.0, 5.0, 1, 3916.0), (0.5, 10.0, 1, 6692.0), (5.0, 5.0, 1, 6557.0)],
)
def test_damped_walls_on_damped_devices_have_the_tabled_limits(
    damping: float, wall: float, delay: int, limit: float
) -> None:
    assert boundaries.stable_limit(Loop(0.25, damping, T, wall, delay)) == pytest.approx(limit, rel=1e-4)


def test_nothing_stabilises_what_dissipates_nothing_or_is_damped_too_much() -> None:
    assert boundaries.stable_limit(Loop(0.25, 0.0, T)) == 0.0
    assert boundaries.stable_limit(Loop(0.25, 0.0, T, delay_samples=2)) == 0.0
    assert boundaries.stable_limit(Loop(0.25, 1.0, T, wall_damping_n_s_per_m=600.0)) == 0.0


LOOPS: dict[str, dict[str, Any]] = {
    "spring": {},
    "spring, one sample late": {"delay": 1},
    "spring, three samples late": {"delay": 3},
    "damped wall": {"wall": 20.0},
    "damped wall, one sample late": {"wall": 20.0, "delay": 1},
    "active wall": {"wall": -1.0},
    "braked by a hand": {"hand": {"damping_n_s_per_m": 5.0}},
    "held by a hand": {"wall": 8.0, "hand": {"mass_kg": 0.1, "damping_n_s_per_m": 2.0, "stiffness_n_per_m": 400.0}},
}


@pytest.mark.parametrize("name", LOOPS)
def test_the_simulated_loop_rings_down_below_the_limit_and_up_above_it(name: str) -> None:
    keys = LOOPS[name]
    hand = keys.get("hand", {})
    loop = Loop(
        0.25 + hand.get("mass_kg", 0.0),
        2.0,
        T,
        wall_damping_n_s_per_m=keys.get("wall", 0.0),
        delay_samples=keys.get("delay", 0),
        hand_n_per_m=hand.get("stiffness_n_per_m", 0.0),
        hand_n_s_per_m=hand.get("damping_n_s_per_m", 0.0),
    )
    limit = boundaries.stable_limit(loop)
    early_m, late_m = (span_m(duration_s, 0.95 * limit, **keys) for duration_s in (1.0, 3.0))
    assert late_m < 0.9 * early_m
    early_m, late_m = (span_m(duration_s, 1.05 * limit, **keys) for duration_s in (1.0, 3.0))
    assert late_m > 1.1 * early_m


def span_m(
    duration_s: float, stiffness: float, wall: float = 0.0, delay: int = 0, hand: dict[str, float] | None = None
) -> float:
    """Span of the position at the end, starting where hand and springs balance, deep in the wall."""
    newton = 5.0
    held = hand or {}
    balance_m = -newton / (stiffness + held.get("stiffness_n_per_m", 0.0))
    device = SimulationOptions.model_validate(
        {
            "viscous_n_s_per_m": 2.0,
            "resolution_m": 0.0,
            "max_force_n": 0.0,
            "force_delay_samples": delay,
            "initial_position_m": balance_m,
            "hand": {"force": {"newton": -newton, "profile": "constant"}, **held},
        }
    )
    config = WallConfig(stiffness_n_per_m=stiffness, damping_n_s_per_m=wall)
    result = Batch(NONE, [Point(device, config, NONE.Params())], duration_s, 0.2, ledger=False).run_interpreted()
    return float(result.peak_to_peak_m[0])


def test_passivity_asks_for_more_than_stability() -> None:
    for loop in (Loop(0.25, 4.4, T), Loop(0.25, 4.4, T, 2.0), Loop(0.25, 4.4, T, delay_samples=1)):
        assert 0.0 < boundaries.passive_limit(loop) < boundaries.stable_limit(loop)
    assert boundaries.passive_limit(Loop(0.25, 4.0, T)) == pytest.approx(8000.0)
    assert boundaries.passive_limit(Loop(0.25, 4.0, T, delay_samples=1)) == pytest.approx(8000.0 / 3.0)
    assert math.isnan(boundaries.passive_limit(Loop(0.25, 4.0, T, 1.0, 1)))


def test_what_is_passive_for_any_operator_does_not_count_on_the_hand_of_one() -> None:
    for limit in (boundaries.passive_limit, boundaries.quantised_passive_limit):
        alone, held = (Loop(0.25, 4.0, T, coulomb_n=0.1, resolution_m=1e-5, hand_n_s_per_m=hand) for hand in (0.0, 5.0))
        assert limit(held) == limit(alone) == pytest.approx(8000.0)
        assert boundaries.stable_limit(held) > 2.0 * boundaries.stable_limit(alone)


def test_quantisation_is_passive_from_the_friction_on_that_abbott_and_okamura_give() -> None:
    """5 kN/m, steps of 10 um: with 0.1 K step of friction some hand force starts a limit cycle, with 0.5 none does."""
    stiffness, step_m = 5000.0, 1e-5
    enough_n = 0.5 * stiffness * step_m
    loop = Loop(0.25, 5.0, T, coulomb_n=enough_n, resolution_m=step_m)
    assert boundaries.quantised_passive_limit(loop) == pytest.approx(stiffness)
    assert cycle_m(stiffness, step_m, 0.1 * stiffness * step_m) > 1e-6
    assert cycle_m(stiffness, step_m, enough_n * 1.001) == 0.0


def cycle_m(stiffness: float, step_m: float, friction_n: float) -> float:
    """Largest span that is left after 20 s, over hand forces within one step."""
    points = []
    for share in np.linspace(0.0, 1.0, 24, endpoint=False):
        newton = 5.0 + share * stiffness * step_m
        device = SimulationOptions.model_validate(
            {
                "viscous_n_s_per_m": 5.0,
                "coulomb_n": friction_n,
                "resolution_m": step_m,
                "max_force_n": 0.0,
                "initial_position_m": -newton / stiffness,
                "initial_velocity_m_per_s": 0.01,
                "hand": {"force": {"newton": -newton, "profile": "constant"}},
            }
        )
        points.append(Point(device, WallConfig(stiffness_n_per_m=stiffness), NONE.Params()))
    result = Batch(NONE, points, 20.0, 1.0, ledger=False).run()
    return float(result.peak_to_peak_m.max())


def test_without_friction_or_steps_the_quantised_limit_is_silent() -> None:
    assert math.isnan(boundaries.quantised_passive_limit(Loop(0.25, 4.0, T, resolution_m=1e-5)))
    assert math.isnan(boundaries.quantised_passive_limit(Loop(0.25, 4.0, T, coulomb_n=0.1)))


@pytest.mark.parametrize(
    ("late", "limit"),
    [(0.1, 7353.0), (0.25, 5884.0), (0.5, 4416.0), (0.75, 3535.0), (1.0, 2948.0), (1.5, 2214.0), (2.0, 1773.0)],
)
def test_a_force_that_comes_late_by_any_part_of_a_period_has_the_tabled_limits(late: float, limit: float) -> None:
    loop = Loop(0.25, 4.4, T, late_s=late * T)
    assert boundaries.stable_limit(loop) == pytest.approx(limit, abs=0.6)
    assert boundaries.passive_limit(loop) == pytest.approx(4.4 / (0.5 + late) / T)
    whole = Loop(0.25, 4.4, T, delay_samples=math.floor(late), late_s=(late - math.floor(late)) * T)
    assert boundaries.stable_limit(whole) == pytest.approx(boundaries.stable_limit(loop), rel=1e-9)


@pytest.mark.parametrize(
    ("delay", "hertz", "ratio", "damping"),
    [(0, 120, 0.01, 315), (0, 200, 0.03, 251), (0, 400, 0.01, 63), (1, 120, 0.03, 58), (1, 300, 0.03, 131)],
)
def test_a_flexible_handle_bites_damping_where_the_table_says(
    delay: int, hertz: float, ratio: float, damping: int
) -> None:
    flexible = Flexible(frequency_hz=hertz, handle_share=0.3, damping_ratio=ratio)

    def stable(wall: float) -> bool:
        return boundaries.is_stable(Loop(0.25, 4.4, T, wall, delay, flexible=flexible), 12000.0)

    assert stable(damping - 0.5)
    assert not stable(damping + 1.5)


@pytest.mark.parametrize("late", [0.0, 0.3, 1.6])
@pytest.mark.parametrize("sensor", ["motor", "handle"])
def test_a_flexible_loop_turns_unstable_where_the_model_itself_does(late: float, sensor: str) -> None:
    """Eigenvalues of the map that the simulated device shows, one state after the other set to 1."""
    flexible = {"frequency_hz": 90.0, "handle_share": 0.4, "damping_ratio": 0.02, "sensor": sensor}
    hand = {"mass_kg": 0.05, "damping_n_s_per_m": 1.0, "stiffness_n_per_m": 200.0}
    keys = {"model": "paper-simulation", "mass_kg": 0.25, "viscous_n_s_per_m": 3.0, "force_delay_s": late * T}
    options = SimulationOptions.model_validate({**keys, "flexible": flexible, "hand": hand})
    loop = Loop(
        0.3, 3.0, T, hand_n_per_m=200.0, hand_n_s_per_m=1.0, hand_kg=0.05, late_s=late * T, flexible=options.flexible
    )
    limit = boundaries.stable_limit(loop)
    whole = math.floor(late)

    def step(unit: Array, stiffness: float) -> Array:
        mover = SimulatedDevice(options, T)
        state = mover.state
        state.x_m, state.v_m_per_s, state.stretch_m, state.stretch_m_per_s = unit[:4]
        for at in range(whole):
            mover.buffers.line[-1 - at] = unit[4 + at]
        state.before_n = unit[4 + whole]
        force = -stiffness * unit[0]
        mover.advance(force)
        moved = (state.x_m, state.v_m_per_s, state.stretch_m, state.stretch_m_per_s)
        return np.array([*moved, force, *unit[4 : 4 + whole]])

    def grows(stiffness: float) -> float:
        columns = np.column_stack([step(unit, stiffness) for unit in np.eye(5 + whole)])
        return float(np.abs(np.linalg.eigvals(columns)).max())

    assert 500.0 < limit < 30_000.0
    assert grows(0.999 * limit) < 1.0 < grows(1.001 * limit)
