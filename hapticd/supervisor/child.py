"""The process of the loop as the supervisor sees it: start it, look after it, end it."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import msgpack

from hapticd import version
from hapticd.config.loading import LoadedConfig
from hapticd.config.walls import MAX_WALLS
from hapticd.device import DeviceInfo
from hapticd.errors import ConfigError, HapticdError
from hapticd.loop.force_mark import ForceMark
from hapticd.loop.memory import (
    DEVICE_LOST,
    FORCE_LEFT,
    GO,
    LARGEST_ANSWER,
    RECORDS,
    SKIPPED,
    SUPERVISOR_BEAT,
    EventReader,
    RecordReader,
    SharedMemory,
)
from hapticd.loop.resume import FROM_START, ResumeState
from hapticd.tick.record import RecordLayout

END_TIMEOUT_S = 1.0
"""How long the loop may take to ramp its force out, or to let go of a device that is lost [s]."""

KILL_TIMEOUT_S = 1.0
"""How long a killed process may take to be gone [s]; one that waits inside the kernel for its hardware stays."""

STALL_S = 0.1
"""How long the loop may stand still before it is given up [s]; at least ten periods."""

_CLUNG = "the control loop could not take the force away"


class LoopProcess:
    """A running loop.

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
        force_seen_to: that no force of it is left on the device has been looked after.
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
        self.force_seen_to = False
        self._dropped = (0, 0)
        self._still_s = 0.0
        self._written = 0
        self._looked_s = time.monotonic()

    @property
    def exit_code(self) -> int | None:
        """How the process ended; None while it runs."""
        return self.process.poll()

    @property
    def left_behind(self) -> str:
        """Why a process that has ended may have left a force on its device, a line for people; "" if it did not."""
        code = self.process.returncode
        if code in (0, DEVICE_LOST):
            return ""
        if code == FORCE_LEFT:
            return _CLUNG
        return f"the loop's process {f'was killed by signal {-code}' if code < 0 else f'ended with exit code {code}'}"

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

    def end(self) -> str:
        """Let the loop ramp its force out and end; kill it when it does not.

        Returns:
            Why the force has to be taken away from outside, a line for people; "" when it is gone.
        """
        return end(self.process) or self.left_behind

    def kill(self) -> None:
        """End the process at once, whatever it is doing."""
        kill(self.process)

    def close(self) -> None:
        """Let go of the memory; the process must have ended."""
        self.shared.close()


def end(process: subprocess.Popen[bytes]) -> str:
    """Let a loop ramp its force out and end; kill it when it does not.

    Returns:
        Why the force has to be taken away from outside, a line for people; "" when it is gone.
    """
    with contextlib.suppress(ProcessLookupError):
        process.terminate()
    try:
        process.wait(END_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        kill(process)
        return "the control loop did not end and was killed"
    return _CLUNG if process.returncode == FORCE_LEFT else ""


def kill(process: subprocess.Popen[bytes]) -> None:
    """End a loop at once, whatever it is doing."""
    process.kill()  # which leaves alone what has ended: its number may be another's by now
    with contextlib.suppress(subprocess.TimeoutExpired):  # whatever can be done without it has to be done now
        process.wait(KILL_TIMEOUT_S)


TIMEOUT_S = 30.0
"""How long the device may take to open before the start counts as failed [s]."""


class LoopStart:
    """A loop on its way.

    Made in the main thread only: the kernel tells a child of its parent's death when the thread that made it ends.

    Args:
        config: what it is to run.
        rescue: called with why the force has to be taken away from outside, where this did not end by itself without.
        mark: says whether it may have left a force.
        resume: where the loop before stopped, when this one goes on for it.
        wait: it gets ready, and does not touch the device before `go`.
    """

    def __init__(
        self,
        config: LoadedConfig,
        rescue: Callable[[str], None],
        mark: ForceMark,
        resume: ResumeState = FROM_START,
        *,
        wait: bool = False,
    ) -> None:
        self._config = config
        self._rescue = rescue
        self._ended = False
        self._give_up_s = time.monotonic() + TIMEOUT_S
        wanted = {"version": version.__version__, "text": config.text, "name": str(config.path)}
        request = msgpack.packb(wanted | {"resume": asdict(resume)}, unicode_errors="surrogateescape")
        self._channel, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        # The request lies in a file, so that neither side waits for the other.
        with theirs, os.fdopen(os.memfd_create("request"), "w+b") as file:
            file.write(request)
            file.seek(0)
            # In a session of its own, so that the terminal's interrupt reaches the supervisor alone.
            self._process = subprocess.Popen(
                [
                    *(sys.executable, "-P", "-m", "hapticd.loop.process"),
                    *("--socket", str(theirs.fileno()), "--parent", str(os.getpid())),
                    *("--mark", str(mark.descriptor)),
                ],
                stdin=file,
                stdout=subprocess.DEVNULL,
                pass_fds=[theirs.fileno(), mark.descriptor],
                start_new_session=True,
            )
        if not wait:
            self.go()

    def go(self) -> None:
        """Let it open the device and run."""
        with contextlib.suppress(ConnectionError):  # it has ended, and `poll` says why
            self._channel.send(GO)

    def poll(self, timeout_s: float = 0.0) -> LoopProcess | None:
        """The running loop; None while it is not ready.

        Args:
            timeout_s: how long to wait for it [s].

        Raises:
            HapticdError: it refused to start, with its own message and exit code; nothing is left of it.
        """
        waiting = select.poll()
        waiting.register(self._channel, select.POLLIN)
        if not waiting.poll(timeout_s * 1e3):
            if time.monotonic() < self._give_up_s:
                return None
            self.end()
            raise HapticdError(f"the device did not open within {TIMEOUT_S:g} s")
        try:
            answer, descriptors, _, _ = socket.recv_fds(self._channel, LARGEST_ANSWER, 1)
        except ConnectionError:  # it died before it was told to go on
            answer, descriptors = b"", []
        if not descriptors:
            self.end()
            if not answer:
                raise HapticdError("the loop died while it started; its last words are above")
            refusal = msgpack.unpackb(answer, unicode_errors="surrogateescape")
            if "error" not in refusal:  # it is ready, and the kernel had no room for its descriptor
                raise HapticdError("no file descriptor is left for the loop's memory: raise `ulimit -n` or LimitNOFILE")
            if refusal["exit_code"] == ConfigError.exit_code:
                raise ConfigError(*refusal["error"].split("\n"))
            raise HapticdError(refusal["error"])
        self._channel.close()
        return LoopProcess(self._process, msgpack.unpackb(answer), descriptors[0], self._config)

    def wait(self) -> LoopProcess:
        """Return when it is ready.

        Raises:
            HapticdError: it refused to start; nothing is left of it.
        """
        try:
            while True:
                control = self.poll(TIMEOUT_S)
                if control is not None:
                    return control
        except BaseException:
            self.end()
            raise

    def end(self) -> None:
        """Give up: the process ends, without force."""
        self._channel.close()
        why = "" if self._ended else end(self._process)
        self._ended = True
        if why:
            self._rescue(why)
