"""Random numbers of a study: from a name alone, so that any device can be replayed, and of four digits."""

from __future__ import annotations

from random import Random


class Draws(Random):
    """A generator that gives values which can be read and typed.

    Args:
        name: what is drawn, such as "hapticd robustness 1:57"; the same name gives the same numbers anywhere.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)

    def even(self, low: float, high: float) -> float:
        """A value of a range, all alike."""
        return digits(self.uniform(low, high))

    def logarithmic(self, low: float, high: float) -> float:
        """A value of a range, all orders of magnitude alike."""
        return digits(low * (high / low) ** self.random())


def digits(value: float) -> float:
    """Four digits, which can be read and typed."""
    return float(f"{value:.4g}")
