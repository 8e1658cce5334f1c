"""`hapticd simulate`: the daemon's numbers without the daemon, and nothing done that a check could have stopped."""

from __future__ import annotations

import csv
import itertools
import json
import os
import pty
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hapticd.config.loading import load, parse
from hapticd.offline import traces
from hapticd.offline.run import Row
from hapticd.offline.simulate import simulate as run_offline
from hapticd.offline.traces import open_trace
from tests.daemon.running import Daemon, all_records, wait_until
from tests.shipped import CONFIG, SIMULATED

HAPTICD = Path(sys.executable).with_name("hapticd")
WALL_12 = CONFIG / "wall-12-energy-cycle.toml"
DIVERGING = """
[device.options]
model = "paper-simulation"
viscous_n_s_per_m = -50.0
hand.force = { profile = "constant", newton = -5.0 }
[[scene.walls]]
stiffness_n_per_m = 3000.0
[controller]
law = "none"
[safety]
profile = "simulation"
"""


def simulate(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [HAPTICD, "simulate", *arguments],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def rows_of(path: Path) -> list[dict[str, float]]:
    with path.open(newline="") as file:
        return [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]


def rows(config: Path, duration_s: float) -> list[Row]:
    kept: list[Row] = []
    run_offline(load(config), duration_s, take=kept.append)
    return kept


# -- the numbers


SPACE = """
    axes = 3
    space.hand.force = { profile = "constant", newton = [0.0, 0.0, -5.0] }
    [[scene.objects]]
    name = "floor"
    shape = "plane"
    stiffness_n_per_m = 2000.0
    """
WALLS = """
    hand.force = { profile = "constant", newton = -5.0 }
    [[scene.walls]]
    stiffness_n_per_m = 2000.0
    """


@pytest.mark.parametrize("scene", [WALLS, SPACE])
def test_a_run_tells_from_which_tick_on_a_fault_takes_the_force_away(scene: str) -> None:
    """Else the handle that is pushed out for good looks like one that was let go."""
    fast = f"[safety]\nmax_speed_m_per_s = 0.01\n[device.options]\n{scene}\n"
    run = run_offline(parse(fast, "fast.toml"), 1.0)
    assert run.fault is not None
    armed = run.columns["armed"]
    assert armed[0] == 1
    assert armed[-1] == 0
    assert list(armed) == sorted(armed, reverse=True)
    assert all(force_n == 0.0 for force_n in list(run.columns["force_n"])[list(armed).index(0) + 60 :])


def test_a_run_has_one_row_a_tick_from_zero_with_the_documented_columns(tmp_path: Path) -> None:
    output = tmp_path / "run.csv"
    done = simulate("--config", WALL_12, "--duration", "0.25", "--output", output)
    assert (done.returncode, done.stderr) == (0, "")
    header = output.read_text().splitlines()[0]
    assert header == (
        "t_s,x_m,v_m_per_s,x_measured_m,force_n,force_requested_n,energy_j,cycle,damping_n_s_per_m,in_contact,armed"
    )
    run = rows_of(output)
    assert [row["t_s"] for row in run] == [count / 1000 for count in range(250)]
    assert {row["in_contact"] for row in run} == {0.0, 1.0}
    assert [path.name for path in tmp_path.iterdir()] == ["run.csv"]


def test_the_numbers_are_the_daemons_to_the_last_bit() -> None:
    """A real daemon and an offline run of the same file, tick by tick; the wall stands elsewhere and faces down."""
    config = """
        [device.options]
        initial_position_m = 0.002
        noise_m = 2e-6
        hand.force = { profile = "press-and-release", newton = -5.0, release_newton = 1.0, period_s = 0.4 }
        [[scene.walls]]
        free_side = "negative"
        position_m = 0.03
        stiffness_n_per_m = 15000.0
        """
    with Daemon(config).wait_ready() as daemon:
        memory = daemon.memory()
        wait_until(lambda: len(all_records(memory)) > 1500, "1500 ticks")
        records = {record.seq: record for record in all_records(memory)}
    kept: list[Row] = []
    run_offline(parse(config, "lab.toml"), 1.5, take=kept.append)
    assert kept[-1].cycle > 3
    for seq, row in enumerate(kept):
        record = records[seq]
        (wall,) = record.walls
        assert row.x_measured_m == -(record.position_m[0] - 0.03), seq
        assert row.force_n == -record.force_n[0], seq
        assert row.force_requested_n == -record.force_requested_n[0], seq
        assert (row.energy_j, row.cycle, row.damping_n_s_per_m, row.in_contact, row.armed) == (
            record.energy_j,
            wall.cycle,
            wall.damping_n_s_per_m,
            wall.in_contact,
            True,
        ), seq


@pytest.mark.parametrize("config", SIMULATED, ids=lambda path: path.stem)
def test_every_shipped_configuration_runs_and_runs_the_same_again(config: Path) -> None:
    first = rows(config, 0.5)
    assert len(first) == 500
    assert rows(config, 0.5) == first


def test_the_true_position_is_finer_than_the_measured_one_and_close_to_it() -> None:
    run = rows(WALL_12, 1.0)
    assert all(abs(row.x_m - row.x_measured_m) <= 1.0001e-5 for row in run)
    assert any(row.x_m != row.x_measured_m for row in run)


def test_energy_is_the_work_of_the_applied_force() -> None:
    run = rows(CONFIG / "wall-20-energy-cycle.toml", 1.0)
    energy_j = 0.0
    for before, row in itertools.pairwise(run):
        energy_j -= before.force_n * (row.x_measured_m - before.x_measured_m)
        assert row.energy_j == pytest.approx(energy_j, rel=1e-9, abs=1e-15)


def test_npz_and_csv_hold_the_same_floats(tmp_path: Path) -> None:
    for name in ("run.csv", "run.npz"):
        done = simulate("-c", WALL_12, "-d", "0.3", "-o", tmp_path / name)
        assert done.returncode == 0, done.stderr
    text = rows_of(tmp_path / "run.csv")
    with np.load(tmp_path / "run.npz") as arrays:
        assert list(arrays) == list(Row._fields)
        for name in Row._fields:
            assert arrays[name].tolist() == [row[name] for row in text]


def test_the_summary_is_what_the_rows_say(tmp_path: Path) -> None:
    output = tmp_path / "run.csv"
    done = simulate("-c", CONFIG / "wall-18-energy-cycle.toml", "-d", "4", "-o", output, "--json")
    said: dict[str, Any] = json.loads(done.stdout)
    run = rows_of(output)
    last = run[-500:]
    depth_m = -sum(row["x_m"] for row in last) / 500
    assert said["peak_to_peak_m"] == max(row["x_m"] for row in last) - min(row["x_m"] for row in last)
    assert said["mean_depth_m"] == pytest.approx(depth_m)
    assert said["displayed_stiffness_n_per_m"] == pytest.approx(sum(row["force_n"] for row in last) / 500 / depth_m)
    assert said["displayed_stiffness_n_per_m"] == pytest.approx(18000.0, rel=0.05)
    assert said["peak_force_n"] == max(abs(row["force_n"]) for row in run)
    assert (said["cycles"], said["damping_n_s_per_m"]) == (run[-1]["cycle"], run[-1]["damping_n_s_per_m"])
    assert (said["ticks"], said["fault"], said["law"]) == (4000, None, "energy-cycle")


# -- what cannot be


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["-d", "0"], "duration = 0 s: must be at least one period, 0.001 s"),
        (["-d", "nan"], "duration = nan s"),
        (["-d", "1e308"], "duration = 1e+308 s: must be at least one period, 0.001 s, and at most 1e+09 s"),
        (["-d", "1", "-o", "run.txt"], "run.txt: must end in .csv or .npz"),
        (["-d", "1", "-o", "nowhere/run.csv"], "nowhere/run.csv: there is no directory nowhere"),
        (["-d", "1", "-o", "old.csv"], "old.csv: exists; add --overwrite to replace it"),
        (["-d", "1e9", "-o", "run.npz"], "run.npz: 1000000000000 ticks take 74 TB of memory and"),
        (["-d", "1e9", "-o", "run.csv"], "run.csv: 1000000000000 ticks take about 132 TB and"),
    ],
)
def test_what_cannot_be_is_said_before_any_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "old.csv").write_text("mine")
    done = simulate("-c", WALL_12, *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"hapticd: {said}"), done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["old.csv"]


