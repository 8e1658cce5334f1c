"""A double beside other work: a device has a processor of its own, and does not wait for this computer's programs."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator


def be_urgent() -> None:
    """Put this thread before all programs that are not real-time, where this user may; after every loop that is."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))


@contextlib.contextmanager
def as_urgent() -> Iterator[None]:
    """Keep this thread from holding up a double in its own process: it may have the interpreter that one waits for.

    Nothing is to be started meanwhile, since that would be as urgent.
    """
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    be_urgent()
    try:
        yield
    finally:
        os.sched_setscheduler(0, policy, parameters)
