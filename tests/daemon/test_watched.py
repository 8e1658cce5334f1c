"""`hapticd run --watch`: what `make run` does, at a real terminal."""

from __future__ import annotations

import os
import pty
import select
import subprocess
import time
from pathlib import Path

from tests.daemon.running import HAPTICD, PATIENCE_S

CONFIG = Path(__file__).parents[2] / "config" / "hapticd.toml"


class Terminal:
    """A command at a pseudo-terminal of 80x24."""

    def __init__(self, *command: str, environment: dict[str, str]) -> None:
        ours, theirs = pty.openpty()
        environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24", **environment}
        self.process = subprocess.Popen(
            command, stdin=theirs, stdout=theirs, stderr=theirs, env=environment, start_new_session=True
        )
        os.close(theirs)
        self._descriptor = ours
        self.shown = ""

    def until(self, text: str) -> None:
        """Read until the terminal has shown this."""
        end_s = time.monotonic() + PATIENCE_S
        while text not in self.shown:
            assert time.monotonic() < end_s, f"never showed {text!r}: {self.shown[-2000:]}"
            if select.select([self._descriptor], [], [], 0.1)[0]:
                try:
                    self.shown += os.read(self._descriptor, 65536).decode(errors="replace")
                except OSError:  # the other side is gone
                    assert text in self.shown, self.shown[-2000:]

    def type(self, keys: bytes) -> None:
        os.write(self._descriptor, keys)

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._descriptor)


def test_from_one_command_to_a_live_view_and_back(tmp_path: Path) -> None:
    text = CONFIG.read_text().replace('tcp = "tcp://127.0.0.1:9872"', "")
    config = tmp_path / "lab.toml"
    config.write_text(text)
    command = (HAPTICD, "run", "--config", str(config), "--watch")
    terminal = Terminal(*command, environment={"HAPTICD_RUNTIME_DIR": str(tmp_path)})
    try:
        terminal.until("ARMED")
        terminal.until("energy-cycle")
        terminal.type(b"q")
        terminal.until("stopped")
        assert terminal.process.wait(PATIENCE_S) == 0
        assert not list((tmp_path / "default").iterdir()), "the daemon has cleaned up after itself"
    finally:
        terminal.close()


def test_a_daemon_that_cannot_start_says_why_and_ends_the_view(tmp_path: Path) -> None:
    config = tmp_path / "lab.toml"
    config.write_text("[safety]\nmax_force_n = 500.0\n")
    command = (HAPTICD, "run", "--config", str(config), "--watch")
    terminal = Terminal(*command, environment={"HAPTICD_RUNTIME_DIR": str(tmp_path)})
    try:
        terminal.until("safety.max_force_n")
        assert terminal.process.wait(PATIENCE_S) == 2
    finally:
        terminal.close()
