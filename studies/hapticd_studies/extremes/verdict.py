"""What a linear loop does in the long run, by its spectral radius."""

from __future__ import annotations

import math
from enum import IntEnum

MARGIN = 1e-6
"""Closer to 1 than this a spectral radius is marginal."""


class Verdict(IntEnum):
    """Stability of a linear loop."""

    STABLE = 0
    MARGINAL = 1
    UNSTABLE = 2

    @property
    def words(self) -> str:
        """For people."""
        return self.name.lower()


def verdict_of(log_growth: float) -> Verdict:
    """The verdict on the natural logarithm of a spectral radius."""
    beyond = math.expm1(log_growth) if log_growth < 1.0 else 1.0
    if beyond >= MARGIN:
        return Verdict.UNSTABLE
    return Verdict.STABLE if beyond <= -MARGIN else Verdict.MARGINAL
