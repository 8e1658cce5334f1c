"""Keeps the ticks around every fault on disk, in the background: the ring still holds them when the fault is over.

Copying, compressing and writing are one thread's work, on a mapping of the ring of its own. The supervisor only says
what happened, and hears how it went.
"""

from __future__ import annotations

import errno
import os
import threading
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hapticd.faults.record import encode
from hapticd.faults.store import FaultStore
from hapticd.loop.memory import RECORDS, SharedMemory
from hapticd.tick.event import LoopEvent
from hapticd.trace import lines

BEFORE_S = 5.0
AFTER_S = 1.0
"""What is kept before and after a fault [s]; the ring holds 8."""

_PIECE = 256
"""Rows that are copied at once."""

_OPEN = "let the daemon's user write there, or set HAPTICD_STATE_DIR to a directory where it may"
_ROOM = "make room there; the next fault is recorded again"
_OTHER = "`hapticd doctor` says what is wrong with the directory"
_REMEDIES = {
    errno.EACCES: _OPEN,
    errno.EPERM: _OPEN,
    errno.EROFS: _OPEN,
    errno.ENOSPC: _ROOM,
    errno.EDQUOT: _ROOM,
    errno.EMFILE: "raise the limit of open files (ulimit -n, LimitNOFILE=) and start the daemon again",
}

_NO_THREAD = "no thread can be started; free memory, or raise the limit of processes (ulimit -u, TasksMax=)"

_MOST_WAITING = 4
_PATIENCE_S = 1.0


class FaultRecorder:
    """Writes fault records.

    Args:
        directory: where to.

    Attributes:
        written: records written so far.
    """

    def __init__(self, directory: Path) -> None:
        self.written = 0
        self._store = FaultStore(directory)
        self._waiting: deque[_Job] = deque()
        self._writing: _Job | None = None
        self._problem = ""

    def begin(
        self, event: LoopEvent, epoch_s: float, shared: SharedMemory, rate_hz: float, header: dict[str, Any]
    ) -> None:
        """Keep the ticks around a fault, once those after it have come.

        Args:
            event: the fault.
            epoch_s: when it happened [s since the epoch].
            shared: the memory with the ring.
            rate_hz: ticks a second [Hz].
            header: what the record says of itself besides the event.
        """
        if len(self._waiting) < _MOST_WAITING:
            try:
                self._waiting.append(_Job(self._store, event, epoch_s, shared, rate_hz, header))
            except OSError as error:  # no more files or memory to be had: no reason to end
                self._problem = f"fault record not written: {_why(error)}"
        else:
            self._problem = f"fault record not written: {_MOST_WAITING} others are still to be written"

    def turn(self, keep: int) -> str:
        """Start what is due; returns at once. What went wrong with a record that is done, "" when nothing did.

        Args:
            keep: most records to keep.
        """
        problem, self._problem = self._problem, ""
        job = self._writing
        if job is not None and not job.is_alive():
            self._writing = None
            problem = job.problem or problem
            self.written += not job.problem
        if self._writing is None and self._waiting and self._waiting[0].due():
            self._writing = self._waiting.popleft()
            self._writing.keep = keep
            try:
                self._writing.start()
            except RuntimeError:
                self._writing.drop()
                self._writing = None
                problem = f"fault record not written: {_NO_THREAD}"
        return problem

    def loop_ended(self) -> None:
        """No more ticks will come."""
        for job in self._waiting:
            job.complete = True

    def close(self, keep: int, timeout_s: float) -> str:
        """Write what waits, as it is; what went wrong with the last of it.

        Args:
            keep: most records to keep.
            timeout_s: how long to wait for a slow disk [s].
        """
        self.loop_ended()
        end_s = time.monotonic() + timeout_s
        problem = ""
        while (self._waiting or self._writing is not None) and time.monotonic() < end_s:
            problem = self.turn(keep) or problem
            if self._writing is not None:
                self._writing.join(max(0.0, end_s - time.monotonic()))
        return problem


class _Job(threading.Thread):
    """One record on its way to the disk."""

    def __init__(
        self,
        store: FaultStore,
        event: LoopEvent,
        epoch_s: float,
        shared: SharedMemory,
        rate_hz: float,
        header: dict[str, Any],
    ) -> None:
        super().__init__(name="fault record", daemon=True)
        self.problem = ""
        self.keep = 0
        self.complete = False
        self._store = store
        self._event = event
        self._epoch_s = epoch_s
        self._header = header
        self._shared = SharedMemory(shared.layout, rate_hz, os.dup(shared.descriptor))
        self._trace = bytes(shared.trace)  # now: a short one holds nothing of the fault a second later
        at = _number(self._shared, event.seq)
        self._first = max(0, at - round(BEFORE_S * rate_hz))
        self._end = at + round(AFTER_S * rate_hz) + 1
        self._give_up_s = time.monotonic() + AFTER_S + _PATIENCE_S

    def due(self) -> bool:
        """Whether the last tick that belongs to it has come, or never will."""
        if self._shared.words[RECORDS] >= self._end or time.monotonic() > self._give_up_s:
            self.complete = True
        return self.complete

    def drop(self) -> None:
        """Let go of the ring; it cannot be started."""
        self._shared.close()

    def run(self) -> None:
        """Copy, compress, write."""
        try:
            content = encode(self._header | {"trace": lines(self._trace)}, self._shared.layout, self._rows())
            self._store.write(self._epoch_s, self._event.code, content, self.keep)
        except OSError as error:
            self.problem = f"fault record not written: {error.filename or self._store.directory}: {_why(error)}"
        except Exception as error:  # noqa: BLE001 - whatever it is, the supervisor goes on and says so
            self.problem = f"fault record not written: {type(error).__name__}: {error}; please report it"
        finally:
            self._shared.close()

    def _rows(self) -> Iterator[bytes]:
        """The rows as they lie in the ring, without those that were overwritten since."""
        size = self._shared.layout.size
        slots = self._shared.slots
        area = self._shared.record_area
        number = max(self._first, self._shared.words[RECORDS] - slots + 2)
        end = min(self._end, self._shared.words[RECORDS])
        while number < end:
            slot = number % slots
            count = min(_PIECE, end - number, slots - slot)
            piece = bytes(area[slot * size : (slot + count) * size])
            lost = max(0, self._shared.words[RECORDS] - slots + 2 - number)
            yield piece[min(lost, count) * size :]
            number += count


def _why(error: OSError) -> str:
    """The system's reason, and what to do."""
    return f"{error.strerror}; {_REMEDIES.get(error.errno or 0, _OTHER)}"


def _number(shared: SharedMemory, seq: int) -> int:
    """Which record of this ring is that of a tick; ticks are numbered through, also across a reconnection."""
    newest = shared.words[RECORDS] - 1
    if newest < 0:
        return 0
    start = newest % shared.slots * shared.layout.size
    return newest - (int.from_bytes(shared.record_area[start : start + 8], "little") - seq)
