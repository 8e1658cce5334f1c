"""The helper that takes the force away is ready before there can be a force; the daemon says so where there is none.

What the loop's process waits for at its start does not count as a loop that stands still.
"""

from __future__ import annotations

from pathlib import Path

from tests.daemon.running import Daemon, Subscriber
from tests.daemon.test_deaths import PRESSED, pressing

WITNESS = """
import sys, time
from pathlib import Path
if "hapticd.supervisor.force_release" in sys.orig_argv:
    HELPER
elif "hapticd.loop.process" in sys.orig_argv:
    Path(__file__).with_name("control").write_text(str(time.monotonic_ns()))
"""

LATE = """
    began_s = time.monotonic()
    while not Path(__file__).with_name("control").exists() and time.monotonic() < began_s + 8.0:
        time.sleep(0.01)
    time.sleep(2.0)
    Path(__file__).with_name("helper").write_text(str(time.monotonic_ns()))
"""
"""Ready two seconds after the loop's process has begun, which needs less than one to open its device."""

OPENED = """
import time
from pathlib import Path
from hapticd_drivers.loopback import Loopback
class Opened(Loopback):
    def _open(self):
        Path(__file__).with_name("opened").write_text(str(time.monotonic_ns()))
        return super()._open()
"""


def test_no_device_is_opened_before_the_helper_is_ready(tmp_path: Path) -> None:
    """The loop's process imports what it needs in the meantime, and waits."""
    (tmp_path / "sitecustomize.py").write_text(WITNESS.replace("HELPER", LATE))
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab/__init__.py").touch()
    (tmp_path / "lab/opened.py").write_text(OPENED)
    with Daemon('[device]\ndriver = "lab.opened"\n', pythonpath=tmp_path).wait_ready():
        began, helper, opened = (int((tmp_path / name).read_text()) for name in ("control", "helper", "lab/opened"))
    assert helper < opened
    assert began < helper, "both start at the same time, or this shows nothing"


def test_a_daemon_without_its_helper_runs_and_says_so(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(WITNESS.replace("HELPER", "raise SystemExit(1)"))
    with Daemon(PRESSED, pythonpath=tmp_path).wait_ready() as daemon, Subscriber(daemon.endpoint) as subscriber:
        pressing(daemon)
        assert daemon.output().count("no helper is ready") == 1
        warnings = subscriber.until("hapticd/status", armed=True)["warnings"]
        assert any("no helper is ready" in warning for warning in warnings)


SLOW_THREADS = """
import sys, threading, time
if "hapticd.loop.process" in sys.orig_argv:
    start = threading.Thread.start
    def late(self):
        time.sleep(0.5)
        start(self)
    threading.Thread.start = late
"""


def test_a_computer_that_is_slow_to_begin_a_thread_lets_the_loop_start(tmp_path: Path) -> None:
    """The loop waited for its thread, an ordinary one at first, in the 0.1 s in which its first tick has to come."""
    (tmp_path / "sitecustomize.py").write_text(SLOW_THREADS)
    with Daemon("", pythonpath=tmp_path).wait_ready() as daemon:
        assert "stood still" not in daemon.output()
