"""The helper that takes the force away from outside, on its own."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from hapticd.config.loading import parse
from hapticd.supervisor.child import kill
from hapticd.supervisor.force_release import TIMEOUT_S, ForceRelease

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


def test_a_helper_that_somebody_stopped_goes_on(release: ForceRelease) -> None:
    """It was said that the device did not answer, and the device kept its force."""
    assert release.wait_ready()
    os.kill(release._helper.pid, signal.SIGSTOP)
    assert release.release() == "the device is without force"


def test_a_helper_that_cannot_start_is_told(release: ForceRelease, monkeypatch: pytest.MonkeyPatch) -> None:
    release.close()
    monkeypatch.setattr("sys.executable", "/bin/false")
    assert "did not start" in release.release()


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
