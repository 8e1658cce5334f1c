"""A clock that a test moves by hand, in the place of the loop's own."""

from __future__ import annotations

import time
from types import SimpleNamespace

import pytest


class Clock:
    """CLOCK_MONOTONIC as the loop reads it; it stands still unless told otherwise.

    Args:
        monkeypatch: puts it in the loop's place until the test has ended.

    Attributes:
        now_ns: what it shows [ns].
        computed_ns: what the thread has computed [ns]; None: what it really has.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_ns = 1_000_000_000
        self.computed_ns: int | None = None
        clocks = SimpleNamespace(monotonic_ns=lambda: self.now_ns, thread_time_ns=self._thread_time_ns)
        monkeypatch.setattr("hapticd.loop.loop.time", clocks)

    @property
    def now_s(self) -> float:
        """The same in seconds."""
        return self.now_ns * 1e-9

    def _thread_time_ns(self) -> int:
        return time.thread_time_ns() if self.computed_ns is None else self.computed_ns

    def pass_s(self, duration_s: float) -> None:
        """Let time pass."""
        self.now_ns += round(duration_s * 1e9)

    def sleep_until(self, deadline_ns: int) -> int:
        """Wake right at a deadline, or at once when it has passed."""
        self.now_ns = max(self.now_ns, deadline_ns)
        return self.now_ns
