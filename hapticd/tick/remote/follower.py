"""A point that goes after what a client says of its target, without a jump and no faster than a limit."""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, inf, sqrt

MOST_M = 1e7
"""No target is farther away than any device can be [m]."""

HASTE_PER_S = 400.0
"""How fast what is left of an update is made up for: to 9 % in 10 ms. A target whose velocity is said has no lag."""


class Follower:
    """Where the followed target is, one element an axis.

        e(n) = e(n-1) + m(n)      m(n) = p^2 m(n-1) - (1 - p)^2 e(n-1)      p = exp(-h dt)

    where e is the way from the client's target, moved on with its velocity, to the followed one: it dies away without
    passing through 0 (both poles are p), whatever dt is. From one tick to the next the followed target moves by at most
    s dt, at a speed that differs by at most h s dt from the one before, with s the largest and h = `HASTE_PER_S`. Where
    s is made less, the speed comes down to it at that rate, since a damper takes it for a force.

    Args:
        axes: how many.
        max_speed_m_per_s: how fast it may be [m/s].
        hold_s: how long it goes on with a velocity that was said [s].

    Attributes:
        at_m: where it is [m].
        goal_m: where it is to be: what was said, moved on with its velocity [m].
        moved_m: its last move [m].
        speed_m_per_s: that over the time it took [m/s].
        max_speed_m_per_s, hold_s: the limits.
        rests: whether it is where it is to be, and stays.
    """

    __slots__ = (
        "_ahead_s",
        "_axes",
        "_decay",
        "_dt_s",
        "_goal_m_per_s",
        "_since_s",
        "at_m",
        "goal_m",
        "hold_s",
        "max_speed_m_per_s",
        "moved_m",
        "rests",
        "speed_m_per_s",
    )

    def __init__(self, axes: int, max_speed_m_per_s: float, hold_s: float) -> None:
        self._axes = range(axes)
        self.max_speed_m_per_s = max_speed_m_per_s
        self.hold_s = hold_s
        self.at_m = [0.0] * axes
        self.moved_m = [0.0] * axes
        self.speed_m_per_s = [0.0] * axes
        self.rests = True
        self.goal_m = [0.0] * axes
        self._goal_m_per_s = [0.0] * axes
        self._ahead_s = 0.0
        self._dt_s = 0.0
        self._since_s = inf
        self._decay = 1.0

    def begin(self, position_m: Sequence[float], velocity_m_per_s: Sequence[float]) -> None:
        """Be somewhere, at a speed, without having moved; the goal stays where it is."""
        share = _share(velocity_m_per_s, self._axes, self.max_speed_m_per_s)
        for axis in self._axes:
            self.at_m[axis] = position_m[axis]
            self.speed_m_per_s[axis] = share * velocity_m_per_s[axis]
            self.moved_m[axis] = 0.0
        self.rests = False

    def aim(
        self,
        position_m: Sequence[float] | None,
        velocity_m_per_s: Sequence[float] | None = None,
        since_s: float = inf,
        said_s: float = 0.0,
    ) -> None:
        """Go to where a client says that the target is now, and on with its velocity.

        Args:
            position_m: one element an axis, whatever it is beyond; None: where it has come to by what was said [m].
            velocity_m_per_s: the same; None: it stands as far as is known [m/s].
            since_s: how long ago that will be after the next move, which may take longer: a late tick, or slow samples
                [s].
            said_s: how long it has gone on with that velocity already: the place is an older one [s].
        """
        share = 0.0
        if velocity_m_per_s is not None:
            share = _share(velocity_m_per_s, self._axes, self.max_speed_m_per_s)
        ahead_s = min(said_s, self.hold_s)
        for axis in self._axes:
            if position_m is not None:
                self.goal_m[axis] = min(max(position_m[axis], -MOST_M), MOST_M)
            self._goal_m_per_s[axis] = 0.0 if velocity_m_per_s is None else share * velocity_m_per_s[axis]
            self.goal_m[axis] += self._goal_m_per_s[axis] * ahead_s
        self._ahead_s = ahead_s
        self._since_s = since_s
        self.rests = False

    def wait(self, passed_s: float) -> None:
        """Know that time has passed without a move [s]."""
        self._since_s += passed_s

    def move(self, dt_s: float) -> None:
        """Go on by a tick.

        Args:
            dt_s: time since the last one, more than 0 [s].
        """
        if dt_s != self._dt_s:
            self._dt_s = dt_s
            self._decay = exp(-HASTE_PER_S * dt_s)
        keep = self._decay * self._decay
        lost = (1.0 - self._decay) * (1.0 - self._decay)
        ahead_s = min(dt_s, self._since_s, max(0.0, self.hold_s - self._ahead_s))
        self._since_s = inf
        self._ahead_s += ahead_s
        goal_share = ahead_s / dt_s
        most = self.max_speed_m_per_s
        gain = HASTE_PER_S * most * dt_s
        speed_m_per_s = self.speed_m_per_s
        wanted = []
        change_squared = before_squared = 0.0
        for axis in self._axes:
            before = speed_m_per_s[axis]
            before_squared += before * before
            goal_m_per_s = goal_share * self._goal_m_per_s[axis]
            off_m = self.at_m[axis] - self.goal_m[axis]
            self.goal_m[axis] += goal_m_per_s * dt_s
            now = goal_m_per_s + keep * (before - goal_m_per_s) - lost * off_m / dt_s
            wanted.append(now)
            change_squared += (now - before) * (now - before)
        if change_squared > gain * gain:
            share = gain / sqrt(change_squared)
            for axis in self._axes:
                wanted[axis] = speed_m_per_s[axis] + share * (wanted[axis] - speed_m_per_s[axis])
        if before_squared > most * most:  # the limit has come down: the speed goes after it
            most = max(most, sqrt(before_squared) - gain)
        share = _share(wanted, self._axes, most)
        moving = False
        for axis in self._axes:
            speed_m_per_s[axis] = now = share * wanted[axis]
            self.moved_m[axis] = moved_m = now * dt_s
            self.at_m[axis] += moved_m
            if moved_m > 1e-12 or moved_m < -1e-12:
                moving = True
        self.rests = not moving and self._ahead_s >= self.hold_s


def _share(vector: Sequence[float], axes: range, most: float) -> float:
    """What a vector is to be multiplied by to be no longer than this."""
    largest = 0.0
    for axis in axes:
        largest = max(largest, abs(vector[axis]))
    if largest <= 0.5 * most:
        return 1.0
    squared = 0.0
    for axis in axes:
        part = vector[axis] / largest
        squared += part * part
    length = largest * sqrt(squared)
    return most / length if length > most else 1.0
