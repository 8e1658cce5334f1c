"""Items on several threads: each once, whatever the numbers are; an error or Ctrl-C ends it soon."""

from __future__ import annotations

import os
import signal
import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.simulation.compiler.threads import PIECES_PER_THREAD, cores, in_threads

SLOW_S = 0.5


@given(count=st.integers(0, 300), workers=st.none() | st.integers(1, 100))
def test_each_item_is_run_once(count: int, workers: int | None) -> None:
    times = [0] * count

    def code(first: int, stop: int, what: str) -> None:
        assert what == "given"
        for at in range(first, stop):
            times[at] += 1

    told: list[int] = []
    in_threads(code, count, "given", workers=workers, progress=told.append)
    assert times == [1] * count
    assert sum(told) == count


def test_no_more_threads_than_were_asked_for_and_all_of_those(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hapticd.simulation.compiler.threads.cores", lambda: 3)
    for workers, threads in ((None, 3), (2, 2), (8, 3)):
        together = threading.Barrier(threads)
        seen: set[int] = set()

        def code(_first: int, _stop: int, together: threading.Barrier, seen: set[int]) -> None:
            together.wait(60.0)
            seen.add(threading.get_ident())

        in_threads(code, threads * PIECES_PER_THREAD, together, seen, workers=workers)
        assert len(seen) == threads


def test_there_are_as_many_cores_as_this_process_may_use() -> None:
    assert cores() == len(os.sched_getaffinity(0))


def test_what_a_piece_raises_is_raised_and_the_rest_is_not_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hapticd.simulation.compiler.threads.cores", lambda: 2)
    begun = []

    def code(first: int, _stop: int) -> None:
        begun.append(first)
        if first == 0:
            raise ZeroDivisionError
        time.sleep(SLOW_S)

    with pytest.raises(ZeroDivisionError):
        in_threads(code, 2 * PIECES_PER_THREAD)
    assert len(begun) < 2 * PIECES_PER_THREAD


def test_an_interrupt_is_obeyed_after_the_pieces_that_are_being_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hapticd.simulation.compiler.threads.cores", lambda: 2)
    begun = []

    def code(first: int, _stop: int) -> None:
        begun.append(first)
        if first == 0:
            os.kill(os.getpid(), signal.SIGINT)
        time.sleep(SLOW_S)

    with pytest.raises(KeyboardInterrupt):
        in_threads(code, 2 * PIECES_PER_THREAD)
    assert len(begun) < 2 * PIECES_PER_THREAD
