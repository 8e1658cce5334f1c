"""Random hands at random surfaces in space: each can be replayed, and what is unsteady is seen to be."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from hapticd.cli import main
from hapticd.config.loading import parse
from hapticd.config.objects import OBJECT
from hapticd.offline.outcome import Criterion
from hapticd.offline.simulate import simulate
from hapticd.shapes.proxy import place
from hapticd.tick.space.solid import at_once, compile_objects
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.space_robustness.cases import DURATION_S, HANDS, case_of, draw
from hapticd_studies.space_robustness.surfaces import KINDS
from hapticd_studies.space_robustness.verdict import COLUMNS, Verdict, fast_m, judged

NONE, RING = (LawSpec(name, name, {}) for name in ("none", "ring-damping"))
ROUND = len(KINDS) * len(HANDS)


def study(*arguments: str) -> int:
    with pytest.raises(SystemExit) as left:
        main(["study", "space-robustness", *arguments])
    return int(left.value.code or 0)


def test_every_surface_meets_every_hand_and_no_start_is_inside() -> None:
    cases = [draw(3, index) for index in range(ROUND)]
    assert {(case.surface.kind, case.hand) for case in cases} == {(kind, hand) for kind in KINDS for hand in HANDS}
    for case in cases:
        for solid in at_once(compile_objects([OBJECT.validate_python(table) for table in case.objects], case.period_s)):
            place(solid.proxy, solid.proxy.others, solid.proxy.voxels, *case.options["space"]["position_m"])
            assert not solid.proxy.touching
    assert 0.3 < np.mean([case.rough for case in cases]) < 0.7
    assert 0.6 < np.mean([case.within_reach for case in cases]) < 1.0


def test_a_case_depends_on_its_seed_and_index_alone() -> None:
    once = case_of("1:57").config(NONE)
    draw.cache_clear()
    assert draw(1, 57).config(NONE) == once
    assert draw(2, 57).config(NONE) != once


def test_the_configuration_of_a_case_is_what_was_judged(capsys: pytest.CaptureFixture[str]) -> None:
    """A press that no law steadies spans as much when it is simulated from what --only prints, to the last bit."""
    case = draw(1, 0)
    assert study("--only", case.name, "--laws", "none") == 0
    run = simulate(parse(capsys.readouterr().out, "printed"), DURATION_S)
    row = dict(zip(COLUMNS, judged(case, NONE, Criterion()), strict=True))
    assert row["span_m"] == pytest.approx(run.peak_to_peak_m, rel=1e-12)
    assert row["peak_force_n"] == run.peak_force_n


def test_a_press_on_a_plane_shakes_without_a_law_and_rests_under_one() -> None:
    case = draw(1, 2 * ROUND)
    assert (case.surface.kind, case.hand) == ("plane", "press")
    found = {law.label: judged(case, law, Criterion())[0] for law in (NONE, RING)}
    assert found == {"none": Verdict.UNSTEADY, "ring-damping": Verdict.STEADY}


@pytest.mark.parametrize(("hertz", "share"), [(60.0, 1.0), (137.0, 1.0), (5.0, 0.0), (30.0, 0.0)])
def test_the_fast_part_of_a_way_is_what_no_hand_does(hertz: float, share: float) -> None:
    t = np.arange(3000) * 1e-3
    way = np.outer(np.sin(2.0 * np.pi * hertz * t), [3e-4, 0.0, 4e-4]) + np.outer(t, [0.01, 0.02, 0.0])
    before_m, last_m = fast_m(way, 1e-3)
    assert last_m == pytest.approx(share * 1e-3, abs=2e-5)
    assert before_m == pytest.approx(share * 1e-3, abs=2e-5)


def test_what_begins_to_shake_shows_in_the_last_third() -> None:
    t = np.arange(3000) * 1e-3
    way = np.outer(np.where(t > 2.2, np.sin(2.0 * np.pi * 80.0 * t), 0.0), [0.0, 0.0, 1e-4])
    before_m, last_m = fast_m(way, 1e-3)
    assert last_m > 1.9e-4
    assert before_m < 5e-6


def test_the_command_writes_a_row_a_case_and_law(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ("--cases", "3", "--laws", "none,ring-damping", "--output", str(tmp_path), "--json")
    assert study(*arguments) == 0
    found = json.loads(capsys.readouterr().out)
    assert [law["law"] for law in found["laws"]] == ["none", "ring-damping"]
    with (tmp_path / "space-robustness.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["case"] for row in rows] == [f"1:{index}" for index in range(3)] * 2
    for law in found["laws"]:
        reached = [row for row in rows if row["law"] == law["law"] and row["within_reach"] == "1"]
        assert law["groups"][0]["cases"] == len(reached)
        assert law["not_steady"] == [row["case"] for row in reached if row["verdict"] != "steady"]
    assert not (tmp_path / "space-robustness.journal").exists()


@pytest.mark.parametrize(
    ("arguments", "line"),
    [(("--only", "1"), "--only 1: must be SEED:INDEX"), (("--cases", "0"), "--cases 0: must be from 1")],
)
def test_what_makes_no_sense_is_one_line(
    arguments: tuple[str, ...], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert study(*arguments, "--laws", "none") == 2
    assert capsys.readouterr().err.startswith(f"hapticd: {line}")


def test_a_hand_that_strokes_along_a_crease_shakes_without_a_law_and_is_steady_under_one() -> None:
    """Its spring leaks K T / 2 across, more than the device itself takes there."""
    case = draw(1, 955)
    assert case.surface.kind == "notch of a union"
    verdict, span = (COLUMNS.index(name) for name in ("verdict", "span_m"))
    without, under = (judged(case, law, Criterion()) for law in (NONE, RING))
    assert without[verdict] == Verdict.UNSTEADY
    assert without[span] > 2e-4
    assert under[verdict] == Verdict.STEADY
    assert under[span] < 3e-5


def test_no_case_starts_where_its_sensor_shows_it_inside() -> None:
    """The start of 1:667 is 10 um off a pipe, less than a step of its sensor."""
    assert judged(draw(1, 667), NONE, Criterion())[0] != Verdict.STOPPED
