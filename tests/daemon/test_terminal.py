"""A daemon at a terminal of its own: one that is closed ends it, one that is stopped does not stop it."""

from __future__ import annotations

import errno
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from hapticd.client.commands import command
from hapticd.supervisor import terminal as supervising
from tests.daemon.running import HAPTICD, PATIENCE_S, wait_until
from tests.daemon.terminal import Terminal

GO_ON = b"\x11"
"""Ctrl-Q."""
RUN = (HAPTICD, "run", "--config", "lab.toml")


@pytest.fixture
def laboratory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "lab.toml").write_text("")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("HAPTICD_STATE_DIR", str(tmp_path))
    return tmp_path


@pytest.fixture
def terminal(laboratory: Path) -> Iterator[Terminal]:
    """With a running daemon."""
    terminal = Terminal(*RUN, environment={})
    terminal.until("armed")
    yield terminal
    terminal.close()


def test_the_end_of_its_terminal_is_the_end_of_a_daemon(terminal: Terminal, laboratory: Path) -> None:
    """Whoever had it before their eyes cannot stop it any more."""
    terminal.hang_up()
    assert terminal.process.wait(PATIENCE_S) == 0
    assert not list((laboratory / "default").iterdir()), "the daemon has cleaned up after itself"


def test_at_a_terminal_too_sighup_from_a_person_is_a_reload(terminal: Terminal) -> None:
    """Also where each process of the daemon gets one, as `systemctl kill -s HUP` has it."""
    tasks = Path(f"/proc/{terminal.process.pid}/task").glob("*/children")
    children = [int(pid) for task in tasks for pid in task.read_text().split()]
    assert len(children) == 2, "the loop and what takes its force away"
    for pid in (*children, terminal.process.pid):
        os.kill(pid, signal.SIGHUP)
    terminal.until("goes on")
    assert command("status")["status"]["armed"]


@pytest.mark.parametrize("number", [errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EPERM])
def test_a_terminal_that_cannot_be_opened_is_not_closed(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """SIGHUP from a person ended a daemon that was out of descriptors."""
    why = [0]

    def opened(*_: object) -> int:
        if why[0]:
            raise OSError(why[0], os.strerror(why[0]))
        return os.dup(0)

    monkeypatch.setattr(os, "open", opened)
    started_at = supervising.Terminal()
    why[0] = number
    assert not started_at.closed()
    why[0] = errno.ENXIO
    assert started_at.closed()


def test_a_daemon_under_nohup_outlives_its_terminal(laboratory: Path) -> None:
    terminal = Terminal("nohup", *RUN, environment={})
    try:
        log = laboratory / "nohup.out"
        wait_until(lambda: log.exists() and "armed" in log.read_text(), "the daemon to run")
        terminal.hang_up()
        wait_until(lambda: "goes on" in log.read_text(), "the reload that a hang-up is then")
        assert command("status")["status"]["armed"]
        command("stop")
        assert terminal.process.wait(PATIENCE_S) == 0
    finally:
        terminal.close()


def test_a_daemon_whose_terminal_is_stopped_still_obeys(terminal: Terminal) -> None:
    """Its lines wait for the terminal; `hapticd disarm` at another one must not."""
    terminal.stop()
    for _ in range(3):
        command("disarm", timeout_s=PATIENCE_S)
        command("arm", timeout_s=PATIENCE_S)
    assert not terminal.has_shown("disarm")
    terminal.type(GO_ON)
    terminal.until("disarmed")
    terminal.stop()
    command("stop", timeout_s=PATIENCE_S)
    assert terminal.process.wait(PATIENCE_S) == 0
