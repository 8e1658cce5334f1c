"""Whether the computer stood still or crawled in a test: then its failure says nothing, and it runs once more.

A virtual machine's processor may be taken away for longer than a daemon waits for its loop, and one whose host has much
other work computes at a tenth of its speed, with caches that others have emptied. A witness sees both: on each
processor a process of the highest real-time priority that wakes every 10 ms. Where it did not for 50 ms, nothing that
the test started could have run there. Each time it computes what takes 5 us on a computer with nothing else to do, and
8 to 20 us of its processor time beside other programs; where that took 150 us, so did all that the test started take
ten times as long. What fails without either is a failure, and so is a second time. Without the right to real-time
scheduling there is no witness, and every failure is one.
"""

from __future__ import annotations

import contextlib
import gc
import os
import struct
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest
from _pytest.runner import runtestprotocol

STILL_S = 0.05
CRAWL_S = 150e-6
SLOTS = 256
"""Of each processor, for standstills and for crawling; the oldest is overwritten."""

PLACE = "HAPTICD_TESTS_STANDSTILLS"
"""Names the witnesses' file in the environment, from which every pytest that a test starts would have its excuses."""

_END_S = 0.3
_SLOT = struct.Struct("dd")  # when it was seen, on CLOCK_MONOTONIC, and how long it took [s]
_began_s = time.monotonic()  # when the test before did, of which a daemon for several tests may have ended unseen
_WITNESS = f"""
import mmap, os, struct, sys, time
path, cpu, parent = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
os.sched_setaffinity(0, {{cpu}})
os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(os.sched_get_priority_max(os.SCHED_FIFO)))
with open(path, "r+b") as file:
    memory = mmap.mmap(file.fileno(), 0)
slot, numbers, before = struct.Struct("dd"), [0, 0], time.monotonic()
def compute():
    sum = 0.0
    for number in range(100):
        sum = 0.999 * sum + number
def note(kind, now, took):
    slot.pack_into(memory, ({SLOTS} * (2 * cpu + kind) + numbers[kind] % {SLOTS}) * slot.size, now, took)
    numbers[kind] += 1
while os.getppid() == parent:
    time.sleep(0.01)
    now = time.monotonic()
    if now - before > {STILL_S}:
        note(0, now, now - before)
    before = now
    began = time.thread_time()
    compute()
    took = time.thread_time() - began
    if took > {CRAWL_S}:
        note(1, now, took)
"""


@contextlib.contextmanager
def witnesses() -> Iterator[None]:
    """A witness on each processor, for this process and those that it starts."""
    cpus = sorted(os.sched_getaffinity(0))
    with tempfile.NamedTemporaryFile() as file, contextlib.ExitStack() as stack:
        file.truncate(2 * SLOTS * (max(cpus) + 1) * _SLOT.size)
        os.environ[PLACE] = file.name
        for cpu in cpus:
            command = [sys.executable, "-S", "-c", _WITNESS, file.name, str(cpu), str(os.getpid())]
            witness = stack.enter_context(subprocess.Popen(command, stderr=subprocess.DEVNULL))
            stack.callback(witness.kill)
        try:
            yield
        finally:
            del os.environ[PLACE]


def longest_s(since_s: float, kind: int = 0) -> float:
    """The longest standstill that ended since then on CLOCK_MONOTONIC; 0 when there was none, or no witness [s].

    Args:
        since_s: when to look from [s].
        kind: 0: standstills; 1: what the witness computes at each look, where that crawled.
    """
    place = os.environ.get(PLACE)
    if place is None:
        return 0.0
    size = SLOTS * _SLOT.size
    rings = Path(place).read_bytes()
    slots = _SLOT.iter_unpack(b"".join(rings[at : at + size] for at in range(kind * size, len(rings), 2 * size)))
    return max((took_s for seen_s, took_s in slots if seen_s >= since_s), default=0.0)


def excuse(since_s: float) -> str:
    """What the computer did since then that no test answers for; "" for nothing."""
    still_s, crawl_s = longest_s(since_s), longest_s(since_s, 1)
    if still_s:
        return f"a processor stood still for {still_s * 1e3:.0f} ms"
    return f"a processor computed for {crawl_s * 1e6:.0f} us what takes 5 to 20" if crawl_s else ""


def run(item: pytest.Item, next_item: pytest.Item | None) -> bool:
    """Run a test, and once more if it fails and the computer stood still or crawled."""
    hook = item.ihook
    hook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for report in reports(item, next_item):
        hook.pytest_runtest_logreport(report=report)
    hook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def reports(item: pytest.Item, next_item: pytest.Item | None) -> list[pytest.TestReport]:
    """What came of a test, the second time if it failed and has an excuse, in it or in the one before."""
    global _began_s
    since_s, _began_s = _began_s, time.monotonic()
    told = runtestprotocol(item, nextitem=next_item, log=False)
    failed = any(report.failed for report in told)
    if failed:
        time.sleep(_END_S)  # what stands still still is noted when it ends
    excused = excuse(since_s) if failed else ""
    if excused:
        with contextlib.suppress(Exception):  # what ended by the standstill may not end well
            item.session._setupstate.teardown_exact(None)  # a daemon that serves a whole file is another one then
        _forget()
        told = runtestprotocol(item, nextitem=next_item, log=False)
        said = f"{item.nodeid} ran twice: {excused}"
        for report in told:
            report.user_properties.append(("prints", said))
            report.sections.append(("standstill", said))  # for one that fails again
    return told


def _forget() -> None:
    """Let go of what a failed test held: a file or process that it could not close would fail a later test."""
    for held in ("last_value", "last_traceback", "last_exc"):
        setattr(sys, held, None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        gc.collect()
