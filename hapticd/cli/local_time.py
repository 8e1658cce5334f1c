"""The user's time, as every command that people read shows it."""

from __future__ import annotations

import time


def moment(timestamp: float) -> str:
    """Day, time and how far it is from UTC: `2026-11-23 19:03:12 +0100`.

    Args:
        timestamp: since the epoch [s].
    """
    return time.strftime("%Y-%m-%d %H:%M:%S %z", time.localtime(timestamp))


def zone(timestamp: float) -> str:
    """How far the user's time is from UTC at that moment, for a clock without a day: `+0100`.

    Args:
        timestamp: since the epoch [s].
    """
    return time.strftime("%z", time.localtime(timestamp))
