"""A hand that comes to stay: from where and how fast, where it should come to rest, and whether it did."""

from __future__ import annotations

from dataclasses import dataclass

from hapticd.law import LawParams
from hapticd.offline.outcome import Balance, Criterion, Outcome, hand_share
from hapticd.simulation.batch import Point
from hapticd_studies.transparency.devices import Held

DURATION_S = 4.0


@dataclass(frozen=True, slots=True)
class Arrival:
    """A constant press.

    Attributes:
        force_n: how hard, > 0 [N].
        from_m: where it starts, > 0 outside [m].
        speed_m_per_s: towards the wall [m/s].
    """

    force_n: float
    from_m: float
    speed_m_per_s: float

    def balance(self, device: Held) -> Balance:
        """Where hand and springs balance."""
        reaches = hand_share(device.options)
        springs = device.stiffness_n_per_m + reaches * device.options.hand.stiffness_n_per_m
        return Balance(-reaches * self.force_n / springs, springs)


HARD = Arrival(3.0, 0.002, 0.2)
GENTLE = Arrival(3.0, 0.0, 0.0)


def point(how: Arrival, device: Held, params: LawParams, max_force_n: float) -> Point:
    """It as a loop; settled means within 5 % of the depth, 3 steps of the sensor or 10 um, whichever is most."""
    at = how.balance(device)
    options = device.pressed(
        [(0.0, -how.force_n)], initial_position_m=how.from_m, initial_velocity_m_per_s=-how.speed_m_per_s
    )
    band_m = max(0.05 * abs(at.x_m), 3.0 * device.options.resolution_m, 1e-5)
    return Point(options, device.wall, params, device.period_s, max_force_n, target_m=at.x_m, band_m=band_m)


def outcome(how: Arrival, device: Held, criterion: Criterion, finite: bool, span_m: float, mean_m: float) -> Outcome:
    """What became of it, by the end of the run."""
    if not finite:
        return Outcome.DIVERGED
    return criterion.outcome(device.options, how.balance(device), span_m, mean_m)
