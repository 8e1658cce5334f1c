"""How long a law may compute, and whether it has for too many of the last ticks."""

from __future__ import annotations

BUDGET_TICKS = 10
BUDGET_MISSES = 3
"""A law fails when it computed for longer than the budget in this many of `BUDGET_TICKS` ticks, after a longer tick.

How long it computed is a question to the system, which costs more than a small law. It is asked from the first tick on
that took longer, for whatever reason, and until `BUDGET_TICKS` in a row did not. What else a tick does is not the
law's: a computer that is slow for some milliseconds is so for all of the tick. So a law is to blame only where it
computed for longer than the tick took besides.
"""

_ALL_TICKS = (1 << BUDGET_TICKS) - 1


class LawBudget:
    """The last ticks of a loop, as far as their laws computed for longer than the budget.

    Args:
        budget_ns: how long the laws of a tick may compute [ns].

    Attributes:
        watched: for how many more ticks it is to be asked how long their laws compute.
    """

    __slots__ = ("_budget_ns", "_misses", "watched")

    def __init__(self, budget_ns: int) -> None:
        self.watched = 0
        self._budget_ns = budget_ns
        self._misses = 0

    def is_exceeded(self, took_ns: int, law_ns: int) -> bool:
        """Look at a tick that is watched or took longer, and at those before it.

        Args:
            took_ns: from waking up until now [ns].
            law_ns: processor time of its laws; 0 where it was not measured [ns].
        """
        self.watched = BUDGET_TICKS if took_ns > self._budget_ns else self.watched - 1
        over = law_ns > self._budget_ns and law_ns > took_ns - law_ns
        self._misses = (self._misses << 1 | over) & _ALL_TICKS
        return over and self._misses.bit_count() >= BUDGET_MISSES
