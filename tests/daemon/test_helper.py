"""The helper that takes the force away stands by before there can be a force, or its absence is told."""

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


def test_no_control_process_is_started_before_the_helper_stands_by(tmp_path: Path) -> None:
    late = 'time.sleep(1.5); Path(__file__).with_name("helper").write_text(str(time.monotonic_ns()))'
    (tmp_path / "sitecustomize.py").write_text(WITNESS.replace("HELPER", late))
    with Daemon(PRESSED, pythonpath=tmp_path).wait_ready():
        assert int((tmp_path / "helper").read_text()) < int((tmp_path / "control").read_text())


def test_a_daemon_without_its_helper_runs_and_says_so(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(WITNESS.replace("HELPER", "raise SystemExit(1)"))
    with Daemon(PRESSED, pythonpath=tmp_path).wait_ready() as daemon, Subscriber(daemon.endpoint) as subscriber:
        pressing(daemon)
        assert daemon.output().count("no helper is ready") == 1
        warnings = subscriber.until("hapticd/status", armed=True)["warnings"]
        assert any("no helper is ready" in warning for warning in warnings)
