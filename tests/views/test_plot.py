"""`hapticd plot`: the same figure of a run wherever it comes from, and one line where there is none."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hapticd
from hapticd.cli import main
from hapticd.errors import HapticdError
from hapticd.figures.picture import save
from hapticd.figures.sheets import draw
from hapticd.offline.run import Run
from hapticd.telemetry.records import Event
from hapticd.tick.event import EventCode
from hapticd_views.report.page import page
from hapticd_views.report.statement import statements
from hapticd_views.source import Source, open_source
from tests.daemon.running import HAPTICD, Daemon
from tests.views.recorded import EPOCH_S, write_recording

CONFIG = Path(__file__).parent.parent.parent / "config"
WALL = CONFIG / "wall-12-energy-cycle.toml"
OTHER_BYTES = b"\xff".decode(errors="surrogateescape")
OTHER_SIDE = (
    WALL.read_text().replace("stiffness_n_per_m = 12000.0", 'stiffness_n_per_m = 12000.0\nfree_side = "negative"')
    + "\n"
)


def plot(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [HAPTICD, "plot", *arguments],
        env={**os.environ, **environment}, capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def run() -> Run:
    return hapticd.simulate(WALL, 1.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, run: Run) -> Path:
    """One run in every kind of file."""
    folder = tmp_path_factory.mktemp("runs")
    for name in ("run.csv", "run.npz"):
        command = [HAPTICD, "simulate", "--config", str(WALL), "--duration", "1", "--output", str(folder / name)]
        subprocess.run(command, check=True, capture_output=True)
    write_recording(folder / "run.mcap", run, WALL.read_text())
    return folder


def test_a_run_is_the_same_from_every_file(folder: Path, run: Run) -> None:
    sources = [open_source(folder / name) for name in ("run.csv", "run.npz", "run.mcap")]
    for source in sources:
        (curves,) = source.curves
        assert np.array_equal(curves["force_n"], run.force_n)
        assert np.array_equal(curves["energy_j"], run.energy_j)
        assert np.array_equal(curves.cycle_ends(), run.curves.cycle_ends())
        measured = "x_m" if source.recording else "x_measured_m"
        assert curves[measured] == pytest.approx(run.x_measured_m, abs=1e-15)
        assert curves["t_s"] == pytest.approx(run.t_s, abs=1e-6)  # a timestamp is good for a quarter of a microsecond
    recorded = sources[2].curves[0]
    assert recorded.stiffness_n_per_m == 12e3
    assert recorded.rest_m == pytest.approx(-3.0 / 12e3), "of a simulated hand it is known where it comes to rest"


def test_a_wall_whose_free_side_is_negative_is_drawn_the_same_way_round(tmp_path: Path) -> None:
    run = hapticd.simulate(OTHER_SIDE, 0.5)
    (curves,) = open_source(write_recording(tmp_path / "other.mcap", run, OTHER_SIDE)).curves
    assert curves["x_m"] == pytest.approx(run.x_measured_m, abs=1e-15)
    assert curves["x_m"].min() < -2e-4
    assert curves["force_n"].max() > 3.0


def test_a_file_whose_name_is_no_utf_8_is_drawn(folder: Path, tmp_path: Path) -> None:
    """Its name stands in the picture; matplotlib's error of types was said to be a defect."""
    for kind in ("csv", "mcap"):
        path = tmp_path / f"{OTHER_BYTES}.{kind}"
        path.write_bytes((folder / f"run.{kind}").read_bytes())
        source = open_source(path)
        assert source.name == f"\ufffd.{kind}"
        save(draw("position", source.curves, source.name), path.with_suffix(".svg"))
        assert path.with_suffix(".svg").stat().st_size


def test_a_device_in_free_space_is_drawn_axis_by_axis(tmp_path: Path, run: Run) -> None:
    free: dict[str, Any] = {"wall_axis": [], "wall_position_m": [], "wall_stiffness_n_per_m": []}
    source = open_source(write_recording(tmp_path / "free.mcap", run, WALL.read_text(), receipt=free))
    assert [curves.name for curves in source.curves] == ["free.mcap z"]
    assert not source.curves[0].inside.any()


