"""What a driver keeps of its talk with the device: bounded, whole, from any thread."""

from __future__ import annotations

import threading

from hypothesis import given
from hypothesis import strategies as st

from hapticd.trace import AREA_BYTES, MOST_ENTRIES, DriverTrace, lines


@given(st.integers(1, 20), st.lists(st.text(), max_size=50))
def test_the_last_ones_are_kept_in_order(size: int, texts: list[str]) -> None:
    trace = DriverTrace(size)
    for text in texts:
        trace.keep(text)
    kept = [line.split(" ", 1)[1] for line in trace.lines()]
    expected = [text.encode(errors="replace")[:366].decode(errors="replace") for text in texts]
    assert kept == expected[-size:]


@given(st.binary(min_size=AREA_BYTES // MOST_ENTRIES, max_size=AREA_BYTES // MOST_ENTRIES))
def test_memory_that_was_torn_is_read_without_an_error(entry: bytes) -> None:
    assert len(lines(entry)) <= 1


def test_threads_lose_no_entry_to_each_other() -> None:
    trace = DriverTrace(MOST_ENTRIES)

    def keep(name: int) -> None:
        for number in range(1000):
            trace.keep(name, number)

    threads = [threading.Thread(target=keep, args=(name,)) for name in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    said = {line.split(" ", 1)[1] for line in trace.lines()}
    assert said == {f"{name} {number}" for name in range(4) for number in range(1000)}


def test_a_driver_without_the_option_may_keep_what_it_likes_and_nothing_is_kept() -> None:
    trace = DriverTrace()
    trace.keep("> 01")
    assert trace.lines() == []
