"""From which tick on a time of the configuration counts: the one rule for every `at_s`."""

from __future__ import annotations

import math


def first_tick(at_s: float, period_s: float) -> int:
    """The first tick at or after a time.

    A time that is a whole number of periods but for rounding means that very tick.

    Args:
        at_s: time from the first tick on [s].
        period_s: time between ticks [s].
    """
    return max(0, math.ceil(at_s / period_s - 1e-6))
