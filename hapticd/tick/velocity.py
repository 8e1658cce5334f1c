"""Velocity from sampled positions.

Every estimator has the same two calls: `start` at a position at rest, `update` once a tick.
"""

from __future__ import annotations

import math
from typing import Protocol

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

    __slots__ = ("_position_m", "_velocity_m_per_s")

    def start(self, position_m: float) -> None:
        """Forget the past."""
        self._position_m = position_m
        self._velocity_m_per_s = 0.0

    def update(self, position_m: float, dt_s: float, device_m_per_s: float) -> float:
        """Velocity now [m/s]; the last one while time stands still."""
        if dt_s > 0.0:
            self._velocity_m_per_s = (position_m - self._position_m) / dt_s
            self._position_m = position_m
        return self._velocity_m_per_s


class _History:
    """The last positions and the time each was taken, newest at `newest`."""

    __slots__ = ("filled", "newest", "position_m", "size", "time_s")

    def __init__(self, size: int) -> None:
        self.size = size
        self.position_m = [0.0] * size
        self.time_s = [0.0] * size
        self.newest = 0
        self.filled = 0

    def start(self, position_m: float) -> None:
        self.newest = 0
        self.filled = 1
        self.position_m[0] = position_m
        self.time_s[0] = 0.0

    def push(self, position_m: float, dt_s: float) -> None:
        last_s = self.time_s[self.newest]
        if last_s > 10.0:  # keep the times small, so that their differences stay exact over days
            for at in range(self.size):
                self.time_s[at] -= last_s
            last_s = 0.0
        self.newest = (self.newest + 1) % self.size
        self.position_m[self.newest] = position_m
        self.time_s[self.newest] = last_s + dt_s
        if self.filled < self.size:
            self.filled += 1


class LongDifference:
    """v(n) = (x(n) - x(n-N)) / (t(n) - t(n-N)): quieter than one sample, late by N/2 samples.

    Args:
        samples: N.
    """

    __slots__ = ("_history", "_velocity_m_per_s")

    def __init__(self, samples: int) -> None:
        self._history = _History(samples + 1)

    def start(self, position_m: float) -> None:
        """Forget the past."""
        self._history.start(position_m)
        self._velocity_m_per_s = 0.0

    def update(self, position_m: float, dt_s: float, device_m_per_s: float) -> float:
        """Velocity now [m/s], over fewer samples until N have come."""
        if dt_s > 0.0:
            history = self._history
            history.push(position_m, dt_s)
            oldest = (history.newest + 1 - history.filled) % history.size
            span_s = history.time_s[history.newest] - history.time_s[oldest]
            self._velocity_m_per_s = (position_m - history.position_m[oldest]) / span_s
        return self._velocity_m_per_s


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


class AdaptiveWindow:
    """First-order adaptive windowing, end-fit: the longest window whose line misses no sample by more than the noise.

    Janabi-Sharifi, Hayward and Chen, "Discrete-time adaptive windowing for velocity estimation", IEEE T-CST 8(6),
    2000. The bound is one full count, since both end points may be off by half of one.

    Every sample that a window spans allows the line through the newest one a range of slopes; a window may be longer
    by one as long as its own slope is in the range that all samples inside it leave. One pass over the samples does.

    Args:
        samples: longest window.
        noise_m: bound of the error between line and samples [m].
    """

    __slots__ = ("_history", "_noise_m", "_velocity_m_per_s")

    def __init__(self, samples: int, noise_m: float) -> None:
        self._history = _History(samples + 1)
        self._noise_m = noise_m * (1.0 + 1e-9)

    def start(self, position_m: float) -> None:
        """Forget the past."""
        self._history.start(position_m)
        self._velocity_m_per_s = 0.0

    def update(self, position_m: float, dt_s: float, device_m_per_s: float) -> float:
        """Velocity now [m/s]; the last one while time stands still."""
        if dt_s <= 0.0:
            return self._velocity_m_per_s
        history = self._history
        history.push(position_m, dt_s)
        now_s = history.time_s[history.newest]
        lowest = -math.inf
        highest = math.inf
        for length in range(1, history.filled):
            at = history.newest - length  # a negative index counts from the end, as the ring does
            span_s = now_s - history.time_s[at]
            slope = (position_m - history.position_m[at]) / span_s
            if not lowest <= slope <= highest:
                break
            self._velocity_m_per_s = slope
            room = self._noise_m / span_s
            lowest = max(lowest, slope - room)
            highest = min(highest, slope + room)
        return self._velocity_m_per_s


class DeviceVelocity:
    """The velocity that the device reports."""

    __slots__ = ()

    def start(self, position_m: float) -> None:
        """Nothing to forget."""

    def update(self, position_m: float, dt_s: float, device_m_per_s: float) -> float:
        """The device's own velocity [m/s]."""
        return device_m_per_s
