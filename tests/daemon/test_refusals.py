"""What cannot run says so in one line, exits 1 or 2, and leaves nothing behind."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
from pathlib import Path

import pytest

from tests.daemon.running import HAPTICD, PATIENCE_S, Daemon, Subscriber
from tests.daemon.test_deaths import PRESSED

SETPRIV = shutil.which("setpriv")


def refused(daemon: Daemon) -> tuple[int, list[str]]:
    """Exit code and lines of a daemon that will not run; it must leave its directory empty."""
    code = daemon.wait_exit()
    run = daemon.directory / "run" / "default"
    assert not run.exists() or not list(run.iterdir()), "a socket or a lock was left behind"
    assert not daemon.control_pid()
    lines = [line for line in daemon.output().splitlines() if line.startswith("hapticd: ")]
    assert "Traceback" not in daemon.output()
    return code, lines


def test_a_second_daemon_of_the_same_instance_is_refused_and_the_first_goes_on() -> None:
    with Daemon(PRESSED).wait_ready() as first:
        environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(first.directory / "run")}
        outcome = subprocess.run(
            [HAPTICD, "run", "--config", str(first.config)],
            env=environment,
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )
        assert outcome.returncode == 1
        assert outcome.stderr.count("\n") == 1
        assert f"already running (process {first.process.pid})" in outcome.stderr
        assert "--instance" in outcome.stderr
        assert first.process.poll() is None
        assert (first.directory / "run" / "default" / "telemetry").exists()


@pytest.mark.parametrize(
    ("hook", "failure", "said"),
    [
        ("_open(self)", "return {}['port']", "_open: KeyError: 'port' (own.py:4)"),
        ("__init__(self, *_)", "raise SystemExit(7)", "__init__: SystemExit: 7 (own.py:4)"),
    ],
)
def test_a_driver_of_a_lab_that_fails_to_open_its_device_is_named_in_a_line(
    tmp_path: Path, hook: str, failure: str, said: str
) -> None:
    """It was a traceback, and that the loop had died; an exit of its own was not even that."""
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab/__init__.py").touch()
    driver = (
        f"from hapticd_drivers.loopback import Loopback\nclass Own(Loopback):\n    def {hook}:\n        {failure}\n"
    )
    (tmp_path / "lab/own.py").write_text(driver)
    with Daemon('[device]\ndriver = "lab.own"\n', pythonpath=tmp_path) as daemon:
        assert refused(daemon) == (1, [f"hapticd: driver lab.own.Own: {said}"])


def test_a_taken_tcp_port_is_named() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with Daemon(PRESSED + f'[telemetry]\ntcp = "tcp://127.0.0.1:{port}"\n') as daemon:
            code, lines = refused(daemon)
            assert code == 1
            assert len(lines) == 1
            assert f"tcp://127.0.0.1:{port}" in lines[0]
            assert "telemetry.tcp" in lines[0]


def test_every_problem_of_a_file_is_named_at_once() -> None:
    config = PRESSED.replace("12000.0", "-5.0") + "[loop]\nrate_hz = 50.0\n"
    with Daemon(config) as daemon:
        code, lines = refused(daemon)
        assert code == 2
        assert len(lines) == 2
        assert any("scene.walls[0].stiffness_n_per_m" in line and "-5.0" in line for line in lines)
        assert any("loop.rate_hz" in line and "100" in line for line in lines)


def test_an_unknown_driver_is_named_with_those_installed() -> None:
    with Daemon('[device]\ndriver = "loopbak"\n') as daemon:
        code, lines = refused(daemon)
        assert code == 2
        assert len(lines) == 1
        assert "loopbak" in lines[0]
        assert "loopback" in lines[0]


def test_walls_on_two_axes_of_a_single_axis_device_are_named() -> None:
    walls = "".join(f'[[scene.walls]]\naxis = "{axis}"\nstiffness_n_per_m = 1.0\n' for axis in "xy")
    with Daemon(walls) as daemon:
        code, lines = refused(daemon)
        assert code == 2
        assert len(lines) == 1
        assert "scene.walls[1].axis" in lines[0]


@pytest.mark.skipif(SETPRIV is None or os.geteuid() != 0, reason="needs root and util-linux's setpriv")
def test_required_realtime_without_the_rights_says_what_to_grant() -> None:
    prefix = ("setpriv", "--bounding-set", "-sys_nice,-ipc_lock,-sys_resource")
    limits = ("prlimit", "--memlock=65536:65536", "--rtprio=0:0")
    with Daemon('[loop]\nrealtime = "required"\n', prefix=(*limits, *prefix)) as daemon:
        code, lines = refused(daemon)
        assert code == 1
        assert len(lines) == 1
        for grant in ("CAP_SYS_NICE", "CAP_IPC_LOCK", "rtprio", "memlock"):
            assert grant in lines[0]


@pytest.mark.skipif(SETPRIV is None or os.geteuid() != 0, reason="needs root and util-linux's setpriv")
def test_preferred_realtime_without_the_rights_runs_with_a_standing_warning() -> None:
    prefix = ("setpriv", "--bounding-set", "-sys_nice,-ipc_lock,-sys_resource")
    limits = ("prlimit", "--memlock=65536:65536", "--rtprio=0:0")
    with Daemon(PRESSED, prefix=(*limits, *prefix)).wait_ready() as daemon, Subscriber(daemon.endpoint) as subscriber:
        status = subscriber.until("hapticd/status", realtime=False)
        assert any("SCHED_FIFO" in warning for warning in status["warnings"])


@pytest.mark.skipif(SETPRIV is None or os.geteuid() != 0, reason="needs root and util-linux's setpriv")
def test_a_runtime_directory_that_this_user_may_not_write_is_named() -> None:
    daemon = Daemon(PRESSED, prefix=("setpriv", "--bounding-set", "-dac_override,-dac_read_search"), closed=True)
    with daemon:
        code, lines = refused(daemon)
        assert code == 1
        assert len(lines) == 1
        assert str(daemon.directory / "run") in lines[0]
        assert "HAPTICD_RUNTIME_DIR" in lines[0]
