"""Other work on the computer that takes all processors away from what is not real-time, for some time, again and again.

`TAKEN_MS=45 pytest tests/daemon` has it beside the tests: a verdict that hangs on being alone on the computer shows so.
Loops, which are real-time, do not feel it, nor does the witness of standstills, so that no failure is excused. It is
about three times a second for 45 ms and ten times as rare for ten times as long: a tenth of the time.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator

LONGEST_S = 1e-3 * float(os.environ.get("TAKEN_MS", "0"))
PRIORITY = 50

_TAKE = f"""
import os, random, sys, time
cpu, parent, end_s, longest_s = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4])
os.sched_setaffinity(0, {{cpu}})
os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param({PRIORITY}))
dice = random.Random(parent)
while os.getppid() == parent:
    begin_s = end_s + dice.uniform(1.0, 12.0) * longest_s
    end_s = begin_s + dice.uniform(0.25, 1.0) * longest_s
    time.sleep(max(0.0, begin_s - time.monotonic()))
    while time.monotonic() < end_s:
        pass
"""


@contextlib.contextmanager
def neighbour(longest_s: float = LONGEST_S) -> Iterator[None]:
    """Take the processors, all at the same times, until it ends.

    Args:
        longest_s: for which they are taken at most; 0: not at all [s].
    """
    start_s = time.monotonic()
    with contextlib.ExitStack() as stack:
        for cpu in sorted(os.sched_getaffinity(0)) if longest_s else ():
            words = [str(cpu), str(os.getpid()), str(start_s), str(longest_s)]
            stack.callback(stack.enter_context(subprocess.Popen([sys.executable, "-S", "-c", _TAKE, *words])).kill)
        yield
