"""The thread beside the loop: there before it is needed, below the loop, gone with it."""

from __future__ import annotations

import os
import threading
from concurrent.futures import ThreadPoolExecutor

from hapticd.loop.worker import Worker

PATIENCE_S = 60.0
PRIORITY = 2
"""The lowest one that leaves room for another below it."""


def threads() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "beside-the-loop"]


def scheduled(beside: Worker) -> tuple[int, int]:
    """Policy and priority of the thread."""
    seen: list[tuple[int, int]] = []
    done = threading.Event()

    def look() -> None:
        seen.append((os.sched_getscheduler(0), os.sched_getparam(0).sched_priority))
        done.set()

    beside.do(look)
    assert done.wait(PATIENCE_S)
    return seen[0]


def test_it_does_one_thing_after_the_other_and_ends() -> None:
    before = threads()
    beside = Worker()
    beside.start()
    (thread,) = [each for each in threads() if each not in before]
    for _ in range(3):
        assert scheduled(beside) == (os.sched_getscheduler(0), os.sched_getparam(0).sched_priority)
    assert thread.daemon, "an import that hangs does not keep the process from its end"
    beside.end()
    thread.join(PATIENCE_S)
    assert not thread.is_alive()


def test_what_is_asked_for_before_the_thread_is_there_is_done_once_it_is() -> None:
    done = threading.Event()
    beside = Worker()
    beside.do(done.set)
    beside.start()
    assert done.wait(PATIENCE_S)
    beside.end()


def test_what_was_done_is_let_go_of_before_there_is_something_else_to_do() -> None:
    """It may have a mesh in it, or an error with all its frames, and in the loop's process nothing else frees it."""
    gone = threading.Event()

    class Work:
        def __call__(self) -> None: ...

        def __del__(self) -> None:
            gone.set()

    beside = Worker()
    beside.start()
    beside.do(Work())
    assert gone.wait(PATIENCE_S)
    beside.end()


def test_it_ends_after_what_it_is_doing() -> None:
    before = threads()
    beside = Worker()
    beside.start()
    (thread,) = [each for each in threads() if each not in before]
    begun, go_on, done = threading.Event(), threading.Event(), threading.Event()

    def work() -> None:
        begun.set()
        go_on.wait(PATIENCE_S)
        done.set()

    beside.do(work)
    assert begun.wait(PATIENCE_S)
    beside.end()
    go_on.set()
    thread.join(PATIENCE_S)
    assert done.is_set()
    assert not thread.is_alive()


def test_beside_a_real_time_loop_it_is_one_priority_below() -> None:
    """Where this user may have real-time threads at all; else both are ordinary ones."""

    def as_a_loop(policy: int) -> tuple[tuple[int, int], tuple[int, int]]:
        try:
            os.sched_setscheduler(0, policy, os.sched_param(PRIORITY))
        except PermissionError:
            policy = os.sched_getscheduler(0)
        beside = Worker()
        beside.start()
        found = scheduled(beside)
        beside.end()
        return (policy, max(0, os.sched_getparam(0).sched_priority - 1)), found

    with ThreadPoolExecutor(1) as pool:
        expected, found = pool.submit(as_a_loop, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK).result()
    assert found == expected
