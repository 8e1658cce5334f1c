"""What a driver and its device have said to each other last: for a report from a machine that cannot be looked at.

A driver that has one keeps the last `device.options.trace` entries in memory, none by default, and gives them as
`Driver.trace_lines()`, oldest first, from any thread and after a fault or `close` as well.
"""

from __future__ import annotations

import time
from collections import deque

from pydantic import Field

from hapticd.driver import DriverOptions

MOST_ENTRIES = 100_000


class TraceOptions(DriverOptions):
    """The keys of [device.options] that every driver with a trace has."""

    trace: int = Field(
        0,
        ge=0,
        le=MOST_ENTRIES,
        description="how many of the last messages or calls between hapticd and the device are kept for a report; each "
        "costs microseconds; 0 = none",
    )


class Trace:
    """The last entries, each with its time.

    Args:
        size: how many are kept.
    """

    def __init__(self, size: int) -> None:
        self._entries: deque[tuple[int, tuple[object, ...]]] = deque(maxlen=size)

    def keep(self, *parts: object) -> None:
        """Add an entry; what it is made of must not change afterwards."""
        self._entries.append((time.monotonic_ns(), parts))

    def lines(self) -> list[str]:
        """Every entry as CLOCK_MONOTONIC [ns] and words, oldest first."""
        return [f"{at_ns} {' '.join(map(str, parts))}" for at_ns, parts in self._entries.copy()]
