"""The witness of a computer that stands still: what it sees, and what runs again for it and what does not."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests import standstill
from tests.daemon.running import wait_until

ROOT = Path(__file__).parent.parent

CONFTEST = """
from tests import standstill
def pytest_runtest_protocol(item, nextitem):
    return standstill.run(item, nextitem)
"""

TEST = """
import gc
import subprocess
from pathlib import Path
import pytest
from tests import standstill
@pytest.fixture(scope="module")
def daemon():
    daemons = Path(__file__).with_name("daemons")
    daemons.write_text(daemons.read_text() + "x")
    return len(daemons.read_text())
def test_before(daemon):
    assert daemon == 1
def test_that_fails_at_first(daemon):
    runs = Path(__file__).with_name("runs")
    runs.write_text(runs.read_text() + "x")
    {during}
    left = subprocess.Popen("true")
    assert daemon > 1
    left.wait()
def test_after(daemon):
    gc.collect()
    assert daemon == len(Path(__file__).with_name("runs").read_text())
"""

STOOD = "standstill.longest_s = lambda since_s, kind=0: 0.2 * (kind == 0)"
CRAWLED = "standstill.longest_s = lambda since_s, kind=0: 2e-4 * (kind == 1)"
NEITHER = "standstill.longest_s = lambda since_s, kind=0: 0.0"


def may_be_realtime() -> bool:
    limits = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(99))"
    return subprocess.run([sys.executable, "-c", limits], capture_output=True, check=False).returncode == 0


def witness_pids() -> list[int]:
    children = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text().split()
    return [int(pid) for pid in children if b"SCHED_FIFO" in Path(f"/proc/{pid}/cmdline").read_bytes()]


def test_a_witness_whose_computation_crawls_tells_for_how_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where any takes too long: it tells of all of them, with their times, and not as standstills."""
    monkeypatch.setitem(os.environ, standstill.PLACE, "")
    monkeypatch.setattr(standstill, "_WITNESS", standstill._WITNESS.replace(str(standstill.CRAWL_S), "0.0"))
    with standstill.witnesses():
        began_s = time.monotonic()
        if not may_be_realtime():
            assert standstill.excuse(began_s - 1.0) == ""
            return
        wait_until(lambda: standstill.longest_s(began_s, 1) > 0.0, "a computation")
        assert 1e-7 < standstill.longest_s(began_s, 1) < 1.0, "a duration, and no point in time"
        assert standstill.longest_s(time.monotonic() + 1.0, 1) == 0.0
        if not standstill.longest_s(began_s):
            assert "us what takes" in standstill.excuse(began_s)


def test_a_witness_that_got_no_processor_tells_for_how_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(os.environ, standstill.PLACE, "")
    with standstill.witnesses():
        began_s = time.monotonic()
        if not may_be_realtime():
            assert standstill.longest_s(began_s - 1.0) == 0.0
            return
        for pid in witness_pids():
            wait_until(lambda pid=pid: os.sched_getscheduler(pid) == os.SCHED_FIFO, "a witness")
            os.kill(pid, signal.SIGSTOP)
        time.sleep(0.3)
        for pid in witness_pids():
            os.kill(pid, signal.SIGCONT)
        wait_until(lambda: standstill.longest_s(began_s) > 0.2, "a standstill")
        assert standstill.longest_s(time.monotonic() + 1.0) == 0.0


@pytest.mark.parametrize(("during", "runs", "code"), [(NEITHER, 1, 1), (STOOD, 2, 0), (CRAWLED, 2, 0)])
def test_what_fails_runs_again_only_where_the_computer_stood_still_or_crawled(
    tmp_path: Path, during: str, runs: int, code: int
) -> None:
    """And then with another daemon, which those after it have too: the one before has ended.

    What it did not close by then fails no other test.
    """
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_it.py").write_text(TEST.format(during=during))
    for counted in ("runs", "daemons"):
        (tmp_path / counted).write_text("")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-W", "error", "--rootdir=.", "."]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTEST_ADDOPTS": ""}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stdout
    assert len((tmp_path / "runs").read_text()) == runs
