"""`hapticd study paper`: what reproduces of the paper, told by evidence that could have said otherwise."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hapticd.cli import main
from hapticd.config.loading import load
from hapticd.offline.outcome import Outcome
from hapticd.paths import directory
from hapticd_studies.paper import readings, study
from hapticd_studies.paper.claims import Claim, Evidence
from hapticd_studies.paper.judge import judge
from hapticd_studies.paper.plates import PLATES
from hapticd_studies.paper.recording import record
from hapticd_studies.paper.runs import Runs
from hapticd_studies.paper.scenarios import SCENARIOS
from tests.studies.paper_evidence import evidence as gathered
from tests.studies.paper_evidence import silent

PAGE = Path(__file__).parents[2] / "docs" / "paper.md"


@pytest.fixture(scope="module")
def evidence() -> Evidence:
    return gathered()


@pytest.fixture(scope="module")
def folder(evidence: Evidence, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("paper")
    (folder / "scenarios").mkdir()
    study.publish(evidence, folder, 50, "hapticd study paper --quick", silent)
    return folder


def claim(evidence: Evidence, key: str) -> Claim:
    (found,) = [claim for claim in judge(evidence) if claim.key == key]
    return found


# -- what is measured


def test_a_claim_that_does_not_hold_says_why(evidence: Evidence) -> None:
    for claim in judge(evidence):
        assert claim.holds or claim.remark, claim.key
        assert claim.measured, claim.key
        assert claim.scenario, claim.key


def test_the_leak_is_that_of_the_zero_order_hold(evidence: Evidence) -> None:
    """E_gen = -(kT/2) sum of v^2 T: 1.5 N s/m at 3 kN/m and 1 ms."""
    assert "-1.49" in claim(evidence, "leak").measured or "-1.50" in claim(evidence, "leak").measured


def test_stiffness_over_the_measured_position_proves_nothing(evidence: Evidence) -> None:
    """At rest it is the wall's own by construction, even when the true position is off by half a count."""
    figures = evidence.figures["fig9-12"]
    assert figures.measured_stiffness_n_per_m == pytest.approx(12e3, rel=1e-9)
    assert figures.stiffness_error is not None
    assert 1e-4 < abs(figures.stiffness_error) <= 0.5e-5 / 0.25e-3


def test_the_loop_of_force_over_displacement_generates_what_the_hold_of_a_half_swing_does(evidence: Evidence) -> None:
    """kT/2 times the integral of v^2 over half a swing, and the mass leaves with as much more than it came with."""
    run = evidence.runs["fig1"]
    area_j = float((run.force_n[:-1] * np.diff(run.x_m)).sum())
    assert area_j == pytest.approx(0.25 * np.pi * 3000.0 * 1e-3 * 0.2**2 / np.sqrt(3000.0 / 0.5), rel=0.1)
    assert 0.25 * (run.v_m_per_s[-1] ** 2 - 0.2**2) == pytest.approx(area_j, rel=1e-6)


def test_the_passive_stretch_of_the_credit_drives_no_damping_up(evidence: Evidence) -> None:
    assert evidence.runs["credit"].damping_n_s_per_m[:1000].max() == 0.0
    assert evidence.runs["credit-none"].damping_n_s_per_m[:1000].max() == 0.0


# -- what is run


@pytest.mark.parametrize(
    ("name", "shipped"),
    [
        ("fig6-set1", "fig6-set1"),
        ("fig6-set2-wall", "fig6-set2-wall"),
        ("fig6-set2-device", "fig6-set2-device"),
        ("fig8", "wall-12-none"),
        ("fig9-12", "wall-12-energy-cycle"),
        ("fig9-18", "wall-18-energy-cycle"),
        ("fig9-20", "wall-20-energy-cycle"),
        ("fig10", "wall-12-tdpa-unbounded"),
        ("fig10-bounded", "wall-12-tdpa"),
    ],
)
def test_a_scenario_is_the_configuration_that_ships_for_it(name: str, shipped: str) -> None:
    ours = SCENARIOS[name].load()
    theirs = load(directory("config") / f"{shipped}.toml")
    assert (ours.options, ours.law, ours.params) == (theirs.options, theirs.law, theirs.params)
    assert (ours.config.scene, ours.config.safety) == (theirs.config.scene, theirs.config.safety)
    assert (ours.config.loop, ours.config.velocity) == (theirs.config.loop, theirs.config.velocity)


def test_what_is_injected_less_what_is_recovered_is_the_energy_at_the_end(evidence: Evidence) -> None:
    for name, figures in evidence.figures.items():
        net_j = evidence.runs[name].energy_j[-1]
        assert figures.energy_injected_j - figures.energy_recovered_j == pytest.approx(net_j, rel=1e-6, abs=1e-9), name


def test_the_window_of_a_recording_finds_the_cycles_of_the_ledger(evidence: Evidence) -> None:
    for name in ("fig3", "fig6-set1", "fig9-12", "fig9-20"):
        run = evidence.runs[name]
        assert len(run.cycle_ends(2)) == run.cycle[-1], name


def test_cycle_ends_are_minima(evidence: Evidence) -> None:
    run = evidence.runs["fig9-12"]
    for end in run.cycle_ends(2):
        assert run.energy_j[end] == run.energy_j[end - 3 : end + 4].min()


def test_few_points_run_interpreted_give_what_many_give_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    def spans(few_ticks: int) -> np.ndarray:
        monkeypatch.setattr("hapticd_studies.paper.runs.FEW_TICKS", few_ticks)
        runs = Runs()
        table = readings.ask(runs, quick=True)
        table.asked.points = table.asked.points[:3]
        runs.run(1.0, lambda _: None)
        return table.asked.peak_to_peak_m

    assert spans(10**9).tolist() == spans(0).tolist()


