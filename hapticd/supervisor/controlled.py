"""The control process as the supervisor sees it: look after it, end it."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
from typing import Any

from hapticd.config.loading import LoadedConfig
from hapticd.config.models import MAX_WALLS
from hapticd.contracts.device import DeviceInfo
from hapticd.contracts.record import RecordLayout
from hapticd.control.shared import RECORDS, SKIPPED, SUPERVISOR_BEAT, EventReader, RecordReader, SharedMemory

END_TIMEOUT_S = 1.0
"""How long the loop may take to ramp its force out, or to let go of a device that is lost [s]."""

KILL_TIMEOUT_S = 1.0
"""How long a killed process may take to be gone [s]; one that waits inside the kernel for its hardware stays."""

STALL_S = 0.1
"""How long the loop may stand still before it is given up [s]; at least ten periods."""


class Control:
    """A running control process.

    Args:
        process: the process.
        hello: what it said when it was ready.
        descriptor: of the memory that it shares.
        config: what it runs.

    Attributes:
        info: what the device declared.
        realtime: whether its scheduling and memory are as a loop needs them.
        warnings: what it could not have, and who can grant it.
        accuracy: the device model that it chose, and why; "" when it was not asked to.
        fitted_hash: of the configuration that it chose for.
        shared: the memory shared with it.
        reader: its tick records.
        events: its events.
    """

    def __init__(
        self, process: subprocess.Popen[bytes], hello: dict[str, Any], descriptor: int, config: LoadedConfig
    ) -> None:
        self.process = process
        info: dict[str, Any] = hello["info"]
        info["axes"] = tuple(info["axes"])
        info["workspace_m"] = tuple(tuple(span) for span in info["workspace_m"])
        info["notes"] = tuple(info["notes"])
        self.info = DeviceInfo(**info)
        self.realtime: bool = hello["realtime"]
        self.warnings: list[str] = hello["warnings"]
        self.accuracy: str = hello["accuracy"]
        self.fitted_hash = config.hash
        layout = RecordLayout(len(self.info.axes), self.info.has_orientation, MAX_WALLS)
        self.shared = SharedMemory(layout, config.config.loop.rate_hz, descriptor)
        self.reader = RecordReader(self.shared)
        self.events = EventReader(self.shared)
        self.stall_s = max(STALL_S, 10.0 * config.config.loop.period_s)
        self._dropped = (0, 0)
        self._still_s = 0.0
        self._written = 0
        self._looked_s = time.monotonic()

    @property
    def exit_code(self) -> int | None:
        """How the process ended; None while it runs."""
        return self.process.poll()

    @property
    def skipped(self) -> int:
        """Deadlines skipped since the daemon started."""
        return self.shared.words[SKIPPED]

    def newly_dropped(self) -> tuple[int, int]:
        """Ticks and events that were overwritten before they were fetched, since this was asked last."""
        ticks, events = self._dropped
        self._dropped = (self.reader.dropped, self.events.dropped)
        return self.reader.dropped - ticks, self.events.dropped - events

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

    def stop(self) -> None:
        """Ask the loop to ramp its force out and end."""
        with contextlib.suppress(ProcessLookupError):
            self.process.terminate()

    def end(self) -> bool:
        """Let the loop ramp its force out and end; kill it when it does not, and return False."""
        return end(self.process)

    def kill(self) -> None:
        """End the process at once, whatever it is doing."""
        kill(self.process)

    def close(self) -> None:
        """Let go of the memory; the process must have ended."""
        self.shared.close()


def end(process: subprocess.Popen[bytes]) -> bool:
    """Let a control process ramp its force out and end; kill it when it does not, and return False."""
    with contextlib.suppress(ProcessLookupError):
        process.terminate()
    try:
        process.wait(END_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        kill(process)
        return False
    return True


def kill(process: subprocess.Popen[bytes]) -> None:
    """End a control process at once, whatever it is doing."""
    with contextlib.suppress(ProcessLookupError):
        os.kill(process.pid, signal.SIGKILL)
    with contextlib.suppress(subprocess.TimeoutExpired):  # whatever can be done without it has to be done now
        process.wait(KILL_TIMEOUT_S)
