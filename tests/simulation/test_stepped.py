"""Integrators in sub-steps do what theory says of them, and nothing else."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd import plugins
from hapticd.config.walls import WallConfig
from hapticd.simulation.batch import Batch, Point
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from hapticd.simulation.plant import METHODS

T = 1e-3
STEPPED = METHODS[1:]
ORDERS = {"explicit-euler": 1, "semi-implicit-euler": 1, "velocity-verlet": 2, "rk4": 4}


def options(**keys: Any) -> SimulationOptions:
    return SimulationOptions.model_validate({"model": "paper-simulation", **keys})


def device(period_s: float = T, **keys: Any) -> SimulatedDevice:
    return SimulatedDevice(options(**keys), period_s)


def one_tick(stiffness: float, mass: float, **keys: Any) -> list[list[float]]:
    """The map of (x, v) over one period against a sampled wall, a column a start."""
    columns = []
    for x, v in ((1.0, 0.0), (0.0, 1.0)):
        mover = device(mass_kg=mass, initial_position_m=x, initial_velocity_m_per_s=v, **keys)
        mover.advance(-stiffness * x)
        columns.append((mover.x_m, mover.v_m_per_s))
    return [[columns[0][0], columns[1][0]], [columns[0][1], columns[1][1]]]


def determinant(stiffness: float, mass: float, **keys: Any) -> float:
    (a, b), (c, d) = one_tick(stiffness, mass, **keys)
    return a * d - b * c


@pytest.mark.parametrize("substeps", [1, 2, 5, 16])
@pytest.mark.parametrize(("stiffness", "mass"), [(3000.0, 0.5), (12000.0, 0.25), (20.0, 4.0)])
def test_euler_makes_a_sampled_wall_leak_too_much_or_too_little_by_one_part_in_the_substeps(
    substeps: int, stiffness: float, mass: float
) -> None:
    """The determinant of the one-tick map is 1 + (K T^2 / 2m) (1 + 1/n), and with the other sign semi-implicitly.

    What exceeds 1 is the leak K T / 2 as a negative damping: doubled by one explicit step, gone with one semi-implicit.
    """
    leak = stiffness * T * T / (2.0 * mass)
    explicit = determinant(stiffness, mass, integrator="explicit-euler", substeps=substeps)
    semi = determinant(stiffness, mass, integrator="semi-implicit-euler", substeps=substeps)
    assert explicit == pytest.approx(1.0 + leak * (1.0 + 1.0 / substeps), rel=1e-13)
    assert semi == pytest.approx(1.0 + leak * (1.0 - 1.0 / substeps), rel=1e-13)


@pytest.mark.parametrize("integrator", ["exact", "velocity-verlet", "rk4"])
def test_where_the_force_is_held_and_nothing_rubs_second_order_is_exact(integrator: str) -> None:
    found = determinant(3000.0, 0.5, integrator=integrator)
    assert found == pytest.approx(1.0 + 3000.0 * T * T / (2.0 * 0.5), rel=1e-14)


def test_one_euler_step_a_sample_is_no_model_of_the_papers_wall() -> None:
    """Uncontrolled Fig. 6 after 3 s: 55.6 mm in truth, 189 mm with twice the leak, 3.34 mm without any."""
    spans = {}
    for integrator in ("exact", "explicit-euler", "semi-implicit-euler"):
        mover = device(integrator=integrator, hand={"force": {"profile": "constant", "newton": -5.0}})
        positions = []
        for _ in range(3000):
            mover.advance(max(0.0, -3000.0 * mover.x_m))
            positions.append(mover.x_m)
        spans[integrator] = 1e3 * (max(positions[-300:]) - min(positions[-300:]))
    assert spans["exact"] == pytest.approx(55.6, abs=0.05)
    assert spans["explicit-euler"] == pytest.approx(189.4, abs=0.5)
    assert spans["semi-implicit-euler"] == pytest.approx(3.34, abs=0.01)


@pytest.mark.parametrize("integrator", STEPPED)
def test_twice_the_substeps_divide_the_error_by_two_to_the_order(integrator: str) -> None:
    keys: dict[str, Any] = {
        "viscous_n_s_per_m": 3.0,
        "initial_position_m": 0.01,
        "initial_velocity_m_per_s": 0.4,
        "hand": {"force": {"profile": "constant", "newton": -2.0}, "stiffness_n_per_m": 900.0},
    }
    period = 0.02

    def end(**more: Any) -> tuple[float, float]:
        mover = device(period, **keys, **more)
        mover.advance(1.5)
        return mover.x_m, mover.v_m_per_s

    exact = end()
    errors = [math.dist(end(integrator=integrator, substeps=n), exact) for n in (8, 16)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(ORDERS[integrator], abs=0.25)


@pytest.mark.parametrize("integrator", STEPPED)
def test_with_friction_more_substeps_come_to_the_exact_slide_and_stop(integrator: str) -> None:
    def run(**more: Any) -> float:
        mover = device(coulomb_n=0.6, viscous_n_s_per_m=1.0, initial_velocity_m_per_s=0.1, **more)
        for _ in range(100):
            mover.advance(0.0)
        assert mover.v_m_per_s == 0.0
        return mover.x_m

    exact = run()
    errors = [abs(run(integrator=integrator, substeps=n) - exact) for n in (1, 10, 100)]
    assert errors[2] < 0.2 * errors[1] + 1e-12 or errors[2] < 1e-8
    assert errors[2] < 1e-6


@given(
    integrator=st.sampled_from(STEPPED),
    substeps=st.integers(1, 20),
    friction=st.floats(1e-6, 1e3),
    share=st.floats(-1.0, 1.0),
    mass=st.floats(1e-6, 1e3),
)
def test_what_friction_can_hold_does_not_creep(
    integrator: str, substeps: int, friction: float, share: float, mass: float
) -> None:
    mover = device(integrator=integrator, substeps=substeps, coulomb_n=friction, mass_kg=mass, initial_position_m=0.01)
    for _ in range(5):
        mover.advance(share * friction)
    assert (mover.x_m, mover.v_m_per_s) == (0.01, 0.0)


@given(
    integrator=st.sampled_from(STEPPED),
    substeps=st.integers(1, 20),
    friction=st.floats(0.1, 1e3),
    mass=st.floats(1e-3, 10.0),
    speed=st.floats(-1.0, 1.0),
)
def test_friction_alone_never_turns_a_device_around(
    integrator: str, substeps: int, friction: float, mass: float, speed: float
) -> None:
    """The dead band is not jumped over, however light the device and however long the step."""
    mover = device(
        integrator=integrator, substeps=substeps, coulomb_n=friction, mass_kg=mass, initial_velocity_m_per_s=speed
    )
    for _ in range(5):
        mover.advance(0.0)
        assert mover.v_m_per_s * speed >= 0.0
        assert abs(mover.v_m_per_s) <= abs(speed)


def test_compiled_and_interpreted_integrators_agree_to_the_last_bit_in_one_batch() -> None:
    law = plugins.law("none")
    points = [
        Point(
            options(
                integrator=integrator,
                substeps=substeps,
                coulomb_n=coulomb,
                viscous_n_s_per_m=2.0,
                hand={"force": {"profile": "constant", "newton": -3.0}, "stiffness_n_per_m": 50.0},
            ),
            WallConfig(stiffness_n_per_m=2000.0),
            law.Params(),
        )
        for integrator in METHODS
        for substeps in ((1,) if integrator == "exact" else (1, 3))
        for coulomb in (0.0, 0.2)
    ]
    batch = Batch(law, points, 0.3, 0.1, trace_every=1)
    compiled, interpreted = batch.run(), batch.run_interpreted()
    assert compiled.trace.tobytes() == interpreted.trace.tobytes()
    ends = {float(trace[-1, 0]) for trace in compiled.trace}
    assert len(ends) == len(points)  # and every one of them is a device of its own
