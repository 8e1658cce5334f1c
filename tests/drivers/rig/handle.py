"""A handle in simulated time, and a drive of it."""

from __future__ import annotations

import math

from hapticd_drivers.rig import motion
from hapticd_drivers.rig.motion import Drive, Moment

COUNT_M = 1e-5
BOUND_N = 0.5


class Handle:
    """A handle in simulated time, that remembers what was done to it.

    Args:
        stops_m: ends of its travel; at rest at 0.
        motor: what it does with 1 N.
        hand_n: constant force on it.
        switch_m: its switch is closed below.
    """

    def __init__(
        self,
        stops_m: tuple[float, float] = (-0.03, 0.05),
        motor: float = 1.0,
        hand_n: float = 0.0,
        switch_m: float = -math.inf,
    ) -> None:
        self.stops_m = stops_m
        self.motor = motor
        self.hand_n = hand_n
        self.switch_m = switch_m
        self.time_s = 0.0
        self.position_m = 0.0
        self.speed_m_per_s = 0.0
        self.forces_n: list[float] = []
        self.fastest_m_per_s = 0.0

    def push(self, axis: int, force_n: float) -> Moment:
        assert axis == 0
        self.forces_n.append(force_n)
        for _ in range(10):
            push_n = self.motor * force_n + self.hand_n
            friction_n = 0.03 if (self.speed_m_per_s or push_n) > 0.0 else -0.03
            if self.speed_m_per_s or abs(push_n) > 0.03:
                after = self.speed_m_per_s + (push_n - friction_n - self.speed_m_per_s) / 0.1 * 1e-4
                self.speed_m_per_s = 0.0 if self.speed_m_per_s * after < 0.0 else after
            self.position_m += self.speed_m_per_s * 1e-4
            if not self.stops_m[0] < self.position_m < self.stops_m[1]:
                self.position_m = max(self.stops_m[0], min(self.stops_m[1], self.position_m))
                self.speed_m_per_s = 0.0
            self.time_s += 1e-4
        self.fastest_m_per_s = max(self.fastest_m_per_s, abs(self.speed_m_per_s))
        counts = round(self.position_m / COUNT_M)
        return Moment(self.time_s, counts * COUNT_M, counts, self.position_m < self.switch_m)


def drive_of(handle: motion.Mover, span_m: float = 0.08) -> Drive:
    return Drive(
        handle,
        0,
        "x",
        force_n=BOUND_N,
        speed_m_per_s=0.02,
        damping_n_s_per_m=5.0,
        count_m=COUNT_M,
        span_m=span_m,
    )
