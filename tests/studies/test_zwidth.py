"""A map shows where walls are stable, agrees with the analytic limits, and says what it cannot do before it starts."""

from __future__ import annotations

import csv
import json
import math
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from hapticd.cli import main
from hapticd.config.loading import parse
from hapticd.offline.outcome import Criterion
from hapticd_studies.boundaries import passive_limit, stable_limit
from hapticd_studies.grid import job
from hapticd_studies.grid.journal import Row
from hapticd_studies.law_spec import parse_laws
from hapticd_studies.zwidth import sweep
from hapticd_studies.zwidth.plane import QUANTITIES, parse_axis
from hapticd_studies.zwidth.scenario import scenario_of, with_values

HAPTICD = str(Path(sys.executable).with_name("hapticd"))
FILES = ("zwidth.csv", "zwidth.json", "zwidth.png")
SMALL = ("--cells", "12x5", "--duration", "2", "--laws", "none")


def zwidth(*arguments: str) -> int:
    with pytest.raises(SystemExit) as left:
        main(["study", "zwidth", *arguments])
    return int(left.value.code or 0)


def mapped(folder: Path, *arguments: str) -> dict[str, Any]:
    assert zwidth(*arguments, "--output", str(folder)) == 0
    found: dict[str, Any] = json.loads((folder / "zwidth.json").read_text())
    return found


def contents(folder: Path) -> list[bytes]:
    return [(folder / name).read_bytes() for name in FILES]


# --- what it shows ---------------------------------------------------------------------------------------------------


def test_without_a_law_the_map_ends_at_the_linear_limit(tmp_path: Path) -> None:
    """No steps of the sensor, and long enough to see slow growth: then the limit decides nearly every cell."""
    found = mapped(
        tmp_path, "--x", "stiffness=2e3..20e3", "--y", "viscous=1..9", "--cells", "30x9", "--duration", "8", "--laws",
        "none", "--set", "quantisation=0", "--set", "force-limit=1000",
    )  # fmt: skip
    (law,) = found["laws"]
    assert law["same_verdict_as_linear_limit"] > 0.94
    assert 0.2 < law["settled_share"] < 0.8
    edges = [row.index(2) for row in law["map"]]  # the first cell that keeps moving
    assert edges == sorted(edges)
    assert {curve["key"] for curve in found["boundaries"]} == {"stable", "passive"}


def test_energy_cycles_widen_the_region_that_the_device_alone_can_show(tmp_path: Path) -> None:
    found = mapped(tmp_path, *SMALL[:-1], "none,energy-cycle", "--y", "mass=0.15..0.5")
    alone, cycles = found["laws"]
    assert alone["settled_share"] < 0.35
    assert cycles["settled_share"] > 0.95
    assert "settled: over the last 0.5 s" in found["criterion"]["words"]


def test_bisection_finds_the_edge_that_the_grid_shows(tmp_path: Path) -> None:
    plane = ("--x", "stiffness=2e3..20e3", "--y", "viscous=2..9", "--duration", "4", "--laws", "none")
    quiet = ("--set", "quantisation=0")
    (grid,) = mapped(tmp_path / "grid", *plane, *quiet, "--cells", "37x5")["laws"]
    bisected = mapped(tmp_path / "bisect", *plane, *quiet, "--cells", "37x5", "--method", "bisect")
    values = mapped_values(tmp_path / "grid")
    for row, (low, high) in zip(grid["map"], bisected["laws"][0]["map"], strict=True):
        last = max(at for at, outcome in enumerate(row) if outcome == 0)
        assert 0.0 < high - low <= 500.0
        assert values[last] - 1e-6 <= high
        assert low <= values[last + 1] + 1e-6


def mapped_values(folder: Path) -> list[float]:
    values: list[float] = json.loads((folder / "zwidth.json").read_text())["x"]["values"]
    return values


