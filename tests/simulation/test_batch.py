"""The batch engine is the daemon: interpreted, compiled and ControlTick with the loopback device agree bit by bit."""

from __future__ import annotations

import math
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from hapticd import plugins
from hapticd.config.models import SceneConfig, VelocityConfig
from hapticd.config.safety import SafetyConfig
from hapticd.config.walls import WallConfig
from hapticd.errors import ConfigError, DeviceFaultError
from hapticd.law import state_fields
from hapticd.simulation.batch import TRACE_COLUMNS, Batch, BatchResult, Point
from hapticd.simulation.options import SimulationOptions
from hapticd.tick.contact import RunningLaw
from hapticd.tick.event import EventCode
from hapticd.tick.guard import Guard
from hapticd.tick.tick import ControlTick
from hapticd_drivers.loopback import Loopback

T = 1e-3
LAWS = ("none", "energy-cycle", "tdpa")


def pressed(newton: float, **hand: Any) -> dict[str, Any]:
    return {"force": {"profile": "constant", "newton": newton}, **hand}


def wall(stiffness: float, **keys: Any) -> WallConfig:
    return WallConfig.model_validate({"stiffness_n_per_m": stiffness, **keys})


SCENARIOS: dict[str, tuple[dict[str, Any], WallConfig, dict[str, Any]]] = {
    "omega7-12kN": ({"hand": pressed(-3.0), "initial_position_m": 0.003}, wall(12000.0), {"max_force_n": 12.0}),
    "paper-set2": (
        {"model": "paper-simulation", "hand": pressed(-5.0), "changes": [{"at_s": 0.2, "viscous_n_s_per_m": -1.0}]},
        wall(3000.0),
        {},
    ),
    "active-wall-that-stiffens": (
        {"hand": pressed(-4.0), "initial_position_m": 0.01},
        wall(
            6000.0,
            damping_n_s_per_m=1.0,
            changes=[{"at_s": 1.0, "damping_n_s_per_m": -1.0}, {"at_s": 2.0, "stiffness_n_per_m": 15000.0}],
        ),
        {"max_force_n": 10.0, "velocity_samples": 2},
    ),
    "everything": (
        {
            "model": "hapkit",
            "noise_m": 1e-5,
            "seed": 11,
            "force_delay_samples": 1,
            "bandwidth_hz": 400.0,
            "hand": {
                "force": {"profile": "press-and-release", "newton": -3, "release_newton": 0.5, "period_s": 0.7},
                "mass_kg": 0.1,
                "damping_n_s_per_m": 2.0,
                "stiffness_n_per_m": 60.0,
            },
            "changes": [{"at_s": 0.5, "hand_stiffness_n_per_m": 200.0}, {"at_s": 1.5, "coulomb_n": 0.02}],
        },
        wall(5000.0),
        {"max_force_n": 4.0, "velocity_samples": 5},
    ),
    "late-with-friction": (
        {
            "model": "hapkit",
            "force_delay_s": 1.3e-3,
            "initial_position_m": 0.002,
            "hand": pressed(-2.0, stiffness_n_per_m=50.0),
            "changes": [{"at_s": 5.0, "coulomb_n": 0.0}],
        },
        wall(4000.0),
        {"max_force_n": 5.0},
    ),
    "flexible-and-late": (
        {
            "force_delay_s": 4e-4,
            "flexible": {"frequency_hz": 130.0, "handle_share": 0.3},
            "initial_position_m": 0.002,
            "hand": pressed(-3.0, mass_kg=0.05, damping_n_s_per_m=1.0, stiffness_n_per_m=100.0),
            "changes": [{"at_s": 5.0, "hand_mass_kg": 0.2}],
        },
        wall(9000.0),
        {"max_force_n": 12.0},
    ),
}


def point(law: ModuleType, scenario: str, **params: Any) -> Point:
    device, its_wall, loop = SCENARIOS[scenario]
    return Point(SimulationOptions.model_validate(device), its_wall, law.Params(**params), T, **loop)


