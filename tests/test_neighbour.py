"""The neighbour of the tests: it takes every processor, of what is not real-time, and ends with the tests."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from tests.daemon.running import wait_until
from tests.neighbour import PRIORITY, neighbour
from tests.test_standstill import may_be_realtime


def children() -> set[int]:
    return {int(pid) for pid in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()}


def scheduled(pid: int) -> tuple[int, int]:
    """How a process is scheduled, and its priority; nothing once it has ended, for want of a right."""
    with contextlib.suppress(ProcessLookupError):
        return os.sched_getscheduler(pid), os.sched_getparam(pid).sched_priority
    return -1, -1


def processor_s(pid: int) -> float:
    """Processor time that a process has used [s]."""
    words = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def test_each_processor_is_taken_again_and_again() -> None:
    before = children()
    with neighbour(0.02):
        takers = children() - before
        assert len(takers) == len(os.sched_getaffinity(0))
        if may_be_realtime():
            for pid in takers:
                wait_until(lambda pid=pid: scheduled(pid) == (os.SCHED_FIFO, PRIORITY), "a taker")
                taken_s = processor_s(pid)
                wait_until(lambda pid=pid, taken_s=taken_s: processor_s(pid) > taken_s + 0.1, "its work")
    assert not takers & children()


def test_there_is_none_that_was_not_asked_for() -> None:
    before = children()
    with neighbour(0.0):
        assert children() == before