def test_a_line_without_an_edge_says_so(tmp_path: Path) -> None:
    (law,) = mapped(
        tmp_path, "--x", "stiffness=1e3..2e3", "--y", "mass=0.1..0.3", "--cells", "4x3", "--duration", "2", "--laws",
        "none", "--method", "bisect",
    )["laws"]  # fmt: skip
    assert law["settled"] == law["cells"] == 3
    assert law["lowest_edge"] is None
    assert law["map"] == [[None, None]] * 3


def test_with_several_starts_every_one_of_them_has_to_settle(tmp_path: Path) -> None:
    plane = (
        "--x",
        "stiffness=6e3..10e3",
        "--y",
        "hand-force=1..6",
        "--cells",
        "9x4",
        "--duration",
        "2",
        "--laws",
        "none",
    )
    (once,) = mapped(tmp_path / "once", *plane)["laws"]
    (often,) = mapped(tmp_path / "often", *plane, "--starts", "5")["laws"]
    assert often["settled"] < once["settled"]
    with (tmp_path / "often" / "zwidth.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert any(0 < int(row["settled_starts"]) < 5 for row in rows)
    assert all((row["outcome"] == "settled") == (row["settled_starts"] == "5") for row in rows)


@pytest.mark.parametrize(("starts", "heights_mm"), [(1, [4.0]), (2, [4.0, 14.0]), (5, [4.0, 6.5, 9.0, 11.5, 14.0])])
def test_starts_reach_from_the_press_s_own_to_ten_millimetres_above(starts: int, heights_mm: list[float]) -> None:
    text = (ROOT / "config/wall-12-none.toml").read_text()
    text = with_values(text, "own.toml", ["device.options.initial_position_m=0.004"], {})
    axes = (parse_axis("stiffness=5e3..6e3", 2, "--x"), parse_axis("mass=0.2..0.3", 2, "--y"))
    plan = sweep.ZwidthPlan(text, "own.toml", parse_laws("none", {}), *axes, "grid", 1.0, starts, Criterion())
    points = sweep._Press(plan.job().spec, 0, None)._points(5e3, 0.2)
    assert [1e3 * point.device.initial_position_m for point in points] == pytest.approx(heights_mm)


def test_the_table_has_a_line_a_cell_with_units_in_its_columns(tmp_path: Path) -> None:
    mapped(tmp_path, *SMALL, "--x", "stiffness=500..8e3", "--y", "delay=0..2", "--set", "mass=0.1")
    with (tmp_path / "zwidth.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 12 * 3  # five values between 0 and 2 samples are three
    assert {row["force_delay_samples"] for row in rows} == {"0.0", "1.0", "2.0"}
    assert float(rows[0]["stiffness_n_per_m"]) == 500.0
    settled = {
        delay: sum(row["outcome"] == "settled" for row in rows if row["force_delay_samples"] == delay)
        for delay in ("0.0", "1.0", "2.0")
    }
    assert settled["0.0"] > settled["1.0"] > settled["2.0"]


@pytest.mark.parametrize("name", QUANTITIES)
def test_every_parameter_can_be_varied(name: str) -> None:
    ranges = {"delay": (0.0, 2.0), "rate": (500.0, 2000.0), "damping": (-1.0, 20.0)}
    low, high = ranges.get(name, (0.001, 0.002))
    axis = parse_axis(f"{name}={low}..{high}", 3, "--x")
    base = scenario_of(parse((ROOT / "config/wall-12-none.toml").read_text(), "wall-12-none.toml"))
    scenarios = [axis.quantity.put(base, value) for value in axis.values]
    assert len(set(map(repr, scenarios))) == 3
    assert len(axis.quantity.column) > len("kg")


ROOT = Path(__file__).parents[2]


def test_a_hand_that_brakes_moves_the_limit_of_its_own_loop_and_not_that_for_any_operator() -> None:
    alone = scenario_of(parse((ROOT / "config/wall-12-none.toml").read_text(), "wall-12-none.toml"))
    held = QUANTITIES["hand-damping"].put(alone, 5.0)
    assert passive_limit(held.loop()) == passive_limit(alone.loop()) == pytest.approx(8800.0)
    assert stable_limit(held.loop()) > 2.0 * stable_limit(alone.loop())


def test_a_law_gets_the_parameters_that_it_is_given(tmp_path: Path) -> None:
    """Damping capped at next to nothing is no damping."""
    found = mapped(tmp_path, *SMALL[:-1], "none,energy-cycle:cap=fixed:cap_damping_n_s_per_m=0.001")
    alone, capped = found["laws"]
    assert abs(alone["settled_share"] - capped["settled_share"]) < 0.1


def test_the_configuration_of_the_press_can_be_ones_own_and_be_changed(tmp_path: Path) -> None:
    text = (ROOT / "config/wall-12-none.toml").read_text()
    (tmp_path / "own.toml").write_text(text.replace("-3.0", "-1.0"))
    found = mapped(tmp_path / "out", *SMALL, "--config", str(tmp_path / "own.toml"), "--set", "mass=0.4")
    assert "newton = -1.0" in found["press"]
    assert "mass_kg = 0.4" in found["press"]


def test_a_configuration_of_windows_can_be_changed() -> None:
    """Whose editors put a mark before the text."""
    changed = with_values("\ufeff[loop]\r\nrate_hz = 500\r\n", "own.toml", ["loop.priority=70"], {})
    assert parse(changed, "own.toml").config.loop.rate_hz == 500.0


# --- interruptions ---------------------------------------------------------------------------------------------------


def test_an_interrupted_map_goes_on_to_the_same_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep, "_TICKS_PER_BLOCK", 2e4)
    mapped(tmp_path / "whole", *SMALL)
    original = sweep._block
    done: list[int] = []

    def interrupted(spec: dict[str, Any], block: int, threads: int | None) -> list[Row]:
        if len(done) == 3:
            raise KeyboardInterrupt
        done.append(block)
        return original(spec, block, threads)

    with monkeypatch.context() as patched:
        patched.setattr(sweep, "_block", interrupted)
        patched.setattr(job, "code_digest", lambda laws: "the same")
        assert zwidth(*SMALL, "--output", str(tmp_path / "broken")) == 130
    assert not (tmp_path / "broken" / "zwidth.csv").exists()

    def counted(spec: dict[str, Any], block: int, threads: int | None) -> list[Row]:
        assert block not in done
        return original(spec, block, threads)

    monkeypatch.setattr(sweep, "_block", counted)
    monkeypatch.setattr(job, "code_digest", lambda laws: "the same")
    assert zwidth(*SMALL, "--output", str(tmp_path / "broken")) == 0
    assert contents(tmp_path / "broken") == contents(tmp_path / "whole")
    assert sorted(path.name for path in (tmp_path / "broken").iterdir()) == sorted(FILES)


def test_a_killed_map_goes_on_to_the_same_files(tmp_path: Path) -> None:
    arguments = ("--cells", "60x40", "--duration", "10", "--laws", "none", "--y", "mass=0.1..1")
    command = [HAPTICD, "study", "zwidth", *arguments, "--output", str(tmp_path / "killed")]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    journal = tmp_path / "killed" / "zwidth.journal"
    while process.poll() is None and (not journal.exists() or journal.read_bytes().count(b"\n") < 2):
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    assert process.wait(30) == -signal.SIGKILL
    kept = journal.read_bytes()
    mapped(tmp_path / "killed", *arguments)
    mapped(tmp_path / "whole", *arguments)
    assert kept.count(b"\n") > 1
    assert contents(tmp_path / "killed") == contents(tmp_path / "whole")


# --- refusals --------------------------------------------------------------------------------------------------------

REFUSED: dict[str, tuple[Sequence[str], str]] = {
    "a negative mass": (["--y", "mass=-1..1"], "--y mass=-1..1: mass must be more than 0"),
    "no rate": (["--y", "rate=0..1000"], "--y rate=0..1000: rate must be from 10"),
    "a force that does not press": (["--y", "hand-force=-3..0"], "hand-force must be more than 0"),
    "half a sample": (["--y", "delay=0.5..2"], "delay must be a whole number"),
    "not a number": (["--x", "stiffness=nan..4"], "stiffness must be more than 0"),
    "a range backwards": (["--x", "stiffness=5..2"], "LOW must be less than HIGH"),
    "a logarithm of zero": (["--y", "friction=0..1:log"], "must begin above 0"),
    "no range": (["--x", "stiffness"], "NAME=LOW..HIGH"),
    "an unknown parameter": (["--x", "stifness=1..2"], 'did you mean "stiffness"?'),
    "one parameter twice": (["--y", "stiffness=1..2"], "--x varies stiffness already"),
    "no cells": (["--cells", "0x4"], "--cells 0x4: must be"),
    "more cells than memory": (["--cells", "900000x900000"], "GiB of memory"),
    "an unknown method": (["--method", "guess"], "must be grid or bisect"),
    "bisection over whole numbers": (
        ["--method", "bisect", "--x", "delay=0..3", "--y", "mass=1..2"],
        "give delay to --y",
    ),
    "no time": (["--duration", "0"], "--duration 0: must be more than 0 s"),
    "a time without end": (["--duration", "1e300"], "duration = 1e+300 s: must be at least one period"),
    "an unknown law": (["--laws", "nolaw"], "no law 'nolaw'"),
    "an unknown parameter of a law": (["--laws", "tdpa:cap=3"], "cap = 3: unknown key"),
    "a value that a law refuses": (["--laws", "energy-cycle:cap=maybe"], "must be"),
    "a law twice": (["--laws", "none,none"], "a law stands there twice"),
    "a law that does not compile": (["--laws", "tests.studies.looping_law"], "cannot be compiled"),
    "a value that the configuration refuses": (["--set", "device.options.mass_kg=-1"], "mass_kg = -1: must be"),
    "a place that is not there": (["--set", "scene.walls[7].stiffness_n_per_m=1"], "no such place"),
    "a hand that never comes to rest": (["--config", str(ROOT / "config/hapticd.toml")], "must come to rest"),
    "a wall that changes what is varied": (
        ["--set", "scene.walls[0].changes=[{at_s=1.0, stiffness_n_per_m=9e3}]"],
        "over time; take that out",
    ),
    "a start inside the wall": (
        ["--set", "device.options.initial_position_m=-0.002"],
        "device.options.initial_position_m = -0.002: must be 0 or more",
    ),
    "no file": (["--config", "nowhere.toml"], "nowhere.toml: no such file"),
    "a folder that is a file": (["--output", __file__], "cannot be written"),
    "no address": (["--cluster", "here"], "tcp://127.0.0.1:8786"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_done_is_said_before_it_is_begun(
    name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments, expected = REFUSED[name]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sweep, "_block", None)
    assert zwidth("--cells", "4x3", "--duration", "1", *arguments) == 2
    said = capfd.readouterr().err.split("hapticd: ", 1)[1]
    assert expected in said
    assert all(line.startswith("  ") for line in said.splitlines()[1:])
    assert not list(tmp_path.glob("zwidth/*"))


def test_a_picture_is_a_png_that_does_not_tell_the_day(tmp_path: Path) -> None:
    mapped(tmp_path / "a", *SMALL)
    mapped(tmp_path / "b", *SMALL)
    first = (tmp_path / "a" / "zwidth.png").read_bytes()
    assert first.startswith(b"\x89PNG\r\n")
    assert first == (tmp_path / "b" / "zwidth.png").read_bytes()


def test_ranges_are_spaced_evenly_or_in_the_logarithm() -> None:
    assert parse_axis("stiffness=1e3..5e3", 5, "--x").values == (1e3, 2e3, 3e3, 4e3, 5e3)
    logarithmic = parse_axis("mass=.01..100:log", 5, "--y")
    assert logarithmic.values == pytest.approx((0.01, 0.1, 1.0, 10.0, 100.0))
    assert math.isclose(logarithmic.between(0.1, 10.0), 1.0)
    assert parse_axis("damping=-1..1", 3, "--y").values == (-1.0, 0.0, 1.0)
    assert parse_axis("delay=0..3", 50, "--y").values == (0.0, 1.0, 2.0, 3.0)