def test_problems_of_the_configuration_are_those_of_check(tmp_path: Path) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text("[loop]\nrate_hz = 50\n[controller]\nlaw = 'tdap'\n")
    checked = subprocess.run([HAPTICD, "check", bad], capture_output=True, text=True, check=False)
    done = simulate("-c", bad, "-d", "1")
    assert done.returncode == checked.returncode == 2
    assert done.stderr.splitlines() == [f"hapticd: {line}" for line in checked.stderr.splitlines()]


def test_the_wall_clock_is_refused_since_the_numbers_would_depend_on_the_host(tmp_path: Path) -> None:
    config = tmp_path / "lab.toml"
    config.write_text(WALL_12.read_text().replace("[device.options]", '[device.options]\nclock = "wall"'))
    done = simulate("-c", config, "-d", "1")
    assert done.returncode == 2
    assert 'device.options.clock = "wall": must be "ticks" offline' in done.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "needs --config and --duration, or --replay"),
        (["-c", "nofile.toml"], "needs --duration"),
        (["-d", "1"], "needs --config"),
    ],
)
def test_the_option_that_is_missing_is_named(arguments: list[str], said: str) -> None:
    done = simulate(*arguments)
    assert done.returncode == 2
    assert done.stderr.splitlines()[0] == f"hapticd: Invalid value: {said}"


