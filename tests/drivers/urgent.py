"""A double beside other work: a device has a processor of its own, and does not wait for this computer's programs."""

from __future__ import annotations

import contextlib
import os


def be_urgent() -> None:
    """Put this thread before all programs that are not real-time, where this user may; after every loop that is."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
