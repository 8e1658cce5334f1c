"""Random devices can be replayed one by one, and the paper's law settles those that damping can hold."""

from __future__ import annotations

import csv
import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hapticd import plugins
from hapticd.cli import main
from hapticd.config.loading import parse
from hapticd.offline.outcome import Criterion, Outcome
from hapticd.offline.presses import judge
from hapticd.offline.simulate import simulate
from hapticd.simulation.batch import Batch
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.paper.scenarios import TDPA_AS_PUBLISHED
from hapticd_studies.robustness.devices import DURATION_S, Device, draw
from hapticd_studies.robustness.readings import PAPER, every_reading, params_on, short
from hapticd_studies.robustness.report import reason, report
from hapticd_studies.robustness.sweep import COLUMNS, RobustnessPlan, pressed

DEFAULT = LawSpec(PAPER, PAPER, {})
DEVICES = [draw(1, index) for index in range(1000)]


def robustness(*arguments: str) -> int:
    with pytest.raises(SystemExit) as left:
        main(["study", "robustness", *arguments])
    return int(left.value.code or 0)


# --- the devices -----------------------------------------------------------------------------------------------------


def test_devices_fill_the_ranges_that_are_declared() -> None:
    figures = {name: [device.figures()[name] for device in DEVICES] for name in DEVICES[0].figures()}
    for name, low, high in [
        ("mass_kg", 0.15, 0.5),
        ("viscous_n_s_per_m", 1.0, 6.0),
        ("resolution_m", 1e-6, 3e-5),
        ("stiffness_n_per_m", 4e3, 3e4),
        ("rate_hz", 500.0, 4000.0),
        ("hand_force_n", 0.5, 8.0),
    ]:
        span = (high - low) * 0.02
        assert low <= min(figures[name]) < low + span
        assert high - span < max(figures[name]) <= high
    assert max(figures["initial_position_m"]) == pytest.approx(0.015, rel=0.02)
    shares = {
        "initial_position_m": 0.6,
        "hand_mass_kg": 0.3,
        "coulomb_n": 0.2,
        "force_delay_samples": 0.3,
    }
    for name, share in shares.items():
        assert np.mean(np.array(figures[name]) > 0.0) == pytest.approx(share, abs=0.04)
    assert np.mean([bool(device.wall.changes) for device in DEVICES]) == pytest.approx(0.2, abs=0.04)


def test_a_device_depends_on_its_seed_and_index_alone() -> None:
    draw.cache_clear()
    assert draw(1, 57) == DEVICES[57]
    assert draw(2, 57) != DEVICES[57]
    assert len({repr(device.figures()) for device in DEVICES}) == len(DEVICES)


@pytest.mark.parametrize("index", range(4))
def test_the_configuration_of_a_device_runs_it_to_the_same_place(index: int) -> None:
    """Late, rubbing, held and before a wall that stiffens: the daemon's own tick ends where the batch does."""
    wanted = [
        lambda one: one.delayed and one.options.hand.mass_kg > 0.0,
        lambda one: one.options.coulomb_n > 0.0 and not one.delayed,
        lambda one: bool(one.wall.changes) and one.delayed,
        lambda one: bool(one.wall.changes) and one.options.coulomb_n > 0.0,
    ][index]
    device = min(filter(wanted, DEVICES), key=lambda one: one.rate_hz)
    loaded = parse(device.config("energy-cycle", {"window": 2}), "device.toml")
    run = simulate(loaded, DURATION_S)
    point = device.point(loaded.params, Criterion())
    result = Batch(loaded.law, [point], DURATION_S, ledger=False).run_interpreted()
    assert run.damping_n_s_per_m[-1] == result.damping_n_s_per_m[0]
    assert run.peak_to_peak_m == result.peak_to_peak_m[0]
    assert -run.mean_m == pytest.approx(result.mean_depth_m[0], rel=1e-12)
    assert (run.settled_s, run.outcome) == (result.settled_s[0], judge(Criterion(), [point], result)[0])


def test_a_device_with_a_wall_beyond_the_damper_peak_is_beyond_reach() -> None:
    late = [device for device in DEVICES if device.delayed]
    assert 0 < sum(not device.within_reach for device in late) < len(late) / 5
    for device in DEVICES:
        factor = 0.14447 if device.delayed else 0.68629
        limit = factor * device.mass_kg * device.rate_hz**2
        assert device.within_reach == (device.stiffness_n_per_m < 0.8 * limit and device.hand_n < 0.8 * 12.0)


# --- the laws --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def default_table() -> np.ndarray[Any, Any]:
    return np.array(pressed(DEVICES, DEFAULT, Criterion()))


def test_the_papers_law_settles_what_damping_can_hold(default_table: np.ndarray[Any, Any]) -> None:
    found = report(RobustnessPlan(1, len(DEVICES), [DEFAULT], Criterion()), [default_table])
    assert [holds for _, _, _, holds in found.bars] == [True, True]
    (prompt, late) = (group for _, group, _, _ in found.bars)
    assert prompt.devices > 600
    assert late.devices > 200
    unsettled = {DEVICES.index(draw(*map(int, one.device.split(":")))) for one in found.failures}
    assert unsettled == set(np.flatnonzero(default_table[:, 0] != Outcome.SETTLED))
    assert all("%" in one.reason and one.command.endswith(one.device) for one in found.failures)


