"""Where the device is and how fast it moves, as far as its samples make sense."""

from __future__ import annotations

import math

from hapticd.config.models import VelocityConfig
from hapticd.device import DeviceInfo, Sample
from hapticd.errors import ConfigError
from hapticd.tick.velocity import Difference, Estimator, make_estimator

LEAST_S = 1e-9
MOST_S = 1.0
"""Time between two samples [s]: less is standing still, and for longer the nominal period goes into the laws."""

NEW_SHARE = 0.05
LONGER = 2.0
"""Share of a new time between samples in the usual one, which it counts at most so many times of, and how much shorter
than that no time between samples is, whosever clock tells it."""

MOST_M = 1e7
MOST_M_PER_S = 1e6
"""No position and no velocity is beyond these, whatever a device declares [m], [m/s]."""

MARGIN = 0.5
"""How far outside its declared workspace, as a share of its size, a device may claim to be."""

FROZEN_S = 0.02
FROZEN_SAMPLES = 20
LEAST_REPEATS = 3
"""A device is frozen that has had nothing new for this time [s], and for this many samples of its nominal rate, and at
this many reads in a row: whether loop or device is the slower one."""

FOAW_PER_S = 256_000
"""Most samples that adaptive windows may span, over all axes and ticks of a second: about 0.15 us each, where the hand
stands still."""


