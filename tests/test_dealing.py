"""Every file of a run is run once, each by a worker that may."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

COMPUTING = [f"test_{name}.py" for name in "abcdefgh"]
WAITING = ["test_w.py", "test_x.py", "test_y.py"]
TESTS = 4
"""In each file."""

DEALT = f"""
from tests.dealing import Dealing
def pytest_xdist_make_scheduler(config, log):
    return Dealing(config, log, {WAITING!r}, {{"test_h.py": "test_a.py"}})
"""
TOLD = f"""
import os, pathlib, pytest, time
@pytest.mark.parametrize("number", range({TESTS}))
def test_it(number):
    time.sleep(0.01)
    with open("told", "a") as file:
        file.write(pathlib.Path(__file__).name + " " + os.environ["PYTEST_XDIST_WORKER"] + chr(10))
"""


@pytest.mark.parametrize("workers", [2, 4])
def test_what_waits_has_a_worker_of_its_own_and_what_shares_has_one(tmp_path: Path, workers: int) -> None:
    (tmp_path / "conftest.py").write_text(DEALT)
    for name in (*COMPUTING, *WAITING):
        (tmp_path / name).write_text(TOLD)
    options = ["-q", "-p", "xdist", "--numprocesses", str(workers), "--dist", "loadfile", "--no-loadscope-reorder"]
    environment = {
        **os.environ,
        "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
        "PYTHONPATH": str(Path(__file__).parents[1]),
    }
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    told = [line.split() for line in (tmp_path / "told").read_text().splitlines()]
    assert sorted(name for name, _ in told) == sorted([*COMPUTING, *WAITING] * TESTS)
    by = {name: {worker for one, worker in told if one == name} for name, _ in told}
    assert all(len(each) == 1 for each in by.values())
    assert by["test_a.py"] == by["test_h.py"]
    if workers == 4:
        assert by["test_w.py"] == {"gw3"}
        assert not any("gw3" in by[name] for name in COMPUTING)
    else:
        assert {worker for each in by.values() for worker in each} == {"gw0", "gw1"}
