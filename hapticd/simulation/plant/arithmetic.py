"""Functions from additions and multiplications alone, so that they are the same everywhere."""

from __future__ import annotations

ROUND = 6755399441055744.0  # 1.5 * 2^52: adding and taking it away rounds to the nearest whole, half to even
_TURN = 6.283185307179586


def sine(turns: float) -> float:
    """sin(2 pi turns)."""
    r = turns - (turns + ROUND - ROUND)
    if r > 0.25:
        r = 0.5 - r
    elif r < -0.25:
        r = -0.5 - r
    y = r * _TURN
    z = y * y
    series = -1.0 / 121645100408832000.0 + z / 51090942171709440000.0
    series = 1.0 / 355687428096000.0 + z * series
    series = -1.0 / 1307674368000.0 + z * series
    series = 1.0 / 6227020800.0 + z * series
    series = -1.0 / 39916800.0 + z * series
    series = 1.0 / 362880.0 + z * series
    series = -1.0 / 5040.0 + z * series
    series = 1.0 / 120.0 + z * series
    series = -1.0 / 6.0 + z * series
    return y + y * z * series
