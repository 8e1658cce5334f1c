"""What a driver and its device have said to each other last: for a report from a machine that cannot be looked at.

A trace lies in plain memory, which may be shared with another process: what was said before a loop was killed can still
be read. Each entry has a slot of its own, written at once; the oldest is overwritten.
"""

from __future__ import annotations

import itertools
import struct
import time

MOST_ENTRIES = 4096
"""Most entries that a trace can hold."""

_ENTRY = struct.Struct("<QqH366s")  # its number from 1 on, CLOCK_MONOTONIC [ns], bytes of text, text
AREA_BYTES = MOST_ENTRIES * _ENTRY.size
"""Memory that every trace fits into [bytes]."""


class DriverTrace:
    """The last entries, each with its time.

    Args:
        size: how many are kept, at most `MOST_ENTRIES`; 0: none.
    """

    def __init__(self, size: int = 0) -> None:
        self._size = size
        self._numbers = itertools.count(1)
        self._place = memoryview(bytearray(size * _ENTRY.size))

    def share(self, place: memoryview) -> None:
        """Go on in this memory, of `AREA_BYTES`, where another process reads with `lines`."""
        place[: len(self._place)] = self._place
        self._place = place

    def keep(self, *parts: object) -> None:
        """Add an entry, from any thread; what does not fit into its slot is cut."""
        if not self._size:
            return
        text = " ".join(map(str, parts)).encode(errors="replace")[:366]
        number = next(self._numbers)
        at = number % self._size * _ENTRY.size
        _ENTRY.pack_into(self._place, at, number, time.monotonic_ns(), len(text), text)

    def lines(self) -> list[str]:
        """Every entry as CLOCK_MONOTONIC [ns] and words, oldest first; after a fault or `close` as well."""
        return lines(self._place)


def lines(place: bytes | memoryview) -> list[str]:
    """The entries of a trace in memory, as CLOCK_MONOTONIC [ns] and words, oldest first.

    Args:
        place: the memory, or a copy of it.
    """
    entries = sorted(entry for entry in _ENTRY.iter_unpack(place) if entry[0])
    return [f"{at_ns} {text[:length].decode(errors='replace')}" for _, at_ns, length, text in entries]
