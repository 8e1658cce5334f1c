"""A stiffness or a damping that goes from one value to another: as a mix of the two forces, each within the limit.

A stiffness that went over by itself would move a stretched spring's force, held at its limit for most of the ramp, all
in the ramp's last step.
"""

from __future__ import annotations


class Ramped:
    """A coefficient c of a force c s that is never more than a limit.

        f(s) = (1 - w) min(c_old s, limit) + w min(c_new s, limit),     w from 0 to 1 by the ramp

    Args:
        value: to begin with, >= 0.

    Attributes:
        goal: where it goes, or is.
    """

    __slots__ = ("_begins", "_from", "_share", "goal")

    def __init__(self, value: float) -> None:
        self.goal = self._from = value
        self._share = 1.0
        self._begins = False

    @property
    def now(self) -> float:
        """The coefficient at s = 0."""
        return self.goal if self._share >= 1.0 else self._from + self._share * (self.goal - self._from)

    def aim(self, goal: float, s: float, limit: float) -> None:
        """Go to another value, from the force that is there now.

        Args:
            goal: the value, >= 0.
            s: what the force is proportional to, now, >= 0.
            limit: largest force.
        """
        self._from = self.force(s, limit) / s if s > 0.0 else self.now
        self.goal = goal
        self._share = 0.0
        self._begins = True

    def begin(self, share: float) -> None:
        """Come to where it goes from nothing.

        Args:
            share: how much of the way is behind it, 0 to 1; 1: be there.
        """
        self._from = 0.0
        self._share = share
        self._begins = True

    def go_on(self, step: float, first: float) -> None:
        """Take a step of the ramp.

        Args:
            step: a share of the whole.
            first: the same of one that has just begun: what passed of a late tick before is no part of it.
        """
        self._share = min(1.0, self._share + (first if self._begins else step))
        self._begins = False

    def force(self, s: float, limit: float) -> float:
        """The force at s."""
        force = min(self.goal * s, limit)
        if self._share >= 1.0:
            return force
        return self._share * force + (1.0 - self._share) * min(self._from * s, limit)

    def stored(self, s: float, limit: float) -> float:
        """What such a spring has stored at s, from there to 0."""
        stored = _stored(self.goal, s, limit)
        if self._share >= 1.0:
            return stored
        return self._share * stored + (1.0 - self._share) * _stored(self._from, s, limit)

    def copy_to(self, other: Ramped) -> None:
        """Make another one the same."""
        other.goal, other._from, other._share = self.goal, self._from, self._share


def _stored(value: float, s: float, limit: float) -> float:
    force = value * s
    if force <= limit:
        return 0.5 * force * s
    return limit * (s - 0.5 * limit / value)