def daemon(law: ModuleType, at: Point, ticks: int) -> tuple[np.ndarray[Any, Any], ControlTick]:
    """The same loop with the daemon's own tick and driver."""
    driver = Loopback(at.device, at.period_s)
    info = driver.open()
    limit = None if at.max_force_n == math.inf else at.max_force_n
    safety = SafetyConfig(max_force_n=limit, profile="device" if limit else "simulation")
    tick = ControlTick(
        SceneConfig(walls=(at.wall,)),
        VelocityConfig(samples=at.velocity_samples),
        Guard(safety, info),
        info,
        lambda: RunningLaw(law, at.params),
        at.period_s,
        0.05,
    )
    tick.start(driver.read())
    assert tick.arm()
    driver.enable()
    rows = np.full((ticks, len(TRACE_COLUMNS)), np.nan)
    contact = tick.contacts[0]
    device = driver.model
    assert device is not None
    for row in range(ticks):
        try:
            sample = driver.read()
        except DeviceFaultError:
            break  # flown apart
        force_n = tick.step(sample, at.period_s)
        if tick.fault:
            assert tick.fault == EventCode.SAMPLE_IMPOSSIBLE
            break
        driver.write(force_n)
        rows[row] = (
            device.x_m,
            device.v_m_per_s,
            device.measured_m,
            force_n[0],
            contact.ledger.energy_j,
            getattr(contact.law.state, "damping_n_s_per_m", 0.0),
        )
    return rows, tick


def assert_same_rows(ours: np.ndarray[Any, Any], theirs: np.ndarray[Any, Any]) -> None:
    differs = np.flatnonzero(((ours != theirs) & ~(np.isnan(ours) & np.isnan(theirs))).any(axis=1))
    assert not len(differs), f"from row {differs[0]} on: {ours[differs[0]]} is not {theirs[differs[0]]}"


def all_scenarios(name: str, ticks: int) -> tuple[Batch, BatchResult]:
    law = plugins.law(name)
    batch = Batch(law, [point(law, scenario) for scenario in SCENARIOS], ticks * T, trace_every=1)
    return batch, batch.run()


def assert_same_as_daemon(result: BatchResult, batch: Batch, ticks: int) -> None:
    """In a batch of all scenarios each point carries the terms of the others: they must change no bit."""
    for at, one in enumerate(batch.points):
        rows, tick = daemon(batch.law, one, ticks)
        assert_same_rows(result.trace[at], rows)
        ledger, state = tick.contacts[0].ledger, tick.contacts[0].law.state
        assert result.finite[at] == (not np.isnan(rows).any())
        assert result.ticks[at] == np.isfinite(rows[:, 0]).sum()
        if not result.finite[at]:
            continue
        assert result.cycles[at] == ledger.cycle > 0
        assert result.energy_j[at] == ledger.energy_j
        assert result.generated_j[at] == ledger.generated_j
        assert result.dissipated_j[at] == ledger.dissipated_j
        for field in state_fields(batch.law):
            assert result.states[field][at] == getattr(state, field)


@pytest.mark.parametrize("name", LAWS)
def test_the_batch_is_the_daemon_to_the_last_bit(name: str) -> None:
    batch, result = all_scenarios(name, 20_000)
    assert_same_as_daemon(result, batch, 20_000)


@pytest.mark.nightly
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", LAWS)
def test_the_batch_is_the_daemon_to_the_last_bit_over_a_million_ticks(name: str) -> None:
    batch, result = all_scenarios(name, 1_000_000)
    assert_same_as_daemon(result, batch, 1_000_000)


@pytest.mark.parametrize("name", LAWS)
def test_interpreted_and_compiled_agree_to_the_last_bit(name: str) -> None:
    batch, machine = all_scenarios(name, 5_000)
    plain = batch.run_interpreted()
    for field in BatchResult.__dataclass_fields__:
        ours, theirs = getattr(machine, field), getattr(plain, field)
        for part in ours.dtype.names or (...,):
            assert np.array_equal(ours[part], theirs[part], equal_nan=ours.dtype.kind == "f"), field


READINGS: list[dict[str, Any]] = [
    {"work": "total", "rule": "signed", "cap": "none"},
    {"pairing": "held-power", "sum": "start", "rule": "non-negative", "cap": "fixed"},
    {"pairing": "new-force", "plateaus": "literal", "contact_loss": "ignored", "cap": "known-mass"},
    {"pairing": "power", "new_contact": "damping", "stored_energy": "subtracted", "window": 3, "wall_may_pull": False},
    {"new_contact": "energy", "window_future": 1, "min_travel_counts": 5.0},
]


