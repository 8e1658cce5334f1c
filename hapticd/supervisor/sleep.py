"""Whether the computer slept: CLOCK_MONOTONIC, by which all here count, stands still then; CLOCK_BOOTTIME goes on."""

from __future__ import annotations

import time

LEAST_S = 0.1
"""The shortest sleep that counts [s]."""


class SleepWatch:
    """Compares the two clocks. To get no processor between reading one and the other is no sleep."""

    def __init__(self) -> None:
        self._slept_ns = max(_slept_ns() for _ in range(16))

    def slept_s(self) -> float:
        """How long the computer has slept since this was asked last; 0 when it has not [s]."""
        slept_ns = _slept_ns()
        more_s = (slept_ns - self._slept_ns) * 1e-9
        self._slept_ns = max(self._slept_ns, slept_ns)
        return more_s if more_s >= LEAST_S else 0.0


def _slept_ns() -> int:
    """Sleep since the computer started [ns]: at least, since whatever comes between the readings makes it less."""
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME) - time.monotonic_ns()
