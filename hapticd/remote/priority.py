"""The priority of the remote process: real-time, and an ordinary one's while clients send more than it can read.

What clients send decides how much it computes, so a flood must not keep its processor from all other programs.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

LOWEST = 1
"""Of SCHED_FIFO: below the loop, above every ordinary program."""

CALM_NS = 1_000_000_000
"""For how long there must have been no flood [ns]."""


class Priority:
    """The priority of all threads of this process.

    Args:
        realtime: they may be real-time ones; without the permission they stay ordinary ones.
    """

    def __init__(self, realtime: bool) -> None:
        self._realtime = realtime
        self._flooded_ns = 0
        self._calm = True
        self._take()

    def flooded(self, now_ns: int) -> None:
        """There is more to read than can be read at once."""
        self._flooded_ns = now_ns
        if self._calm:
            self._calm = False
            self._take()

    def turn(self, now_ns: int) -> None:
        """Be real-time again when the flood is over."""
        if not self._calm and now_ns - self._flooded_ns > CALM_NS:
            self._calm = True
            self._take()

    def _take(self) -> None:
        if not self._realtime:
            return
        policy, priority = (os.SCHED_FIFO, LOWEST) if self._calm else (os.SCHED_OTHER, 0)
        for thread in Path("/proc/self/task").iterdir():
            with contextlib.suppress(PermissionError, ProcessLookupError):
                os.sched_setscheduler(int(thread.name), policy, os.sched_param(priority))