class Motion:
    """Positions, velocities and time, from one sample to the next.

    Args:
        velocity: how velocity is estimated.
        info: what the device declares.
        period_s: nominal time between ticks [s].

    Attributes:
        position_m: counted from the origin, one element an axis, always the same list [m].
        velocity_m_per_s: one element an axis, always the same list [m/s].
        watches_speed: whether `speed_squared` is kept.
        speed_squared: from the last two samples that made sense, whatever the estimator, over all axes [m^2/s^2].
        dt_s: time between the last two samples, as laws reckon with it; 0 when the last one was a repeat [s].
        origin_m: where the device places the point that positions count from, one element an axis [m].
        repeated: how many samples in a row came with the device time or count of the one before.
        repeated_s: for how long they have come [s].
        time_ns: when the device took the last sample, on its own clock where it has one [ns].
        estimators: of velocity, one an axis.

    Raises:
        ConfigError: velocity is to come from a device that does not measure it, or from more samples than can be
            looked at in a tick.
    """

    __slots__ = (
        "_axes",
        "_bounds_m",
        "_differences",
        "_filtered",
        "_frozen_s",
        "_has_clock",
        "_has_sequence",
        "_period_s",
        "_ran_back",
        "_sequence",
        "_usual_s",
        "_waited_s",
        "_was_short",
        "dt_s",
        "estimators",
        "origin_m",
        "position_m",
        "repeated",
        "repeated_s",
        "speed_squared",
        "time_ns",
        "velocity_m_per_s",
        "watches_speed",
    )

    def __init__(self, velocity: VelocityConfig, info: DeviceInfo, period_s: float) -> None:
        if velocity.estimator == "device" and not info.has_velocity:
            raise ConfigError(f'velocity.estimator = "device": {info.model} does not measure its velocity')
        axes = len(info.axes)
        most = int(FOAW_PER_S * period_s / axes)
        if velocity.estimator == "foaw" and velocity.samples > most:
            raise ConfigError(
                f"velocity.samples = {velocity.samples}: foaw looks at each of them in every tick; at this rate and on "
                f"{info.model} it has time for {most}"
            )
        self.position_m = [0.0] * axes
        self.velocity_m_per_s = [0.0] * axes
        self.speed_squared = 0.0
        self.dt_s = period_s
        self.origin_m = [0.0] * axes
        self.repeated = 0
        self.repeated_s = 0.0
        self._axes = range(axes)
        self._period_s = period_s
        self.estimators: list[Estimator] = [make_estimator(velocity, info.resolution_m) for _ in range(axes)]
        self.watches_speed = False
        # Less half a sample, so that no clock's rounding decides.
        self._frozen_s = max(FROZEN_S, FROZEN_SAMPLES / info.nominal_rate_hz) * (1.0 - 0.5 / FROZEN_SAMPLES)
        self._filtered = not isinstance(self.estimators[0], Difference)
        self._differences = [Difference() for _ in range(axes)]
        self._bounds_m = [
            (max(low - MARGIN * (high - low), -MOST_M), min(high + MARGIN * (high - low), MOST_M))
            for low, high in info.workspace_m
        ]
        self._has_clock = info.has_clock
        self._has_sequence = info.has_sequence
        self.time_ns = -1
        self._sequence = -1
        self._waited_s = 0.0
        self._ran_back = False  # the device's clock, since the last sample that was taken in
        self._usual_s = period_s  # between samples
        self._was_short = False

    def start(self, sample: Sample) -> bool:
        """Begin at a sample, at rest; False when it makes no sense, and it is not known where the device is."""
        self.time_ns = sample.time_ns
        self._sequence = sample.sequence
        self._ran_back = False
        if not self._is_possible(sample):
            return False
        for axis in self._axes:
            self.position_m[axis] = position_m = sample.position_m[axis]
            self._stand(axis, position_m)
        return True

    def see(self, sample: Sample, clock_dt_s: float, passed_s: float, at_rest: bool) -> bool:
        """Take a sample in; False when it makes no sense. A repeat changes nothing but the count of repeats.

        Args:
            sample: the newest state of the device.
            clock_dt_s: time since the last tick on this computer's clock, for devices without one [s].
            passed_s: time that a tick counts for where its device has no news [s].
            at_rest: forget what came before: the device stands where this sample says.
        """
        if self._has_clock:
            dt_s = (sample.time_ns - self.time_ns) * 1e-9
            repeats = dt_s <= 0.0
            self.time_ns = sample.time_ns
        else:
            repeats = self._has_sequence and sample.sequence == self._sequence
            self._sequence = sample.sequence
            self._waited_s += clock_dt_s
            dt_s = 0.0
            if not repeats:
                dt_s = self._waited_s
                self._waited_s = 0.0
        if repeats:
            self.repeated += 1
            self.repeated_s += passed_s
            if dt_s < 0.0:
                self._ran_back = True
            if not at_rest:
                self.dt_s = 0.0
                return self._is_possible(sample)
        else:
            if self.repeated:
                if self._ran_back:  # how long that was, this computer's clock tells
                    self._ran_back = False
                    dt_s = self.repeated_s + passed_s
                self.repeated = 0
                self.repeated_s = 0.0
            dt_s = self._between(dt_s)
        if LEAST_S <= dt_s < MOST_S:
            self.dt_s = dt_s
        else:
            self.dt_s = self._period_s
            if not MOST_S <= dt_s < math.inf:
                dt_s = 0.0
        speed_squared = 0.0
        watches_speed = self.watches_speed
        origin_m = self.origin_m
        for axis in self._axes:
            position_m = sample.position_m[axis]
            low_m, high_m = self._bounds_m[axis]
            if not low_m <= position_m <= high_m:  # false for NaN as well
                return False
            position_m -= origin_m[axis]
            estimator = self.estimators[axis]
            if at_rest:
                self._stand(axis, position_m)
            velocity_m_per_s = estimator.update(position_m, dt_s, sample.velocity_m_per_s[axis])
            if not -MOST_M_PER_S < velocity_m_per_s < MOST_M_PER_S:
                return False
            self.position_m[axis] = position_m
            self.velocity_m_per_s[axis] = velocity_m_per_s
            if watches_speed:
                if self._filtered:
                    velocity_m_per_s = self._differences[axis].update(position_m, dt_s, 0.0)
                speed_squared += velocity_m_per_s * velocity_m_per_s
        self.speed_squared = speed_squared
        return True

    def _between(self, dt_s: float) -> float:
        """Time between two samples, as far as it can be believed [s].

        No clock tells it of each sample alone. The tick after a late one comes early, and what a device without a clock
        has by then is a whole sample newer; a device's own clock may be set or jitter. Else a count of the position
        would be a blow. Short ones in a row are another rate.
        """
        if not LEAST_S <= dt_s < MOST_S:
            return dt_s
        short = dt_s * LONGER < self._usual_s
        if short and self._was_short:
            self._usual_s /= LONGER
        self._was_short = short
        self._usual_s += NEW_SHARE * (min(dt_s, LONGER * self._usual_s) - self._usual_s)
        return max(dt_s, self._usual_s / LONGER)

    @property
    def frozen(self) -> bool:
        """Whether the device has had nothing new for too long to be relied on."""
        return self.repeated >= LEAST_REPEATS and self.repeated_s >= self._frozen_s

    def watch_speed(self, watch: bool) -> None:
        """Keep `speed_squared` from the next sample on, or not."""
        if watch and not self.watches_speed:
            for axis in self._axes:
                self._differences[axis].start(self.position_m[axis])
        self.watches_speed = watch

    def move_origin(self, origin_m: list[float]) -> None:
        """Count positions from another point, and stand there at rest [m]."""
        for axis in self._axes:
            self.position_m[axis] += self.origin_m[axis] - origin_m[axis]
            self.velocity_m_per_s[axis] = 0.0
            self._stand(axis, self.position_m[axis])
        self.origin_m = origin_m

    def _stand(self, axis: int, position_m: float) -> None:
        self.estimators[axis].start(position_m)
        self._differences[axis].start(position_m)

    def _is_possible(self, sample: Sample) -> bool:
        """Whether the device may be there; a NaN is nowhere."""
        for position_m, (low_m, high_m) in zip(sample.position_m, self._bounds_m, strict=True):
            if not low_m <= position_m <= high_m:
                return False
        return True