def test_the_felt_mass_is_the_mass_that_moves(default_table: np.ndarray[Any, Any]) -> None:
    felt = report(RobustnessPlan(1, len(DEVICES), [DEFAULT], Criterion()), [default_table]).felt_mass
    assert felt is not None
    assert felt.low is not None
    assert felt.median == pytest.approx(1.0, abs=0.03)
    assert felt.devices > 850
    assert felt.devices + felt.unknown == len(DEVICES)
    assert 0.5 < felt.low < 1.0


def test_every_choice_of_the_papers_law_is_a_reading_that_its_parameters_take() -> None:
    readings = every_reading()
    labels = [reading.label for reading in readings]
    assert len(set(labels)) == len(labels)
    assert {"none", "tdpa", PAPER, f"{PAPER}:work=total", f"{PAPER}:wall_may_pull=false"} <= set(labels)
    for reading in readings:
        assert params_on(reading, DEVICES[0]) is not None
    known = next(reading for reading in readings if reading.label == f"{PAPER}:cap=known-mass")
    assert params_on(known, DEVICES[3]).model_dump()["mass_kg"] == DEVICES[3].options.mass_kg
    bounding = next(reading for reading in readings if reading.label == "energy-bounding")
    told = params_on(bounding, DEVICES[3]).model_dump()["device_damping_n_s_per_m"]
    assert told == DEVICES[3].options.viscous_n_s_per_m
    assert params_on(DEFAULT, DEVICES[3]) == plugins.law(PAPER).Params()


def test_tdpa_as_published_is_that_of_the_papers_study() -> None:
    found = [dict(reading.values) for reading in every_reading() if short(reading.label) == ("tdpa", "as published")]
    assert found == [TDPA_AS_PUBLISHED]


def test_the_reason_says_what_happened_and_what_was_asked_for() -> None:
    device = next(one for one in DEVICES if not one.within_reach)
    row = [0.0] * len(COLUMNS)
    assert reason(device, row) == "settled"
    row[:3] = [Outcome.MOVING, 1.2e-3, 0.0]
    assert reason(device, row).startswith("keeps moving, 1.2 mm; wall at ")
    row[:3] = [Outcome.ELSEWHERE, 1e-5, 2e-3]
    assert reason(device, row).startswith("rests 2 mm too deep; wall at ")
    row[:3] = [Outcome.ELSEWHERE, 1e-5, -2e-3]
    assert "too shallow" in reason(device, row)


# --- the command -----------------------------------------------------------------------------------------------------


def test_the_command_writes_a_line_a_device_and_reading(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    laws = "energy-cycle,energy-cycle:rule=signed"
    assert robustness("--devices", "60", "--seed", "1", "--laws", laws, "--output", str(tmp_path)) == 0
    said = capsys.readouterr().out
    assert "PASS energy-cycle, no delay" in said
    assert "felt mass / true mass: median" in said
    assert len(said.splitlines()) <= 24
    with (tmp_path / "robustness.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 60
    found = json.loads((tmp_path / "robustness.json").read_text())
    default, signed = (one["prompt"] for one in found["readings"])
    assert signed["settled"] < default["settled"] == default["devices"]
    assert (tmp_path / "robustness.png").read_bytes().startswith(b"\x89PNG")
    lost = {row["device"] for row in rows if row["reading"] == PAPER and row["outcome"] != "settled"}
    assert lost == {one["device"] for one in found["not_settled"]}
    # the same device alone, out of its block
    device = next(iter(sorted(lost)))
    row = next(row for row in rows if row["reading"] == PAPER and row["device"] == device)
    (again,) = pressed([named(device)], DEFAULT, Criterion())
    assert again[1] == float(row["peak_to_peak_m"])
    assert Outcome(int(again[0])).name.lower() == row["outcome"]


def named(device: str) -> Device:
    seed, index = device.split(":")
    return draw(int(seed), int(index))


def test_one_device_can_be_looked_at_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert robustness("--only", "1:57", "--laws", "none", "--output", str(tmp_path)) == 0
    said = capsys.readouterr().out
    assert "beyond reach: wall at 151 % of what any damping holds" in said
    assert "keeps moving" in said
    options = tomllib.loads((tmp_path / "device-1-57.toml").read_text())["device"]["options"]
    assert options["mass_kg"] == DEVICES[57].options.mass_kg
    with (tmp_path / "device-1-57.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == pytest.approx(DURATION_S * DEVICES[57].rate_hz, abs=1)
    assert float(rows[-1]["none:x_m"]) != 0.0
    assert (tmp_path / "device-1-57.png").exists()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--only", "57"], "--only 57: must be SEED:INDEX"),
        (["--devices", "0"], "--devices 0: must be from 1"),
        (["--seed", "-1"], "--seed -1: must be 0 or more"),
        (["--laws", "nolaw"], "no law 'nolaw'"),
        (["--output", __file__], "cannot be written"),
        (["--cluster", "127.0.0.1"], "must be the address of a dask scheduler"),
    ],
)
def test_what_cannot_be_done_is_said_before_it_is_begun(
    arguments: list[str],
    expected: str,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert robustness("--devices", "5", *arguments) == 2
    assert expected in capfd.readouterr().err
    assert list(tmp_path.iterdir()) == [] or "--output" not in arguments
