"""The accuracy study measures the trade: theory where there is some, the daemon's own loop where there is none."""

from __future__ import annotations

import csv
import json
import math
from array import array
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.cli import main
from hapticd.config.loading import load, parse
from hapticd.offline.outcome import Criterion
from hapticd.offline.rehearsal import rehearse
from hapticd.offline.run import Run
from hapticd.paths import directory
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from hapticd_studies.accuracy.continuous import Bounce, measure_bounce, truth
from hapticd_studies.accuracy.control import at_rate, measure_rates, measure_velocity, measure_windows
from hapticd_studies.accuracy.cost import costs
from hapticd_studies.accuracy.cycles import judge, true_ends
from hapticd_studies.accuracy.devices import AdaptiveDevice, SingleDevice
from hapticd_studies.accuracy.leak import leak
from hapticd_studies.accuracy.model import ModelStudy, measure_model
from hapticd_studies.accuracy.telemetry import measure_batches
from hapticd_studies.accuracy.traps import traps
from tests.examples import examples
from tests.simulation import exact

T = 1e-3
LAB = """
[device.options]
model = "omega7"
resolution_m = 0.0
coulomb_n = 0.05
noise_m = 1e-8
hand.force = { profile = "constant", newton = -3.0 }
hand.damping_n_s_per_m = 3.0
[[scene.walls]]
stiffness_n_per_m = 4000.0
"""
SHIPPED = sorted(
    path.stem
    for path in directory("config").glob("*.toml")
    if path.stem not in ("omega7", "hid-rig", "serial-rig") and "axes = 3" not in path.read_text()  # it is of one axis
)


def options(**keys: Any) -> SimulationOptions:
    return SimulationOptions.model_validate({"model": "paper-simulation", **keys})


def run(*arguments: str) -> int:
    with pytest.raises(SystemExit) as left:
        main(["study", "accuracy", *arguments])
    return int(left.value.code or 0)


# --- the leak --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("integrator", "substeps", "factor"),
    [("exact", 1, 1.0), ("explicit-euler", 1, 2.0), ("explicit-euler", 4, 1.25), ("semi-implicit-euler", 1, 0.0),
     ("semi-implicit-euler", 4, 0.75), ("velocity-verlet", 1, 1.0), ("rk4", 1, 1.0)],
)  # fmt: skip
def test_the_leak_is_that_of_theory(integrator: str, substeps: int, factor: float) -> None:
    """(m / T) ln(1 + (K T^2 / 2m) factor), which is K T / 2 times the factor up to terms of K T^2 / m."""
    stiffness, mass = 3000.0, 0.5
    found = leak(options(integrator=integrator, substeps=substeps), stiffness, T, 5.0 / stiffness)
    assert found.theory_n_s_per_m == 1.5
    assert found.determinant == pytest.approx(1.0 + stiffness * T * T / (2.0 * mass) * factor, rel=1e-12)
    assert found.damping_n_s_per_m == pytest.approx(1.5 * factor, rel=0.01, abs=1e-9)
    assert found.share == pytest.approx(factor, rel=0.01, abs=1e-9)
    assert found.words == ("marginal" if factor == 0.0 else "unstable")


def test_the_energy_of_a_cycle_is_what_a_run_gains_in_one() -> None:
    """Kinetic and spring energy of the linear loop, from one turn to the next: K A^2 / 2 times what the leak makes."""
    stiffness, depth = 3000.0, 5.0 / 3000.0
    found = leak(options(), stiffness, T, depth)
    device = SimulatedDevice(options(initial_position_m=-depth), T)
    peaks = [depth]
    before = device.x_m, device.v_m_per_s
    for _ in range(400):
        device.advance(-stiffness * device.x_m)
        if before[1] < 0.0 <= device.v_m_per_s:
            # The largest depth lies between two samples; the energy there is that of the swing.
            peaks.append(math.sqrt(device.x_m**2 + 0.5 * device.v_m_per_s**2 / stiffness))
        before = device.x_m, device.v_m_per_s
    growth = (peaks[-1] / peaks[1]) ** (2.0 / (len(peaks) - 2))
    gained_j = 0.5 * stiffness * depth * depth * (growth - 1.0)
    assert found.per_cycle_j == pytest.approx(gained_j, rel=0.05)
    assert found.theory_per_cycle_j == pytest.approx(found.per_cycle_j, rel=0.01)


