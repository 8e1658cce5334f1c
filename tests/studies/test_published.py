"""Published rows say what the model does, and every verdict can come out the other way."""

from __future__ import annotations

import json
import re

import pytest
from typer.testing import CliRunner

from hapticd_studies.commands.app import app
from hapticd_studies.published import rows
from tests.test_readme import ROOT


@pytest.fixture(scope="module")
def told() -> dict[str, dict[str, object]]:
    done = CliRunner().invoke(app, ["devices", "--json"])
    assert done.exit_code == 0, done.output
    return {row["key"]: row for row in json.loads(done.stdout)["rows"]}


def test_the_page_says_what_the_command_says(told: dict[str, dict[str, object]]) -> None:
    table = re.findall(r"^\| `([a-z-]+)` \|.*\| ([a-z ]+) \|$", (ROOT / "docs/studies.md").read_text(), re.M)
    assert {key: row["verdict"] for key, row in told.items()} == dict(table)
    assert len(told) == len(rows.ROWS)


def test_friction_holds_a_gentle_press_up_to_its_limit_and_no_further(told: dict[str, dict[str, object]]) -> None:
    figures = told["friction-limit"]["figures"]
    assert isinstance(figures, dict)
    settled = {float(k): count for k, count in figures["settled_by_stiffness_n_per_m"].items()}
    assert settled[2300.0] == rows.STARTS > settled[3000.0]


def test_a_device_without_friction_contradicts_the_friction_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(rows.PHANTOM, "coulomb_n", 0.0)
    assert not rows.friction_limit(stiffnesses=(100.0, 2000.0, 4000.0)).agrees


def test_a_hand_that_hardly_presses_agrees_with_the_limit_that_knows_no_hand() -> None:
    assert rows.friction_limit_pressed(hand_n=0.1, stiffnesses=(500.0, 1500.0)).agrees


def test_a_device_that_lags_agrees_with_the_published_ratio_no_more_than_its_formula() -> None:
    found = rows.rate(lag_s=0.0)
    assert not found.agrees
    assert found.figures["lagging_ratio"] == pytest.approx(160.0)


def test_a_coarser_sensor_makes_damping_felt_at_the_higher_rate_too() -> None:
    fine, coarse = (rows.rate_takes_damping(step_m).figures["felt_by_rate_hz"] for step_m in (1e-6, 1e-4))
    assert isinstance(fine, dict)
    assert isinstance(coarse, dict)
    assert fine[4000] < 1.0 < coarse[4000]
