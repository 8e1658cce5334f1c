"""How long a law may compute, and whether it has for too many of the last ticks."""

from __future__ import annotations

BUDGET_TICKS = 10
BUDGET_MISSES = 3
"""A law fails when this many of `BUDGET_TICKS` ticks computed for longer than the budget, after one that took longer.

What a tick has computed is a question to the system, which costs more than a small law. It is asked from the first tick
on that took longer, for whatever reason, and until `BUDGET_TICKS` in a row did not.
"""

_ALL_TICKS = (1 << BUDGET_TICKS) - 1


class LawBudget:
    """The last ticks of a loop, as far as they took longer than the budget.

    Args:
        budget_ns: how long a tick may compute [ns].

    Attributes:
        watched: for how many more ticks it is to be looked at what they have computed.
    """

    __slots__ = ("_budget_ns", "_cpu_ns", "_misses", "watched")

    def __init__(self, budget_ns: int) -> None:
        self.watched = 0
        self._budget_ns = budget_ns
        self._cpu_ns = 0
        self._misses = 0

    def excuse(self, cpu_ns: int) -> None:
        """Take processor time off this tick that a law does not answer for [ns]."""
        self._cpu_ns += cpu_ns

    def is_exceeded(self, took_ns: int, cpu_ns: int) -> bool:
        """Look at a tick that is watched or took longer, and at those before it.

        Args:
            took_ns: from waking up until now [ns].
            cpu_ns: processor time of this thread so far [ns].
        """
        over = took_ns > self._budget_ns
        self._misses = self._misses << 1 & _ALL_TICKS
        # Getting in and out of the sleep costs processor time as well, and is not the law's.
        exceeded = False
        if self.watched and over and cpu_ns - self._cpu_ns > self._budget_ns:
            self._misses |= 1
            exceeded = self._misses.bit_count() >= BUDGET_MISSES
        self._cpu_ns = cpu_ns
        self.watched = BUDGET_TICKS if over else self.watched - 1
        return exceeded
