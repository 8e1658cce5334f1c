"""`hapticd run --watch`: what `make run` does, at a real terminal."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.daemon.running import HAPTICD, PATIENCE_S, child_pid, wait_until
from tests.daemon.terminal import Terminal

CONFIG = Path(__file__).parents[2] / "config" / "hapticd.toml"

CTRL_S, CTRL_Q = b"\x13", b"\x11"


@contextmanager
def watched(place: Path, text: str) -> Iterator[Terminal]:
    """A daemon on a terminal with a view of it; its runtime directory is the place."""
    config = place / "lab.toml"
    config.write_text(text)
    command = (HAPTICD, "run", "--config", str(config), "--watch")
    terminal = Terminal(*command, environment={"HAPTICD_RUNTIME_DIR": str(place)})
    try:
        yield terminal
    finally:
        terminal.close()


def test_from_one_command_to_a_live_view_and_back(tmp_path: Path) -> None:
    text = CONFIG.read_text().replace('tcp = "tcp://127.0.0.1:9872"', "")
    with watched(tmp_path, text) as terminal:
        terminal.until("ARMED")
        terminal.until("ring-damping")
        terminal.type(b"q")
        terminal.until("stopped")
        assert terminal.process.wait(PATIENCE_S) == 0
        assert not list((tmp_path / "default").iterdir()), "the daemon has cleaned up after itself"


def test_a_daemon_that_cannot_start_says_why_and_ends_the_view(tmp_path: Path) -> None:
    with watched(tmp_path, "[safety]\nmax_force_n = 500.0\n") as terminal:
        terminal.until("safety.max_force_n")
        assert terminal.process.wait(PATIENCE_S) == 2


def test_that_a_daemon_was_killed_is_said(tmp_path: Path) -> None:
    with watched(tmp_path, "") as terminal:
        terminal.until("ARMED")
        os.kill(child_pid(terminal.process.pid, "run"), signal.SIGKILL)
        terminal.until("the daemon was killed (SIGKILL)")
        assert terminal.process.wait(PATIENCE_S) == 128 + signal.SIGKILL


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
def test_a_daemon_does_not_outlive_whoever_started_it_with_a_view(tmp_path: Path, end: signal.Signals) -> None:
    """Else an armed device would go on with nobody before it."""
    with watched(tmp_path, "") as terminal:
        terminal.until("ARMED")
        terminal.process.send_signal(end)
        terminal.process.wait(PATIENCE_S)
        wait_until(lambda: not list((tmp_path / "default").iterdir()), "the daemon to end")


def test_a_view_that_a_stopped_terminal_holds_up_keeps_no_daemon(tmp_path: Path) -> None:
    """Nor its force: the view cannot even say that it ends."""
    with watched(tmp_path, "") as terminal:
        terminal.until("ARMED")
        terminal.type(CTRL_S)
        terminal.process.send_signal(signal.SIGINT)
        wait_until(lambda: not list((tmp_path / "default").iterdir()), "the daemon to end")
        terminal.type(CTRL_Q)
        terminal.until("stopped")
        assert terminal.process.wait(PATIENCE_S) == 0