def test_the_traps_are_shown_with_their_numbers() -> None:
    truth_, explicit, semi = traps()
    assert [round(1e3 * one.peak_to_peak_m, 1) for one in (truth_, explicit, semi)] == [55.6, 189.4, 3.3]
    assert [round(one.leak_share, 2) for one in (truth_, explicit, semi)] == [1.0, 1.99, 0.0]


# --- devices of the study --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("keys", [{}, {"coulomb_n": 0.4}, {"coulomb_n": 0.4, "hand": {"stiffness_n_per_m": 300.0}}])
def test_the_adaptive_device_is_the_exact_one_to_its_tolerance(keys: dict[str, Any]) -> None:
    given_ = options(viscous_n_s_per_m=2.0, initial_velocity_m_per_s=0.05, **keys)
    closed, adaptive = SimulatedDevice(given_, T), AdaptiveDevice(given_, T, "DOP853", 1e-12)
    for tick in range(200):
        force = 1.5 * math.sin(0.05 * tick)
        closed.advance(force)
        adaptive.advance(force)
        assert adaptive.x_m == pytest.approx(closed.x_m, abs=1e-11)
        assert adaptive.v_m_per_s == pytest.approx(closed.v_m_per_s, abs=1e-8)


def test_the_reference_agrees_with_an_integrator_that_knows_nothing_of_it() -> None:
    given_ = options(coulomb_n=0.4, viscous_n_s_per_m=2.0, initial_velocity_m_per_s=0.004)
    adaptive = AdaptiveDevice(given_, T, "DOP853", 1e-12)
    adaptive.advance(0.3)
    x, v = exact.period_with_friction(
        0.0, 0.004, mass=0.5, damping=2.0, spring=0.0, coulomb=0.4, force=0.3, period=T
    )  # fmt: skip
    assert (adaptive.x_m, adaptive.v_m_per_s) == pytest.approx((x, v), abs=1e-13)


def test_single_precision_errs_by_its_own_rounding_and_not_by_more() -> None:
    given_ = options(viscous_n_s_per_m=2.0, initial_position_m=0.01)
    double, single = SimulatedDevice(given_, T), SingleDevice(given_, T)
    for _ in range(100):
        double.advance(-1.0)
        single.advance(-1.0)
    error = abs(single.x_m - double.x_m)
    assert 0.0 < error < 100 * 0.01 * 2.0**-23


# --- a wall that is felt at all times --------------------------------------------------------------------------------


def test_the_bounce_is_the_one_that_is_known() -> None:
    x, v = truth(Bounce())
    assert x == pytest.approx(-4.263428303e-3, abs=1e-12)
    assert v == pytest.approx(-0.2760573141, abs=1e-10)


def test_at_contact_events_pay_only_where_the_tolerance_is_tight() -> None:
    """At 1e-6 stopping is cheaper and less accurate, at 1e-12 it is cheaper and more accurate; RK4 loses its order."""
    rows = {row.name: row for row in measure_bounce(Bounce())}
    for relative, better in (("1e-06", False), ("1e-12", True)):
        through, stops = (rows[f"DOP853 {relative}, {how} contact"] for how in ("runs through", "stops at"))
        assert stops.evaluations < 0.5 * through.evaluations
        assert (stops.error_m < through.error_m) is better
    assert rows["DOP853 1e-12, stops at contact"].error_m < 1e-13
    fourth = [rows[f"rk4, {step} us"].error_m for step in (1000, 100, 10)]
    assert math.log10(fourth[1] / fourth[2]) < 2.5


@examples(25)
@given(
    mass=st.floats(0.05, 2.0),
    damping=st.floats(0.0, 5.0),
    stiffness=st.floats(200.0, 2e4),
    force=st.floats(-8.0, -0.5),
    start=st.floats(1e-4, 0.01),
)
def test_the_truth_keeps_its_energy_books(
    mass: float, damping: float, stiffness: float, force: float, start: float
) -> None:
    """Kinetic, spring and hand's energy together fall by what the damper takes, and without one they stay."""
    x, v = truth(Bounce(mass, damping, stiffness, force, start, 0.3))
    energy = 0.5 * mass * v * v - force * x + (0.5 * stiffness * x * x if x < 0.0 else 0.0)
    began = -force * start
    assert energy <= began * (1.0 + 1e-9)
    if damping == 0.0:
        assert energy == pytest.approx(began, rel=1e-9)


