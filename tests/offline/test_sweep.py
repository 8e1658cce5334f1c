"""A sweep is many single runs told as one table."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hapticd
from hapticd.errors import ConfigError
from hapticd.offline import sweep as sweep_module
from hapticd.offline.outcome import Outcome
from tests.offline.test_run import press

KEY = "scene.walls[0].stiffness_n_per_m"
VALUES = (3000.0, 14e3, 30e3)
LAWS = ("none", "energy-cycle")
AT_0 = press().with_values({"scene.walls[0].position_m": 0.0})


@pytest.fixture(scope="module")
def grid() -> hapticd.Grid:
    return hapticd.sweep(AT_0, KEY, VALUES, laws=LAWS, duration_s=1.5)


def test_every_cell_is_the_run_of_that_configuration(grid: hapticd.Grid) -> None:
    for row, law in enumerate(LAWS):
        for column, value in enumerate(VALUES):
            run = hapticd.simulate(AT_0.with_values({KEY: value, "controller.law": law}), 1.5)
            assert grid.outcomes[law][column] is run.outcome
            assert grid.peak_to_peak_m[row, column] == run.peak_to_peak_m
            assert grid.mean_depth_m[row, column] == -run.mean_m
            assert grid.cycles[row, column] == run.cycle[-1]
            assert grid.damping_n_s_per_m[row, column] == run.damping_n_s_per_m[-1]
            assert np.array_equal(grid.settled_s[row, column], run.settled_s, equal_nan=True)


def test_the_table_names_key_values_laws_and_outcomes(grid: hapticd.Grid) -> None:
    lines = repr(grid).splitlines()
    assert lines[0].split() == [KEY, *LAWS]
    assert lines[1].split() == ["3000", "settled", "settled"]
    assert lines[3].split() == ["30000", "keeps", "moving", "settled"]
    assert lines[-1] == "6 runs of 1.5 s"


def test_machine_code_gives_the_same_numbers_to_the_last_bit(
    grid: hapticd.Grid, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sweep_module, "FEW_TICKS", 0)

    def interpreted(*_: object) -> None:
        raise AssertionError("run as machine code")

    monkeypatch.setattr(sweep_module, "simulate", interpreted)
    told: list[int] = []
    compiled = hapticd.sweep(AT_0, KEY, VALUES, laws=LAWS, duration_s=1.5, progress=told.append)
    assert compiled.outcomes == grid.outcomes
    for name, rows in grid.columns.items():
        assert np.array_equal(compiled.columns[name], rows, equal_nan=True), name
    assert told[-1] == 6


def test_what_the_engine_cannot_repeat_is_run_tick_by_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two walls, or a hand that never rests."""
    monkeypatch.setattr(sweep_module, "FEW_TICKS", 0)
    second = {"scene.walls": [{"stiffness_n_per_m": 3000.0}, {"stiffness_n_per_m": 2000.0, "position_m": -1e-3}]}
    walls = hapticd.sweep(press().with_values(second), "device.options.mass_kg", [0.2], duration_s=3.0)
    assert walls.outcomes["none"] == (Outcome.SETTLED,)
    swinging = press(profile="sine", rest=", frequency_hz = 2.0")
    assert hapticd.sweep(swinging, KEY, [3000.0], duration_s=0.2).outcomes["none"] == (Outcome.RUNS,)


def test_a_run_that_flies_apart_has_no_span() -> None:
    wild = press(device="viscous_n_s_per_m = -60.0\nmax_force_n = 0.0")
    grid = hapticd.sweep(wild, "device.options.viscous_n_s_per_m", [-60.0, 4.0], duration_s=2.0)
    assert grid.outcomes["none"][0] is Outcome.DIVERGED
    assert np.isnan(grid.peak_to_peak_m[0]).tolist() == [True, False]


def test_the_configurations_own_law_keeps_its_parameters_and_another_has_its_defaults() -> None:
    own = press(law="tdpa").with_values({"controller.params.damping_cap_n_s_per_m": 1e-3})
    grid = hapticd.sweep(own, KEY, [20e3], laws=["tdpa", "energy-cycle"], duration_s=1.0)
    assert grid.outcomes["tdpa"] == (Outcome.MOVING,)
    assert grid.outcomes["energy-cycle"] == (Outcome.SETTLED,)
    assert hapticd.sweep(own, KEY, [20e3], duration_s=0.1).laws == ("tdpa",)


def test_a_parameter_of_the_law_can_be_swept() -> None:
    grid = hapticd.sweep(press(20e3, "tdpa"), "controller.params.damping_cap_n_s_per_m", [1e-3, 200.0], duration_s=1.0)
    assert grid.outcomes["tdpa"][0] is Outcome.MOVING
    assert grid.outcomes["tdpa"][1] is not Outcome.MOVING


def test_progress_counts_runs() -> None:
    told: list[int] = []
    hapticd.sweep(press(), KEY, VALUES, laws=LAWS, duration_s=0.01, progress=told.append)
    assert told == [1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize(
    ("key", "values", "laws", "said"),
    [
        (KEY, [-1.0], None, r"scene\.walls\[0\]\.stiffness_n_per_m = -1"),
        ("scene.walls[9].damping_n_s_per_m", [1.0], None, r"scene\.walls\[9\]\.damping_n_s_per_m"),
        (KEY, [1.0], ["tdap"], "tdap"),
        (KEY, [], None, "at least one value and one law"),
        (KEY, [1.0], [], "at least one value and one law"),
    ],
)
def test_what_cannot_be_swept_is_refused_by_name(
    key: str, values: list[float], laws: list[str] | None, said: str
) -> None:
    with pytest.raises(ConfigError, match=said):
        hapticd.sweep(press(), key, values, laws=laws)


def test_a_grid_has_a_row_a_law_and_a_column_a_value(grid: hapticd.Grid) -> None:
    assert {getattr(grid, name).shape for name in grid.columns} == {(2, 3)}
    assert not math.isnan(grid.peak_force_n.sum())
