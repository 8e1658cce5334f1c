"""How a driver's own thread is scheduled beside the loop that it serves."""

from __future__ import annotations

import contextlib
import os
import threading

LOOK_EVERY_TICKS = 32
"""How often a driver looks whether its loop is scheduled in another way than before."""


def follow_caller(thread: threading.Thread) -> None:
    """Have a thread scheduled as the one that calls: the loop, which is real-time only after it has opened its device.

    At a lower priority a busy computer would keep the thread from its work, and the loop with it whenever the thread
    holds the interpreter. Other threads may call for the loop at times, so it has to be called again and again.

    Args:
        thread: one that was started; nothing happens when it has ended, or when there is no right to do so.
    """
    with contextlib.suppress(OSError):
        policy = os.sched_getscheduler(0)
        if thread.native_id is not None and os.sched_getscheduler(thread.native_id) != policy:
            os.sched_setscheduler(thread.native_id, policy, os.sched_getparam(0))