# --- settings of the device ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def model() -> ModelStudy:
    return measure_model(parse(LAB, "lab.toml"), 0.4, lambda _: None)


def test_every_kind_of_setting_is_measured(model: ModelStudy) -> None:
    families = {row.family for row in model.rows}
    assert families == {
        "exact", "explicit-euler", "semi-implicit-euler", "velocity-verlet", "rk4", "adaptive", "float32",
        "without a term", "with one more term",
    }  # fmt: skip
    assert model.default == "exact"
    reference = model.rows[0]
    assert (reference.position_m, reference.same_forces_m, reference.energy_j) == (0.0, 0.0, 0.0)
    assert all(row.cost.ns > 0.0 and row.cost.ratio >= 1.0 for row in model.rows)
    assert min(row.cost.ratio for row in model.rows) == 1.0


def test_nothing_on_the_front_is_beaten_and_everything_else_is(model: ModelStudy) -> None:
    offered = [row for row in model.rows if row.offered]
    for row in model.rows:
        beaten = any(
            one.operations <= row.operations
            and one.position_m <= row.position_m
            and (one.operations, one.position_m) != (row.operations, row.position_m)
            for one in offered
        )
        assert row.best is (row.offered and not beaten), row.name


def test_the_choice_is_the_cheapest_that_keeps_the_error(model: ModelStudy) -> None:
    for below_m in (0.0, 1e-9, 1e-6, 1e-4):
        chosen = model.choice(below_m)
        assert chosen.position_m <= below_m
        assert not any(
            row.operations < chosen.operations and row.position_m <= below_m for row in model.rows if row.offered
        )


def test_what_the_device_declares_is_shown_but_not_offered(model: ModelStudy) -> None:
    offered = {row.name: row.offered for row in model.rows if row.name.startswith("without")}
    assert not any(row.offered for row in model.rows if row.name.startswith("with "))
    assert offered == {
        "without viscous friction": True, "without Coulomb friction": True, "without sensor noise": True,
        "without force limit": False, "without hand damping": True,
    }  # fmt: skip


def test_costs_are_ratios_to_the_cheapest_of_the_run() -> None:
    cheap, dear = costs([partial(sum, range(10)), partial(sum, range(10000))])
    assert cheap.ratio == 1.0
    assert dear.ratio == dear.ns / cheap.ns


# --- the control side ------------------------------------------------------------------------------------------------


def test_a_faster_loop_leaks_less_and_holds_stiffer_walls() -> None:
    rows = measure_rates(parse(LAB, "lab.toml"), 0.3, lambda _: None)
    assert [row.leak_n_s_per_m * row.rate_hz for row in rows] == pytest.approx([2000.0] * len(rows))
    alone = [row.alone_n_per_m for row in rows]
    held = [row.law_n_per_m for row in rows]
    assert alone == sorted(alone)  # type: ignore[type-var]  # sorted() refuses a None
    assert held[0] is not None
    assert held[-1] is not None
    assert held[0] < held[-1]
    assert rows[-1].position_m == 0.0


def test_rates_do_not_touch_the_rest_of_a_configuration() -> None:
    loaded = parse(LAB, "lab.toml")
    faster = at_rate(loaded, 4000.0)
    assert faster.config.loop.period_s == 0.25e-3
    assert faster.config.scene == loaded.config.scene
    assert loaded.config.loop.rate_hz == 1000.0


def test_a_long_velocity_window_is_quiet_late_and_at_twenty_samples_unstable() -> None:
    """On the shipped wall of 12 kN/m, as the vendor's 20 ms would have it."""
    rows = {
        row.name: row
        for row in measure_velocity(load(directory("config") / "wall-12-energy-cycle.toml"), 2.0, lambda _: None)
    }
    assert rows["difference over 1"].default
    assert rows["difference over 1"].verdict == "settled"
    assert rows["difference over 20"].verdict == "keeps moving"
    assert rows["difference over 20"].error_m_per_s > 3.0 * rows["difference over 1"].error_m_per_s


def test_without_a_long_enough_window_noise_makes_cycles_that_were_none() -> None:
    text = (directory("config") / "wall-12-energy-cycle.toml").read_text()
    noisy = parse(text.replace("[device.options]", "[device.options]\nnoise_m = 5e-6"), "noisy.toml")
    rows = {row.window: row.closed for row in measure_windows(noisy, 3.0, lambda _: None)}
    assert rows[1].false > 10 * max(1, rows[3].false)
    assert rows[10].missed >= rows[3].missed
    late = [rows[window].late_ticks for window in (1, 2, 3, 4)]
    assert late == sorted(late)