def test_a_run_that_was_reloaded_is_drawn_at_the_wall_that_was_in_force(tmp_path: Path, run: Run) -> None:
    """All of it was drawn at the wall of its beginning. The status comes 20 ms after the last tick of before."""
    moved = WALL.read_text().replace("12000.0", "8000.0\nposition_m = 0.004\nfree_side = 'negative'")
    walls = {"wall_position_m": [0.004], "wall_stiffness_n_per_m": [8000.0]}
    later = {**walls, "timestamp": EPOCH_S + 0.52, "config_text": moved, "config_hash": "moved", "law": "tdpa"}
    gone = {"wall_axis": [], "wall_position_m": [], "wall_stiffness_n_per_m": [], "timestamp": EPOCH_S + 0.8}
    switched = Event(EPOCH_S + 0.5, 500, EventCode.SWITCHED, "", {"config": "moved"})
    path = tmp_path / "two.mcap"
    source = open_source(write_recording(path, run, WALL.read_text(), more=[switched], later=[later, gone]))
    assert source.recording is not None
    assert np.bincount(source.recording.in_force).tolist() == [501, 299, 200]
    (curves,) = source.curves
    assert curves["x_m"][:501] == pytest.approx(run.x_measured_m[:501], abs=1e-15)
    assert curves["x_m"][501:] == pytest.approx(0.004 - run.x_measured_m[501:800], abs=1e-15)
    assert curves["force_n"][501:].tolist() == (-run.force_n[501:800]).tolist()
    assert np.isnan((curves.stiffness_n_per_m, curves.rest_m)).all()
    shown = page(source, statements(source)).decode()
    assert "with energy-cycle, then tdpa, then energy-cycle" in shown
    assert all(f"before {at} s" in shown for at in ("0.520", "0.800"))
    assert "position_m = 0.004" in shown


def test_missing_ticks_are_missing(tmp_path: Path, run: Run) -> None:
    gone = range(300, 340)
    source: Source = open_source(write_recording(tmp_path / "gap.mcap", run, WALL.read_text(), left_out=gone))
    time_s, drawn = source.curves[0].line("x_m")
    assert len(source.curves[0]["t_s"]) == run.ticks - 40
    assert time_s[np.isnan(drawn)].tolist() == pytest.approx([0.34])


def test_the_command_draws_recorded_and_simulated_runs_over_each_other(folder: Path, tmp_path: Path) -> None:
    output = tmp_path / "both.svg"
    done = plot(folder / "run.mcap", folder / "run.csv", "--figure", "stiffness", "--contact", "-o", output)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{output}: stiffness of run.mcap, run.csv\n"
    assert output.read_text().startswith("<?xml")
    again = plot(folder / "run.mcap", "-o", output)
    assert (again.returncode, again.stderr.strip()) == (2, f"hapticd: {output}: exists; add --overwrite to replace it")
    assert plot(folder / "run.mcap", "-o", output, "--overwrite", "--from", "0.1", "--to", "0.3").returncode == 0


