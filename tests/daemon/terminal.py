"""A real terminal for a test."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import signal
import subprocess
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

from tests.daemon.running import PATIENCE_S, wait_until


class Terminal:
    """A command at a pseudo-terminal of 80x24, which is its controlling one."""

    def __init__(self, *command: str, environment: dict[str, str]) -> None:
        ours, theirs = pty.openpty()
        self._mark = f"TERMINAL_OF_A_TEST={uuid.uuid4()}"
        name, _, value = self._mark.partition("=")
        screen = {"TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24"}
        environment = {**os.environ, **screen, name: value, **environment}
        self.process = subprocess.Popen(
            ("setsid", "--ctty", *command), stdin=theirs, stdout=theirs, stderr=theirs, env=environment
        )
        self._place = os.ttyname(theirs)
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

    def stop(self) -> None:
        """Type Ctrl-S; return when the kernel has taken it, which it does by and by."""
        self.type(b"\x13")
        line = os.open(self._place, os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)

        def is_stopped() -> bool:
            try:
                os.write(line, b".")
            except BlockingIOError:
                return True
            return False

        try:
            wait_until(is_stopped, "the terminal to be stopped")
        finally:
            os.close(line)

    def has_shown(self, text: str) -> bool:
        """Whether the terminal shows this, by now."""
        while select.select([self._descriptor], [], [], 0.0)[0]:
            self.shown += os.read(self._descriptor, 65536).decode(errors="replace")
        return text in self.shown

    def hang_up(self) -> None:
        """Close the terminal's window."""
        os.close(self._descriptor)
        self._descriptor = -1

    def close(self) -> None:
        """End whatever was started here: a daemon that should have ended with the command, but did not, as well."""
        self.process.kill()
        self.process.wait()
        wait_until(lambda: not self._kill_rest(), "the end of all that the command has started")
        if self._descriptor >= 0:
            self.hang_up()

    def _kill_rest(self) -> bool:
        """Kill processes whose environment comes from here, also those in sessions of their own; whether any was."""
        rest = list(self._marked())
        for pid in rest:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        return bool(rest)

    def _marked(self) -> Iterator[int]:
        for environment in Path("/proc").glob("[0-9]*/environ"):
            with contextlib.suppress(OSError):  # ended, or somebody else's
                if self._mark.encode() in environment.read_bytes().split(b"\0"):
                    yield int(environment.parent.name)
