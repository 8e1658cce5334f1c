"""On which processors the SDK's own threads run."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator


@contextlib.contextmanager
def on_every_processor() -> Iterator[None]:
    """Let this thread run anywhere for as long as a call takes that starts threads: they inherit where they may run.

    The loop is bound to one processor, and a thread of the SDK that shares it would wait for the loop or hold it up.
    """
    bound = os.sched_getaffinity(0)
    with contextlib.suppress(OSError):
        os.sched_setaffinity(0, range(os.sysconf("SC_NPROCESSORS_CONF")))
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            os.sched_setaffinity(0, bound)