@pytest.mark.parametrize("keys", READINGS, ids=lambda keys: "-".join(map(str, keys.values())))
def test_every_reading_of_the_paper_is_the_same_interpreted_and_compiled(keys: dict[str, Any]) -> None:
    law = plugins.law("energy-cycle")
    batch = Batch(law, [point(law, scenario, **keys) for scenario in SCENARIOS], 3.0, trace_every=1)
    assert np.array_equal(batch.run().trace, batch.run_interpreted().trace, equal_nan=True)


def test_threads_change_no_number() -> None:
    law = plugins.law("energy-cycle")
    points = [
        Point(SimulationOptions.model_validate({"hand": pressed(-3.0)}), wall(4000.0 + 50.0 * at), law.Params())
        for at in range(200)
    ]
    batch = Batch(law, points, 1.0)
    one, many = batch.run(workers=1), batch.run()
    assert np.array_equal(one.peak_to_peak_m, many.peak_to_peak_m)
    assert np.array_equal(one.energy_j, many.energy_j)


# --- what is reported ------------------------------------------------------------------------------------------------


def free(law: ModuleType, **device: Any) -> Point:
    options = SimulationOptions.model_validate({"model": "paper-simulation", **device})
    return Point(options, wall(3000.0), law.Params())


def test_what_is_reported_is_what_the_trace_shows() -> None:
    law = plugins.law("energy-cycle")
    at = Point(
        SimulationOptions.model_validate({"hand": pressed(-3.0), "initial_position_m": 0.004}),
        wall(4000.0),
        law.Params(),
        max_force_n=12.0,
        target_m=-3.0 / 4000.0,
        band_m=4e-5,
    )
    result = Batch(law, [at], 3.0, window_s=0.7, trace_every=1).run()
    rows = dict(zip(TRACE_COLUMNS, result.trace[0].T, strict=True))
    last = slice(-700, None)
    assert result.peak_to_peak_m[0] == np.ptp(rows["x_m"][last])
    assert result.measured_peak_to_peak_m[0] == np.ptp(rows["x_measured_m"][last])
    assert result.mean_depth_m[0] == pytest.approx(-rows["x_m"][last].mean(), rel=1e-12)
    assert result.mean_force_n[0] == pytest.approx(rows["force_n"][-701:-1].mean(), rel=1e-9)
    assert result.peak_force_n[0] == np.abs(rows["force_n"]).max()
    assert result.damping_n_s_per_m[0] == rows["damping_n_s_per_m"][-1]
    outside = np.flatnonzero(np.abs(rows["x_m"] + 3.0 / 4000.0) > 4e-5)
    assert result.settled_s[0] == pytest.approx((outside[-1] + 1) * T)
    assert result.ticks[0] == 3000


def test_the_trace_keeps_one_tick_in_so_many() -> None:
    law = plugins.law("none")
    full = Batch(law, [free(law, hand=pressed(-1.0))], 0.5, trace_every=1).run().trace
    thin = Batch(law, [free(law, hand=pressed(-1.0))], 0.5, trace_every=7).run().trace
    assert np.array_equal(thin[0], full[0, 6::7])


@pytest.mark.parametrize("every", [1, 7])
def test_a_trace_of_the_end_begins_where_it_is_told(every: int) -> None:
    law = plugins.law("none")
    full = Batch(law, [free(law, hand=pressed(-1.0))], 0.5, trace_every=1).run().trace
    last = Batch(law, [free(law, hand=pressed(-1.0))], 0.5, trace_every=every, trace_last_s=0.1).run().trace
    assert np.array_equal(last[0], full[0, 400 + every - 1 :: every])


def test_a_loop_that_flies_apart_says_so_and_stops() -> None:
    law = plugins.law("none")
    result = Batch(law, [free(law, viscous_n_s_per_m=-200.0, hand=pressed(-1.0)), free(law)], 2.0).run()
    assert result.finite.tolist() == [False, True]
    assert result.ticks[0] < 2000
    assert math.isnan(result.peak_to_peak_m[0])
    assert math.isnan(result.settled_s[0])


def test_memory_does_not_grow_with_the_simulated_time() -> None:
    law = plugins.law("none")

    def size(seconds: float) -> int:
        return sum(array.nbytes for array in Batch(law, [free(law)], seconds).arrays())

    assert size(1e6) == size(1.0)


def test_a_point_that_cannot_be_simulated_is_named() -> None:
    law = plugins.law("none")
    with pytest.raises(ConfigError, match=r"points\[1\].*stiffness"):
        Batch(law, [free(law), free(law, coulomb_n=1.0, hand=pressed(0.0, stiffness_n_per_m=1e9))], 1.0)
