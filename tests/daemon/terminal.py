"""A real terminal for a test."""

from __future__ import annotations

import os
import pty
import select
import subprocess
import time

from tests.daemon.running import PATIENCE_S


class Terminal:
    """A command at a pseudo-terminal of 80x24, which is its controlling one."""

    def __init__(self, *command: str, environment: dict[str, str]) -> None:
        ours, theirs = pty.openpty()
        environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24", **environment}
        self.process = subprocess.Popen(
            ("setsid", "--ctty", *command), stdin=theirs, stdout=theirs, stderr=theirs, env=environment
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

    def is_silent(self) -> bool:
        """Whether there is nothing more to be read."""
        return not select.select([self._descriptor], [], [], 0.0)[0]

    def hang_up(self) -> None:
        """Close the terminal's window."""
        os.close(self._descriptor)
        self._descriptor = -1

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        if self._descriptor >= 0:
            self.hang_up()
