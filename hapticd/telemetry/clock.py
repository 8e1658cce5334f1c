"""The clock of timestamps: seconds since the epoch that never step back, from CLOCK_MONOTONIC and an offset."""

from __future__ import annotations

import time

CLOCK_STEP_NS = 500_000_000
"""How far the clock must have gone ahead to be followed [ns]: it was set, or the computer slept."""


def measure_epoch_offset_ns(tries: int = 16) -> int:
    """What to add to CLOCK_MONOTONIC to get nanoseconds since the epoch: the narrowest of several readings."""
    readings = []
    for _ in range(tries):
        before = time.monotonic_ns()
        epoch = time.time_ns()
        after = time.monotonic_ns()
        readings.append((after - before, epoch - (before + after) // 2))
    return min(readings)[1]


def followed_offset_ns(offset_ns: int, measured_ns: int) -> int:
    """The offset to go on with. A clock that is set back is not followed: no timestamp moves backwards.

    Args:
        offset_ns: in use, what to add to CLOCK_MONOTONIC to get nanoseconds since the epoch.
        measured_ns: the same as it is now.
    """
    return measured_ns if measured_ns - offset_ns > CLOCK_STEP_NS else offset_ns


def timestamp_s(deadline_ns: int, epoch_offset_ns: int) -> float:
    """Seconds since the epoch at a time on CLOCK_MONOTONIC."""
    return (deadline_ns + epoch_offset_ns) * 1e-9
