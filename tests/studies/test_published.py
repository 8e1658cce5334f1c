"""Published rows say what the model does, and every verdict can come out the other way."""

from __future__ import annotations

import json
import re

import pytest
from typer.testing import CliRunner

from hapticd.simulation.options import Flexible
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


def test_beside_every_press_that_settles_stands_what_of_it_is_felt(told: dict[str, dict[str, object]]) -> None:
    """The friction that holds a PHANToM up to its limit holds it still; damping a coarse sensor does not."""
    for key, by in (
        ("friction-limit", "stiffness_n_per_m"),
        ("friction-limit-pressed", "stiffness_n_per_m"),
        ("encoder", "step_m"),
        ("velocity-filter", "samples"),
    ):
        figures = told[key]["figures"]
        assert isinstance(figures, dict)
        counts, felt, chatter = (figures[f"{what}_by_{by}"] for what in ("settled", "felt", "chatter_n"))
        assert {at for at, count in counts.items() if count} == {at for at, index in felt.items() if index is not None}
        assert all(span_n is None or span_n >= 0.0 for span_n in chatter.values())
        assert "felt" in str(told[key]["model"])
    figures = told["velocity-filter"]["figures"]
    assert isinstance(figures, dict)
    assert figures["felt_by_samples"]["1"] < 1.0


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


def test_without_the_lag_the_advice_would_be_wrong() -> None:
    assert rows.rate_advice().agrees
    assert not rows.rate_advice(lag_s=0.0).agrees


def test_a_handle_that_hardly_bends_decides_nothing_and_shrinks_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    stiff = Flexible(frequency_hz=5000.0, handle_share=0.3, damping_ratio=0.5)
    monkeypatch.setattr(rows, "_MODES", (stiff,))
    assert not rows.mode_when_held().agrees
    assert not rows.modes_shrink_region(dampings=(20, 60)).agrees


def test_the_late_loop_meets_both_stiffnesses_that_were_measured() -> None:
    limits = rows.rate().figures["late_limit_n_per_m"]
    assert limits == [pytest.approx(325.0, rel=0.01), pytest.approx(904.0, rel=0.01)]
