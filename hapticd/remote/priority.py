"""The priority of the remote process: real-time, and an ordinary one's while clients send more than it can read.

What clients send decides how much it computes, so a flood must not keep its processor from all other programs. The
threads that bound connections and memory are above those of ZeroMQ, which a flood keeps busy before it makes sense.
"""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path

LOWEST = 1
"""Of SCHED_FIFO: below the loop, above every ordinary program."""

BOUNDING = LOWEST + 1
"""Of SCHED_FIFO, of the threads that bound what clients take."""

FLOOD_SHARE = 0.5
"""Of a processor: a thread of ZeroMQ that takes more is being flooded."""

CALM_NS = 1_000_000_000
"""For how long there must have been no flood [ns]."""

_LOOK_NS = 100_000_000


class Priority:
    """The priority of all threads of this process, and of those that they start.

    Args:
        realtime: they may be real-time ones; without the permission they stay ordinary ones.
    """

    def __init__(self, realtime: bool) -> None:
        self._realtime = realtime
        self._flooded_ns = 0
        self._calm = True
        self._zeromq: dict[int, int] = {}  # time that each thread had computed for [ns]
        self._looked_ns = 0
        self._take()

    def settle(self) -> None:
        """All threads of ZeroMQ are there."""
        self._zeromq = dict.fromkeys((thread for thread, name in _threads() if name.startswith("ZMQ")), 0)
        self._take()

    def flooded(self, now_ns: int) -> None:
        """There is more to read than can be read at once."""
        self._flooded_ns = now_ns
        if self._calm:
            self._calm = False
            self._take()

    def turn(self, now_ns: int) -> None:
        """See a flood that never becomes a message; be real-time again when the flood is over."""
        passed_ns = now_ns - self._looked_ns
        if passed_ns >= _LOOK_NS:
            self._looked_ns = now_ns
            for thread, before_ns in self._zeromq.items():
                self._zeromq[thread] = used_ns = _used_ns(thread)
                if used_ns - before_ns > FLOOD_SHARE * passed_ns:
                    self.flooded(now_ns)
        if not self._calm and now_ns - self._flooded_ns > CALM_NS:
            self._calm = True
            self._take()

    def _take(self) -> None:
        if not self._realtime:
            return
        for thread, _ in _threads():
            lowest = thread == os.getpid() or thread in self._zeromq
            priority = (LOWEST if lowest else BOUNDING) if self._calm else 0
            with contextlib.suppress(PermissionError, ProcessLookupError):
                policy = os.SCHED_FIFO if priority else os.SCHED_OTHER
                os.sched_setscheduler(thread, policy, os.sched_param(priority))


def _threads() -> list[tuple[int, str]]:
    """Number and name of each thread of this process."""
    found = []
    for thread in Path("/proc/self/task").iterdir():
        with contextlib.suppress(OSError):
            found.append((int(thread.name), (thread / "comm").read_text()))
    return found


def _used_ns(thread: int) -> int:
    """Processor time of a thread; Linux names its clock by its number (clock_getcpuclockid(3))."""
    return time.clock_gettime_ns(~thread << 3 | 6)
