"""The control process as the supervisor sees it: start it, look after it, end it."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from typing import Any

from hapticd.config.loading import LoadedConfig
from hapticd.config.models import MAX_WALLS
from hapticd.contracts.driver import DeviceInfo
from hapticd.contracts.errors import ConfigError, HapticdError
from hapticd.contracts.record import RecordLayout
from hapticd.control.process import packed, receive
from hapticd.control.shared import RECORDS, SUPERVISOR_BEAT, RecordReader, SharedMemory

START_TIMEOUT_S = 30.0
"""How long the device may take to open before the start counts as failed [s]."""

END_TIMEOUT_S = 1.0
"""How long the loop may take to ramp its force out [s]."""

STALL_S = 0.1
"""How long the loop may stand still before it is given up [s]; at least ten periods."""


class Control:
    """A running control process.

    Args:
        config: what it runs.

    Attributes:
        info: what the device declared.
        realtime: whether its scheduling and memory are as a loop needs them.
        warnings: what it could not have, and who can grant it.
        shared: the memory shared with it.
        reader: its tick records.

    Raises:
        HapticdError: it refused to start; with its own message and exit code.
    """

    def __init__(self, config: LoadedConfig) -> None:
        ours, theirs = socket.socketpair()
        with ours, theirs:
            # In a session of its own, so that the terminal's interrupt reaches the supervisor alone.
            self.process = subprocess.Popen(
                [
                    *(sys.executable, "-m", "hapticd.control.process"),
                    *("--socket", str(theirs.fileno()), "--parent", str(os.getpid())),
                ],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                start_new_session=True,
            )
            theirs.close()
            try:
                hello, descriptor = self._greet(ours, config)
            except BaseException:
                self.kill()
                raise
        info: dict[str, Any] = hello["info"]
        info["axes"] = tuple(info["axes"])
        info["workspace_m"] = tuple(tuple(span) for span in info["workspace_m"])
        self.info = DeviceInfo(**info)
        self.realtime: bool = hello["realtime"]
        self.warnings: list[str] = hello["warnings"]
        layout = RecordLayout(len(self.info.axes), self.info.has_orientation, MAX_WALLS)
        self.shared = SharedMemory(layout, config.config.loop.rate_hz, descriptor)
        self.reader = RecordReader(self.shared)
        self.stall_s = max(STALL_S, 10.0 * config.config.loop.period_s)
        self._still_s = 0.0
        self._written = 0
        self._looked_s = time.monotonic()

    @property
    def exit_code(self) -> int | None:
        """How the process ended; None while it runs."""
        return self.process.poll()

    def beat(self) -> None:
        """Show the loop that the supervisor lives."""
        self.shared.words[SUPERVISOR_BEAT] = time.monotonic_ns()

    def stalled(self) -> bool:
        """Whether the loop has stood still for too long.

        Only time in which this process itself ran counts, so that a computer that froze as a whole is not taken for
        a loop that hangs.
        """
        now_s = time.monotonic()
        looked_s, self._looked_s = self._looked_s, now_s
        written = self.shared.words[RECORDS]
        if written != self._written:
            self._written = written
            self._still_s = 0.0
        else:
            self._still_s += min(now_s - looked_s, 0.02)
        return self._still_s > self.stall_s

    def end(self) -> None:
        """Let the loop ramp its force out and end; kill it when it does not."""
        with contextlib.suppress(ProcessLookupError):
            self.process.terminate()
        try:
            self.process.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self.kill()

    def kill(self) -> None:
        """End the process at once, whatever it is doing."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.process.pid, signal.SIGKILL)
        self.process.wait()

    def close(self) -> None:
        """Let go of the memory; the process must have ended."""
        self.shared.close()

    @staticmethod
    def _greet(channel: socket.socket, config: LoadedConfig) -> tuple[dict[str, Any], int]:
        channel.settimeout(START_TIMEOUT_S)
        try:
            channel.sendall(packed({"text": config.text, "name": str(config.path)}))
            # The descriptor travels with the first byte of the answer.
            head, descriptors, _, _ = socket.recv_fds(channel, 4, 1)
            if len(head) < 4:
                raise EOFError
            hello = receive(channel, head)
        except TimeoutError:
            raise HapticdError(f"the device did not open within {START_TIMEOUT_S:g} s") from None
        except (EOFError, ConnectionError):
            raise HapticdError("the control process died while it started; its last words are above") from None
        if "error" in hello:
            if hello["exit_code"] == ConfigError.exit_code:
                raise ConfigError(*hello["error"].split("\n"))
            raise HapticdError(hello["error"])
        return hello, descriptors[0]
