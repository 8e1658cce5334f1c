"""A hand that wanders, the same on every computer: nothing but sums and products of numbers that `random` gives."""

from __future__ import annotations

import random


class Hand:
    """Goes to one point after the other, and stands still in between.

    Args:
        seed: of the points and the trembling.
        axes: how many.
        reach_m: how far from the middle the points are [m].
        about_m: the middle [m].
    """

    def __init__(self, seed: int, axes: int, reach_m: float, about_m: tuple[float, ...] = (0.0, 0.0, 0.0)) -> None:
        self._rng = random.Random(seed)
        self._reach_m = reach_m
        self._about_m = about_m[:axes]
        self._ticks = 0
        self.position_m = [at + self._apart() for at in self._about_m]
        self.velocity_m_per_s = [0.0] * axes
        self._target_m = list(self.position_m)

    def go(self) -> tuple[float, ...]:
        """Where it is a millisecond later [m]."""
        if self._ticks % 80 == 0:
            self._target_m = [at + self._apart() for at in self._about_m]
        still = self._ticks % 240 > 200
        self._ticks += 1
        for axis, target_m in enumerate(self._target_m):
            speed = 0.95 * self.velocity_m_per_s[axis] + 1.5 * (target_m - self.position_m[axis])
            speed += 0.02 * (self._rng.random() - 0.5)
            self.velocity_m_per_s[axis] = speed = 0.0 if still else speed
            self.position_m[axis] += 1e-3 * speed
        return tuple(self.position_m)

    def _apart(self) -> float:
        return self._reach_m * (2.0 * self._rng.random() - 1.0)