def test_the_shipped_reading_passes_every_scenario_and_those_that_miss_the_hold_or_the_cycles_hardly_any() -> None:
    runs = Runs()
    table = readings.ask(runs, quick=False)
    names = [reading.name for reading in table.readings]
    rows = [names.index(name) for name in ("default", "pairing = power, cap none", "eq. 10 as printed, cap none")]
    few = readings.ReadingTable([table.readings[row] for row in rows], table.scenarios, table.asked, 1)
    count = len(table.scenarios)
    few.asked.points = [point for row in rows for point in table.asked.points[row * count : (row + 1) * count]]
    runs.run(6.0, lambda _: None)
    assert few.passed.tolist() == [28, 0, 3]
    assert few.failing(0) == []


# -- what is written


def test_the_report_needs_nothing_but_itself(folder: Path) -> None:
    page = (folder / "report.html").read_text()
    assert not re.findall(r'(?:src|href)="(?!data:|#)', page)
    assert "url(" not in page
    assert "@import" not in page
    assert page.count("data:image/png;base64,") == len(PLATES)
    assert "@media print" in page


def test_every_claim_and_every_figure_is_in_the_report(evidence: Evidence, folder: Path) -> None:
    page = (folder / "report.html").read_text()
    for claim in judge(evidence):
        assert f'id="{claim.key}"' in page
    for plate in PLATES:
        assert (folder / f"{plate.name}.png").read_bytes().startswith(b"\x89PNG")
        assert f'<figure id="{plate.name}">' in page


def test_claims_are_written_for_programs(evidence: Evidence, folder: Path) -> None:
    written = json.loads((folder / "claims.json").read_text())
    assert written["claims"] == [claim.declared() for claim in judge(evidence)]
    assert set(written["runs"]) == set(SCENARIOS)
    table = json.loads((folder / "readings.json").read_text())
    assert len(table["scenarios"]) == 28
    assert all(len(reading["outcome"]) == 28 for reading in table["readings"])


def test_the_page_of_the_paper_has_the_claims_and_verdicts_that_come_out(evidence: Evidence) -> None:
    """Figures differ with the number of starts; which claims there are, what they say and whether they hold do not."""
    said = re.findall(
        r"^\| `([a-z0-9-]+)` \| (.*?) \| (.*?) \| .* \| (yes|\*\*no\*\*) \|$", block("claims"), re.MULTILINE
    )
    ours = [(one.key, one.source, one.claim, "yes" if one.holds else "**no**") for one in judge(evidence)]
    assert said == ours


def test_the_page_of_the_paper_has_the_readings_that_come_out(evidence: Evidence) -> None:
    said = dict(re.findall(r"^\| (.*?) \| (\d+) \| [^|]+ \|$", block("readings"), re.MULTILINE))
    table = evidence.table
    passed = {reading.name: str(count) for reading, count in zip(table.readings, table.passed, strict=True)}
    assert {name: said.get(name, "28") for name in passed} == passed


def block(name: str) -> str:
    """What docs/paper.md has between these marks."""
    (text,) = re.findall(f"<!-- begin {name} -->\n(.*?)<!-- end {name} -->", PAGE.read_text(), re.DOTALL)
    return str(text)


def test_a_written_scenario_gives_the_run_of_the_report(evidence: Evidence, folder: Path) -> None:
    command = [str(Path(sys.executable).with_name("hapticd")), "simulate", "--json", "--duration", "6", "--config"]
    scenario = str(folder / "scenarios" / "fig9-18.toml")
    done = subprocess.run([*command, scenario], capture_output=True, text=True, check=True)
    said = json.loads(done.stdout)
    assert said["peak_to_peak_m"] == evidence.figures["fig9-18"].peak_to_peak_m
    assert said["damping_n_s_per_m"] == evidence.figures["fig9-18"].damping_n_s_per_m


def test_the_command_prints_the_claims(
    evidence: Evidence, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(study, "gather", lambda _extent, _progress: evidence)
    with pytest.raises(SystemExit) as done:
        main(["study", "paper", "--quick", "--json", "--output", str(tmp_path / "new" / "folder")])
    assert done.value.code == 0
    said = json.loads(capsys.readouterr().out)
    assert [claim["key"] for claim in said] == [claim.key for claim in judge(evidence)]
    assert (tmp_path / "new" / "folder" / "report.html").is_file()


def test_without_the_extra_one_line_says_what_to_install(tmp_path: Path) -> None:
    script = (
        "import sys\nsys.modules['numba'] = None\nfrom hapticd.cli import main\n"
        f"main(['study', 'paper', '--output', {str(tmp_path)!r}])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == "hapticd: this needs numba: pip install 'hapticd[study]'\n"


def test_the_overview_of_studies_imports_none() -> None:
    script = (
        "import sys\nfrom hapticd.cli import main\ntry:\n    main(['study', '--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'numba', 'matplotlib'} & set(sys.modules)\nsys.exit(repr(heavy) if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "paper" in done.stdout


def test_a_run_that_never_settles_says_so() -> None:
    scenario = replace(SCENARIOS["fig8"], name="short", duration_s=1.0)
    figures = record(scenario).figures()
    assert figures.settled_s is None
    assert figures.outcome == Outcome.MOVING.words
    assert not figures.imperceptible
    assert figures.felt_index is not None
    assert figures.felt_index > 10.0
    assert figures.force_chatter_n > 1.0