def test_a_running_daemon_is_drawn_as_it_goes(tmp_path: Path) -> None:
    output = tmp_path / "live.pdf"
    with Daemon((CONFIG / "hapticd.toml").read_text()).wait_ready() as daemon:
        runtime = {"HAPTICD_RUNTIME_DIR": str(daemon.directory / "run")}
        done = plot("live", "--duration", "0.5", "--output", output, **runtime)
        assert (done.returncode, done.stderr) == (0, "")
    assert output.read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["run.csv", "-o", "run.gif"], "run.gif: must end in .png, .svg or .pdf"),
        (["run.csv", "-o", "run.png", "-f", "pie"], "--figure pie: there are run, position, force,"),
        (["run.txt", "-o", "run.png"], "run.txt: must end in .mcap (hapticd record), or in .csv or .npz"),
        (["run.csv", "-o", "none/run.png"], "none/run.png: there is no directory none"),
        (["live", "live", "-o", "run.png"], "live: there is one daemon to listen to"),
    ],
)
def test_what_is_asked_for_wrongly_is_said_in_one_line(
    arguments: list[str],
    said: str,
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["plot", *(str(folder / one) if one == "run.csv" else one for one in arguments)])
    assert ended.value.code == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith(f"hapticd: {said}")


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("no.csv", None, "cannot be read: No such file"),
        ("empty.csv", b"", "has no column t_s, x_m, force_n"),
        ("header.csv", b"t_s,x_m,force_n\n", "holds no tick"),
        (
            "words.csv",
            b"t_s,x_m,force_n\n0,1,two\n",
            "is no table of numbers; name a table that `hapticd simulate` wrote, or the .mcap of a recording",
        ),
        ("exported.csv", b"run,timestamp\n0,1\n", "is a table of `hapticd record export`; name a table"),
        ("ragged.csv", b"t_s,x_m,force_n\n0,1\n", "has 3 names for 2 columns"),
        ("binary.csv", bytes(range(256)), "is no table of numbers"),
        ("other.csv", b"a,b\n1,2\n", "has no column t_s, x_m, force_n: it is no run of a device"),
        ("no.npz", None, "cannot be read"),
        ("words.npz", b"PK\x03\x04 and more", "is no .npz file"),
        ("empty.npz", b"", "is no .npz file"),
        ("words.mcap", b"no mcap", "words.mcap"),
    ],
)
def test_a_file_that_holds_no_run_says_so(name: str, content: bytes | None, said: str, tmp_path: Path) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(HapticdError) as error:
        open_source(path)
    assert said in str(error.value)
    assert name in str(error.value)


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"t_s": np.float64(1.0), "x_m": np.float64(0.0), "force_n": np.float64(0.0)}, "t_s is no column"),
        ({"t_s": np.zeros((3, 2)), "x_m": np.zeros(3), "force_n": np.zeros(3)}, "t_s is no column"),
    ],
)
def test_arrays_that_are_no_columns_are_no_run(columns: dict[str, Any], said: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", **columns)
    with pytest.raises(HapticdError, match=said):
        open_source(tmp_path / "run.npz")


def test_a_file_of_columns_that_is_damaged_inside_or_another_kind_of_numpy_is_none(tmp_path: Path) -> None:
    np.save(tmp_path / "one.npy", np.arange(3.0))
    (tmp_path / "one.npy").rename(tmp_path / "one.npz")
    np.savez_compressed(tmp_path / "packed.npz", t_s=np.arange(500.0))
    packed = bytearray((tmp_path / "packed.npz").read_bytes())
    packed[80:120] = b"\xff" * 40
    (tmp_path / "packed.npz").write_bytes(packed)
    for name in ("one.npz", "packed.npz"):
        with pytest.raises(HapticdError, match=r"is no \.npz file of numbers"):
            open_source(tmp_path / name)


def test_a_pickle_in_a_file_of_columns_is_not_run(tmp_path: Path) -> None:
    """An .npz from a stranger: numpy runs what a pickle says when it is allowed to."""
    target = tmp_path / "done"

    class Hostile:
        def __reduce__(self) -> tuple[object, tuple[str, ...]]:
            return (os.mkdir, (str(target),))

    np.savez(tmp_path / "bad.npz", t_s=np.array([Hostile()], object), x_m=[0.0], force_n=[0.0])
    with pytest.raises(HapticdError, match=r"is no \.npz file of numbers"):
        open_source(tmp_path / "bad.npz")
    assert not target.exists()


def test_without_the_extras_the_command_says_what_to_install(tmp_path: Path) -> None:
    hide = "import sys; sys.modules['matplotlib'] = None; from hapticd.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", hide, "plot", "run.csv", "-o", "run.png"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr == "hapticd: plots need matplotlib: pip install 'hapticd[study,record]'\n"