@given(
    ends=st.lists(st.integers(0, 1000), unique=True, max_size=20).map(sorted),
    verdicts=st.lists(st.integers(0, 1000), unique=True, max_size=20).map(sorted),
)
def test_every_verdict_is_right_or_false_and_every_cycle_seen_or_missed(ends: list[int], verdicts: list[int]) -> None:
    found = judge(ends, verdicts)
    seen = found.detected - found.false
    assert 0 <= seen <= min(len(ends), len(verdicts))
    assert found.missed == len(ends) - seen
    assert (found.late_ticks >= 0.0) is (seen > 0)
    assert judge(ends, ends).false == judge(ends, ends).missed == 0


def moved(run: Run, x_m: list[float]) -> Run:
    """The run with another true position."""
    return replace(run, columns={**run.columns, "x_m": array("d", x_m)})


def test_true_cycles_are_turns_of_the_true_motion() -> None:
    """Three swings inside the wall, then one out of it: four ends, and a tremor smaller than the sensor's step none."""
    run = rehearse(parse(LAB, "lab.toml"), 0.1)
    swing = [-1e-3 + 5e-4 * math.sin(2 * math.pi * (tick / 50 - 0.25)) for tick in range(175)]
    out = list(np.linspace(swing[-1], 1e-3, 25))
    tremor = [-1e-3 + 1e-6 * math.sin(tick) for tick in range(100)]
    assert len(true_ends(moved(run, [*swing, *out]), 1e-5)) == 4
    assert true_ends(moved(run, tremor), 1e-5) == []


def test_batches_trade_waiting_against_messages() -> None:
    rows = measure_batches(load(directory("config") / "wall-12-energy-cycle.toml"), lambda _: None)
    waits = [row.longest_wait_s for row in rows]
    assert waits == sorted(waits)
    assert waits[0] == 0.0
    assert max(waits) <= 20e-3
    assert min(row.ratio for row in rows) == 1.0
    assert [row.batch_ticks for row in rows if row.default] == [20]


# --- the command -----------------------------------------------------------------------------------------------------


def test_the_command_writes_everything_and_prints_a_screen(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lab = tmp_path / "lab.toml"
    lab.write_text(LAB)
    assert run("--config", str(lab), "--duration", "0.5", "--below", "1e-7", "--output", str(tmp_path / "out")) == 0
    shown = capsys.readouterr().out
    assert len(shown.splitlines()) <= 50
    said = " ".join(shown.split())
    assert "For an error below 1e-07 m choose " in said
    assert "the default (exact) costs" in said
    assert "55.6 mm in truth" in said
    with (tmp_path / "out" / "accuracy.csv").open() as file:
        rows = {row["setting"]: row for row in csv.DictReader(file)}
    assert float(rows["semi-implicit-euler x1"]["leak_share"]) < 0.05
    assert float(rows["explicit-euler x1"]["leak_share"]) == pytest.approx(2.0, rel=0.02)
    told = json.loads((tmp_path / "out" / "accuracy.json").read_text())
    assert {"model", "rates", "velocity", "cycle_windows", "telemetry_batches", "traps", "continuous_wall"} <= set(told)
    assert told["criterion"] == Criterion().declared()
    assert (tmp_path / "out" / "accuracy.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--below", "-1"], "--below -1"),
        (["--below", "nan"], "--below nan"),
        (["--duration", "0"], "--duration 0"),
        (["--duration", "inf"], "--duration inf"),
        (["--config", str(directory("config") / "omega7.toml")], "only a simulated device"),
        (["--config", str(directory("config") / "ball.toml")], "device.options.axes = 3: only a device of one axis"),
        (["--output", "/proc/nowhere"], "--output /proc/nowhere"),
    ],
)
def test_a_misuse_is_named_before_anything_runs(
    arguments: list[str], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(*arguments) == 2
    assert named in capsys.readouterr().err


@pytest.mark.nightly
@pytest.mark.parametrize("name", SHIPPED)
def test_the_study_runs_on_every_shipped_configuration(name: str, tmp_path: Path) -> None:
    assert run("--config", str(directory("config") / f"{name}.toml"), "--output", str(tmp_path)) == 0
    told = json.loads((tmp_path / "accuracy.json").read_text())
    assert told["model"][0]["position_error_m"] == 0.0
