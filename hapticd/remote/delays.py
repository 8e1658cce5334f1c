"""How long things took, as a histogram."""

from __future__ import annotations

import bisect

DELAY_EDGES_MS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0)
"""Edges of the histograms [ms].

Bin 0 counts what took less than 0.25 ms, bin i from edge i-1 to below edge i, the last one 256 ms and more.
"""


class DelayHistogram:
    """Counts delays.

    Attributes:
        counts: one a bin, one more than there are edges.
    """

    __slots__ = ("counts",)

    def __init__(self) -> None:
        self.counts = [0] * (len(DELAY_EDGES_MS) + 1)

    def add(self, delay_ns: int) -> None:
        """Count one."""
        self.counts[bisect.bisect_right(DELAY_EDGES_MS, delay_ns * 1e-6)] += 1