def test_overwrite_replaces_the_file_only_when_the_run_is_complete(tmp_path: Path) -> None:
    old = tmp_path / "run.csv"
    old.write_text("mine")
    trace = open_trace(old, 10, overwrite=True)

    def broken_run() -> None:
        with trace:
            trace.append(rows(WALL_12, 0.001)[0])
            raise ArithmeticError

    with pytest.raises(ArithmeticError):
        broken_run()
    assert old.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [old]
    assert simulate("-c", WALL_12, "-d", "0.01", "-o", old, "--overwrite").returncode == 0
    assert len(rows_of(old)) == 10


def test_a_trace_beyond_memory_is_refused_with_the_numbers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(traces, "_free_memory", lambda: 73_999)
    said = r"1000 ticks take 74 kB of memory and 74 kB are free; a \.csv is written tick by tick"
    with pytest.raises(Exception, match=said):
        open_trace(tmp_path / "run.npz", 1000, overwrite=False)
    with open_trace(tmp_path / "run.csv", 1000, overwrite=False):
        pass


def test_csv_needs_no_numpy_and_npz_says_what_to_install(tmp_path: Path) -> None:
    (tmp_path / "numpy.py").write_text("raise ModuleNotFoundError(\"No module named 'numpy'\", name='numpy')\n")
    without = {"PYTHONPATH": str(tmp_path)}
    done = simulate("-c", WALL_12, "-d", "0.1", "-o", tmp_path / "run.csv", **without)
    assert (done.returncode, len(rows_of(tmp_path / "run.csv"))) == (0, 100)
    done = simulate("-c", WALL_12, "-d", "0.1", "-o", tmp_path / "run.npz", **without)
    assert done.returncode == 1
    assert "needs numpy: pip install 'hapticd[study]'; a .csv does not" in done.stderr
    assert not list(tmp_path.glob("*.part"))


def test_a_model_that_diverges_ends_the_run_there_and_keeps_its_rows(tmp_path: Path) -> None:
    config = tmp_path / "wild.toml"
    config.write_text(DIVERGING)
    output = tmp_path / "run.csv"
    done = simulate("-c", config, "-d", "60", "-o", output, "--json")
    said = json.loads(done.stdout)
    assert done.returncode == 1
    assert "stopped: 0.1" in done.stderr
    assert said["fault"] in done.stderr
    assert 100 < said["ticks"] == len(rows_of(output)) < 60_000
    assert said["peak_to_peak_m"] > 1.0


def test_progress_is_shown_on_a_terminal_and_nowhere_else() -> None:
    leader, follower = pty.openpty()
    with subprocess.Popen(
        [HAPTICD, "simulate", "-c", WALL_12, "-d", "20"], stdout=subprocess.PIPE, stderr=follower
    ) as process:
        os.close(follower)
        shown = b""
        while True:
            try:
                shown += os.read(leader, 65536)
            except OSError:  # the other end is closed
                break
        assert process.wait() == 0
    os.close(leader)
    assert b"simulating" in shown
    assert simulate("-c", WALL_12, "-d", "1").stderr == ""
