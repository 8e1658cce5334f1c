"""How much memory clients may fill: a bound that ZeroMQ itself does not have.

ZeroMQ bounds a frame and how many messages wait, but not how many frames a message has: it keeps them all, sixty-four
bytes for each empty one, until the last has come. So the process looks at its own memory, and ends connections.
"""

from __future__ import annotations

import ctypes
import enum
import functools
import os

MOST_MORE_BYTES = 112 << 20
"""What the process may have resident beyond what it had before its first client, some 48 MB in a daemon [bytes]."""

_FREED_S = 1.0  # what ended connections held is free again after that
_FURTHER_BYTES = 64 << 20
_STATM_BYTES = 256  # seven numbers
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


class Culprits(enum.Enum):
    """Whose connections to end."""

    NO_ONE = enum.auto()
    SENDERS = enum.auto()
    ALL = enum.auto()


class MemoryBound:
    """Says whose connections to end while the memory is full.

    For a second of those that are just sending; then of all, when that did not help. When that did not help either, it
    is not clients who have the memory, and the bound is further up.

    Args:
        most_more_bytes: what may be resident beyond what is now.
    """

    def __init__(self, most_more_bytes: int = MOST_MORE_BYTES) -> None:
        self._most_bytes = resident_bytes() + most_more_bytes
        self._full_s: float | None = None
        self._ended_all = False

    def turn(self, now_s: float) -> Culprits:
        """Look at the memory.

        Args:
            now_s: CLOCK_MONOTONIC [s].
        """
        if resident_bytes() > self._most_bytes:
            _give_back()
        held_bytes = resident_bytes()
        if held_bytes <= self._most_bytes:
            self._full_s = None
            self._ended_all = False
            return Culprits.NO_ONE
        if self._full_s is None:
            self._full_s = now_s
        if now_s - self._full_s < _FREED_S:
            return Culprits.NO_ONE if self._ended_all else Culprits.SENDERS
        self._full_s = now_s
        if not self._ended_all:
            self._ended_all = True
            return Culprits.ALL
        self._ended_all = False
        self._most_bytes = held_bytes + _FURTHER_BYTES
        return Culprits.NO_ONE


def resident_bytes() -> int:
    """What this process has in memory [bytes]."""
    return int(os.pread(_statm(os.getpid()), _STATM_BYTES, 0).split()[1]) * _PAGE_BYTES


@functools.cache
def _statm(_process: int) -> int:
    """Kept open for the next look, which must not fail when no descriptor is left; a fork needs one of its own."""
    return os.open("/proc/self/statm", os.O_RDONLY | os.O_CLOEXEC)


def _give_back() -> None:
    """Have the C library return what is free to the system, which it would keep."""
    ctypes.CDLL(None).malloc_trim(0)
