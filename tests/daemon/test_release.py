"""The helper that takes the force away from outside, on its own."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from unittest.mock import Mock, call

import pytest

from hapticd.config.loading import parse
from hapticd.device import DeviceInfo
from hapticd.loop.resume import identity
from hapticd.simulation.options import SimulationOptions
from hapticd.supervisor.child import kill
from hapticd.supervisor.daemon import Daemon
from hapticd.supervisor.force_release import READY_TIMEOUT_S, TIMEOUT_S, ForceRelease
from hapticd.supervisor.systemd import Notifier
from hapticd_drivers.loopback import Loopback

CONFIG = '[loop]\nrealtime = "off"\n[device]\ndriver = "loopback"\n'


@pytest.fixture
def release() -> Iterator[ForceRelease]:
    helper = ForceRelease(parse(CONFIG, "lab.toml"))
    yield helper
    helper.close()


def test_a_helper_that_is_slow_to_start_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy computer the imports take longer than a device may; the device's time begins after them."""
    (tmp_path / "sitecustomize.py").write_text(f"import time\ntime.sleep({TIMEOUT_S + 1.0})\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    helper = ForceRelease(parse(CONFIG, "lab.toml"))
    assert helper.release() == "the device is without force"
    helper.close()


def test_a_helper_that_somebody_killed_is_replaced(release: ForceRelease) -> None:
    assert release.wait_ready()
    os.kill(release._helper.pid, signal.SIGKILL)
    release._helper.wait()
    assert release.release() == "the device is without force"


def test_a_helper_that_has_done_its_work_is_followed_by_another(release: ForceRelease) -> None:
    for _ in range(2):
        assert release.wait_ready()
        assert release.release() == "the device is without force"
        release.renew()
    assert release.wait_ready()
    assert release.problem == ""


def test_a_helper_that_is_on_its_way_is_not_called_one_that_did_not_start(
    release: ForceRelease, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A daemon that had just used one said that it had none, and to restart it."""
    assert release.problem == ""
    monkeypatch.setattr(ForceRelease, "wait_ready", lambda *_: False)
    now_s = time.monotonic() + READY_TIMEOUT_S
    monkeypatch.setattr("hapticd.supervisor.force_release.time.monotonic", lambda: now_s)
    assert release.problem.startswith("no helper is ready")


def test_a_helper_that_somebody_stopped_goes_on(release: ForceRelease) -> None:
    """It was said that the device did not answer, and the device kept its force."""
    assert release.wait_ready()
    os.kill(release._helper.pid, signal.SIGSTOP)
    assert release.release() == "the device is without force"


@pytest.mark.parametrize("interpreter", ["/bin/false", "/gone/python"])
@pytest.mark.parametrize("threads", [True, False])
def test_where_no_helper_can_be_had_the_daemon_itself_takes_the_force_away(
    release: ForceRelease, monkeypatch: pytest.MonkeyPatch, interpreter: str, threads: bool
) -> None:
    """It was said that the device has to, or, where no process could be started, the daemon ended first."""
    done: list[str] = []
    opened = Loopback._open

    def _open(self: Loopback) -> DeviceInfo:
        done.append("open")
        return opened(self)

    monkeypatch.setattr(Loopback, "_open", _open)
    monkeypatch.setattr(Loopback, "_disable", lambda _: done.append("disable"))
    if not threads:
        monkeypatch.setattr(threading.Thread, "start", Mock(side_effect=RuntimeError("can't start new thread")))
    os.kill(release._helper.pid, signal.SIGKILL)
    release._helper.wait()
    monkeypatch.setattr("sys.executable", interpreter)
    said = release.release()
    assert said.startswith("the helper that takes the force away did not start (")
    assert said.endswith("; without it, the device is without force")
    assert done == ["open", "disable"]


def test_a_driver_that_hangs_holds_the_daemon_up_no_longer_than_its_helper(
    release: ForceRelease, monkeypatch: pytest.MonkeyPatch
) -> None:
    ends = threading.Event()
    monkeypatch.setattr(Loopback, "_open", lambda _: ends.wait())
    monkeypatch.setattr("hapticd.supervisor.force_release.TIMEOUT_S", 0.05)
    release.close()
    monkeypatch.setattr("sys.executable", "/gone/python")
    assert "did not answer" in release.release()
    ends.set()


def test_systemd_is_told_that_the_daemon_lives_for_as_long_as_helper_and_driver_hang(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was not for up to 5 s, after which systemd ends a daemon that could have gone on."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        systemd.settimeout(30.0)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "100000")
        monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()))
        daemon = Daemon.__new__(Daemon)
        daemon._notifier = Notifier()
        hanging = Mock()
        fed: list[bytes] = []

        def release() -> str:
            fed.extend(systemd.recv(64) for _ in range(4))  # it hangs until then
            return "the device did not answer"

        hanging.release.side_effect = release
        daemon.release = hanging
        daemon._rescue("the control loop did not end and was killed")
        assert daemon._notifier._socket
        daemon._notifier._socket.close()
    assert fed == [b"WATCHDOG=1"] * 4
    assert hanging.mock_calls == [call.release(), call.renew()]


def test_what_a_driver_raises_is_told_in_a_line(release: ForceRelease, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Loopback, "_open", Mock(side_effect=OSError("no such cable")))
    release.close()
    monkeypatch.setattr("sys.executable", "/gone/python")
    said = "driver hapticd_drivers.loopback.Loopback: _open: OSError: no such cable"
    assert release.release().endswith(f"without it, the device could not be opened: {said}")


class _Unkillable(subprocess.Popen[bytes]):
    """Stands for a process that waits inside the kernel for its hardware: no signal ends it."""

    def wait(self, timeout: float | None = None) -> int:
        assert timeout is not None, "whoever waits for it without an end hangs as well"
        raise subprocess.TimeoutExpired(self.args, timeout)


def test_a_control_process_that_cannot_be_killed_does_not_keep_the_force_from_being_taken_away(
    release: ForceRelease,
) -> None:
    with _Unkillable(["/bin/sleep", "1000"]) as stuck:
        kill(stuck)
        assert release.release() == "the device is without force"
        subprocess.Popen.wait(stuck, 60.0)
        stuck.wait = partial(subprocess.Popen.wait, stuck)  # type: ignore[method-assign]  # it is gone


def test_the_number_of_a_control_process_that_has_ended_is_sent_no_signal(monkeypatch: pytest.MonkeyPatch) -> None:
    """It may be another's by then, and the daemon may be root's."""
    with subprocess.Popen(["/bin/true"]) as ended:
        ended.wait()
        sent: list[tuple[int, int]] = []
        monkeypatch.setattr(os, "kill", lambda *whom: sent.append(whom))
        kill(ended)
        assert sent == []


def test_a_driver_that_could_not_take_the_force_away_is_not_called_one_that_did(
    release: ForceRelease, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a driver raises there was swallowed, and the device called one without force."""
    monkeypatch.setattr(Loopback, "_disable", Mock(side_effect=OSError("no answer")))
    release.close()
    monkeypatch.setattr("sys.executable", "/gone/python")
    assert release.release().endswith("without it, the device did not let go: _disable: OSError: no answer")
    assert release.force_left.endswith("_disable: OSError: no answer")


@pytest.mark.parametrize("helper", [True, False])
def test_another_device_of_the_same_kind_is_not_taken_for_the_one_with_the_force(
    release: ForceRelease, monkeypatch: pytest.MonkeyPatch, helper: bool
) -> None:
    """With no serial number configured it was opened instead, and the one that hung called without force."""
    found = identity(Loopback(SimulationOptions(), 1e-3).open())
    if helper:
        assert release.wait_ready()
    else:
        release.close()
        monkeypatch.setattr("sys.executable", "/gone/python")
    release.name("omega.7 17 (x, y, z)")
    assert release.release().endswith(f"the device could not be opened: found {found} instead of omega.7 17 (x, y, z)")
    assert "found" in release.force_left
    if helper:
        release.renew()
    release.name(found)
    assert release.release().endswith("the device is without force")
    assert release.force_left == ""
