"""The loop's sleep: to a deadline, whatever comes in between."""

from __future__ import annotations

import signal
import time
from types import FrameType

from hapticd.loop.realtime import sleep_until


def test_it_is_never_early_and_says_when_it_woke() -> None:
    for number in range(200):
        deadline_ns = time.monotonic_ns() + 50_000 + 1_237 * number
        woke_ns = sleep_until(deadline_ns)
        assert deadline_ns <= woke_ns <= time.monotonic_ns()


def test_a_deadline_that_has_passed_is_no_sleep_and_no_error() -> None:
    before_ns = time.monotonic_ns()
    assert sleep_until(before_ns - 10**12) >= before_ns
    assert sleep_until(before_ns) >= before_ns


def test_no_signal_cuts_it_short_and_none_waits_for_its_end() -> None:
    heard_ns: list[int] = []

    def hear(_number: int, _frame: FrameType | None) -> None:
        heard_ns.append(time.monotonic_ns())

    before = signal.signal(signal.SIGALRM, hear)
    try:
        deadline_ns = time.monotonic_ns() + 200_000_000
        signal.setitimer(signal.ITIMER_REAL, 0.01, 0.01)
        woke_ns = sleep_until(deadline_ns)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert woke_ns >= deadline_ns
    assert heard_ns
    assert heard_ns[0] < deadline_ns
