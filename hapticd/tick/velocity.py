"""Velocity from sampled positions.

Every estimator has the same two calls: `start` at a position at rest, `update` once a tick. `Difference.update` and
`push` are the batch kernel's too.
"""

from __future__ import annotations

import math
from typing import Any, Protocol

from hapticd.config.models import VelocityConfig


class Estimator(Protocol):
    """What turns positions into a velocity."""

    def start(self, position_m: float) -> None:
        """Forget the past: the axis stands at this position."""

    def update(self, position_m: float, dt_s: float, device_m_per_s: float) -> float:
        """Velocity now [m/s], from the new position, the time since the last one and the device's own velocity.

        The time is 0 where it stood still, else a nanosecond or more.
        """


def make_estimator(config: VelocityConfig, resolution_m: float) -> Estimator:
    """The estimator that a configuration asks for.

    Args:
        config: the [velocity] table.
        resolution_m: smallest step of the device's position [m].
    """
    if config.estimator == "device":
        return DeviceVelocity()
    if config.estimator == "lowpass":
        return LowPass(config.cutoff_hz)
    if config.estimator == "foaw":
        return AdaptiveWindow(config.samples, resolution_m if config.noise_m is None else config.noise_m)
    if config.samples == 1:
        return Difference()
    return LongDifference(config.samples)


class Difference:
    """v(n) = (x(n) - x(n-1)) / T: no lag beyond half a sample, all of the quantisation noise."""

    __slots__ = ("last_m", "velocity_m_per_s")

    def start(self, position_m: float) -> None:
        """Forget the past."""
        self.last_m = position_m
        self.velocity_m_per_s = 0.0

    def update(self, position_m: float, dt_s: float, device_m_per_s: float) -> float:
        """Velocity now [m/s]; the last one while time stands still."""
        if dt_s > 0.0:
            self.velocity_m_per_s = (position_m - self.last_m) / dt_s
            self.last_m = position_m
        return self.velocity_m_per_s


def push(ring: Any, position_m: Any, time_s: Any, now_m: float, dt_s: float) -> None:
    """Enter a position into a history of the last ones.

    Args:
        ring: an object with the integers `size`, of the longest history, `newest`, the index of the last entry, and
            `filled`, how many there are.
        position_m: the entries [m].
        time_s: when each was taken; all of them may move together [s].
        now_m: the new position [m].
        dt_s: time since the last one [s].
    """
    newest = ring.newest
    last_s = time_s[newest]
    if last_s > 10.0:  # keep the times small, so that their differences stay exact over days
        for at in range(ring.size):
            time_s[at] -= last_s
        last_s = 0.0
    ring.newest = newest = (newest + 1) % ring.size
    position_m[newest] = now_m
    time_s[newest] = last_s + dt_s
    if ring.filled < ring.size:
        ring.filled += 1


class _History:
    """Base of those that remember the last positions and the time each was taken."""

    __slots__ = ("filled", "newest", "position_m", "size", "time_s", "velocity_m_per_s")

    def __init__(self, samples: int) -> None:
        self.size = samples + 1
        self.position_m = [0.0] * self.size
        self.time_s = [0.0] * self.size

    def start(self, position_m: float) -> None:
        """Forget the past."""
        self.newest = 0
        self.filled = 1
        self.position_m[0] = position_m
        self.time_s[0] = 0.0
        self.velocity_m_per_s = 0.0


class LongDifference(_History):
    """v(n) = (x(n) - x(n-N)) / (t(n) - t(n-N)): quieter than one sample, late by N/2 samples.

    Args:
        samples: N.
    """

    __slots__ = ()

    def update(self, position_m: float, dt_s: float, device_m_per_s: float) -> float:
        """Velocity now [m/s], over fewer samples until N have come; the last one while time stands still."""
        if dt_s > 0.0:
            time_s = self.time_s
            push(self, self.position_m, time_s, position_m, dt_s)
            newest = self.newest
            oldest = (newest + 1 - self.filled) % self.size
            self.velocity_m_per_s = (position_m - self.position_m[oldest]) / (time_s[newest] - time_s[oldest])
        return self.velocity_m_per_s


class LowPass:
    """First-order low-pass of the one-sample difference: v(n) = v(n-1) + (1 - exp(-w T)) (d(n) - v(n-1)).

    Args:
        cutoff_hz: corner frequency, w = 2 pi cutoff_hz.
    """

    __slots__ = ("_dt_s", "_omega", "_position_m", "_velocity_m_per_s", "_weight")

    def __init__(self, cutoff_hz: float) -> None:
        self._omega = 2.0 * math.pi * cutoff_hz
        self._dt_s = 0.0
        self._weight = 0.0

    def start(self, position_m: float) -> None:
        """Forget the past."""
        self._position_m = position_m
        self._velocity_m_per_s = 0.0

    def update(self, position_m: float, dt_s: float, device_m_per_s: float) -> float:
        """Velocity now [m/s]; the last one while time stands still."""
        if dt_s > 0.0:
            if dt_s != self._dt_s:
                self._dt_s = dt_s
                self._weight = -math.expm1(-self._omega * dt_s)
            difference = (position_m - self._position_m) / dt_s
            self._velocity_m_per_s += self._weight * (difference - self._velocity_m_per_s)
            self._position_m = position_m
        return self._velocity_m_per_s


class AdaptiveWindow(_History):
    """First-order adaptive windowing, end-fit: the longest window whose line misses no sample by more than the noise.

    Janabi-Sharifi, Hayward and Chen, "Discrete-time adaptive windowing for velocity estimation", IEEE T-CST 8(6),
    2000. The bound is one full count, since both end points may be off by half of one.

    Every sample that a window spans allows the line through the newest one a range of slopes; a window may be longer
    by one as long as its own slope is in the range that all samples inside it leave. One pass over the samples does.

    Args:
        samples: longest window.
        noise_m: bound of the error between line and samples [m].
    """

    __slots__ = ("_noise_m",)

    def __init__(self, samples: int, noise_m: float) -> None:
        super().__init__(samples)
        self._noise_m = noise_m * (1.0 + 1e-9)

    def update(self, position_m: float, dt_s: float, device_m_per_s: float) -> float:
        """Velocity now [m/s]; the last one while time stands still."""
        if dt_s <= 0.0:
            return self.velocity_m_per_s
        time_s = self.time_s
        push(self, self.position_m, time_s, position_m, dt_s)
        newest = self.newest
        now_s = time_s[newest]
        noise_m = self._noise_m
        lowest = -math.inf
        highest = math.inf
        for length in range(1, self.filled):
            at = newest - length  # a negative index counts from the end, as the ring does
            span_s = now_s - time_s[at]
            slope = (position_m - self.position_m[at]) / span_s
            if not lowest <= slope <= highest:
                break
            self.velocity_m_per_s = slope
            room = noise_m / span_s
            if slope - room > lowest:
                lowest = slope - room
            if slope + room < highest:
                highest = slope + room
        return self.velocity_m_per_s


class DeviceVelocity:
    """The velocity that the device reports."""

    __slots__ = ()

    def start(self, position_m: float) -> None:
        """Nothing to forget."""

    def update(self, position_m: float, dt_s: float, device_m_per_s: float) -> float:
        """The device's own velocity [m/s]."""
        return device_m_per_s
