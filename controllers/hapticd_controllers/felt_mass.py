"""The mass that a law's force accelerates, and whether the device applies forces one sample late.

A law's State inherits `FeltFields`. It calls `know_nothing` at its start, `feel` at each tick, and `believe` when it
wants to know.
"""

from __future__ import annotations

from typing import Any

LIMIT = 1e12  # a quotient that is kept grows no further, in SI units
FELT_SAMPLES = 20.0  # effective samples before an identified mass is believed
LEAST_PUSH = 0.005  # negative friction beyond this share of mass / dt is a force one sample late, not an active device
LEAST_EXCITATION = 1e-4  # forces that vary less, as a share of their mean square, tell rounding and not a mass
SMOOTHED = 0.01  # share of a new dt in the period
LATE = 2.0  # in periods: a longer dt is a tick that came late, and not another sampling rate
FELT_COUNTS = 2.0  # a shorter move, in counts of the position, says more about the quantiser than about the mass


class FeltFields:
    """The scalar fields of the evidence."""

    period_s: float  # dt, smoothed: one overrun is not another sampling rate
    period_is_known: bool  # not of the first sample alone: what came before it may have taken long
    felt_mass_kg: float  # what the force accelerates; 0 while unknown
    forces_late: bool  # whether the device applies a force one sample late
    last_moved_m: float
    last_dt_s: float
    last_applied_n: float  # F(n-2)
    older_applied_n: float  # F(n-3)
    count: float  # effective samples in the sums below, which forget
    sum_w: float  # w: change of mean speed
    sum_s: float  # s: mean move, which viscous friction brakes
    sum_ss: float
    sum_sw: float
    sum_u: float  # u: mean impulse of the forces
    sum_uu: float
    sum_us: float
    sum_uw: float
    late_sum_u: float  # the same, forces one sample late
    late_sum_uu: float
    late_sum_us: float
    late_sum_uw: float


def know_nothing(state: Any, late: bool) -> None:
    """Begin without evidence.

    Args:
        state: an object with the fields of `FeltFields`.
        late: whether forces are one sample late, as far as is known.
    """
    state.period_s = 0.0
    state.period_is_known = False
    state.felt_mass_kg = 0.0
    state.forces_late = late
    state.last_moved_m = 0.0
    state.last_dt_s = 0.0
    state.last_applied_n = 0.0
    state.older_applied_n = 0.0
    state.count = 0.0
    state.sum_w = 0.0
    state.sum_s = 0.0
    state.sum_ss = 0.0
    state.sum_sw = 0.0
    state.sum_u = 0.0
    state.sum_uu = 0.0
    state.sum_us = 0.0
    state.sum_uw = 0.0
    state.late_sum_u = 0.0
    state.late_sum_uu = 0.0
    state.late_sum_us = 0.0
    state.late_sum_uw = 0.0


def keep_period(state: Any, dt_s: float) -> bool:
    """Know how long it is from sample to sample.

    Args:
        state: an object with the fields of `FeltFields`.
        dt_s: time since the last sample [s].

    Returns:
        Whether it is known from this sample on.
    """
    first = not state.period_is_known
    if first:
        state.period_is_known = state.period_s > 0.0
        state.period_s = min(state.period_s, dt_s) if state.period_is_known else dt_s
    state.period_s += SMOOTHED * (min(dt_s, LATE * state.period_s) - state.period_s)
    return first and state.period_is_known


def feel(state: Any, tick: Any, keep: float) -> None:
    """Identify the mass that the wall pushes, and whether it is pushed one sample late.

    A held force makes the change of mean speed between two moves exact, evenly sampled or not:

        w = moved(n)/dt(n) - moved(n-1)/dt(n-1)     u = (F(n-1) dt(n) + F(n-2) dt(n-1)) / 2
        m w = u - b s + hand                        s = (moved(n) + moved(n-1)) / 2

    so that a plane through (u, s, w) has the slope 1/m along u; the hand's slow force is its intercept. A second
    plane, over forces one sample older, tells the delay: the one that explains more of w is believed.

    Args:
        state: an object with the fields of `FeltFields`.
        tick: what the law is shown.
        keep: share of the evidence that a new sample leaves standing.
    """
    applied_n = tick.applied_n
    last_n = state.last_applied_n
    moved_m = tick.moved_m
    dt_s = tick.dt_s
    seen = applied_n != 0.0 and last_n != 0.0 and state.older_applied_n != 0.0
    if seen and abs(moved_m) > FELT_COUNTS * tick.resolution_m:
        last_moved_m = state.last_moved_m
        last_dt_s = state.last_dt_s
        w = moved_m / dt_s - last_moved_m / last_dt_s
        s = 0.5 * (moved_m + last_moved_m)
        u = 0.5 * (applied_n * dt_s + last_n * last_dt_s)
        late_u = 0.5 * (last_n * dt_s + state.older_applied_n * last_dt_s)
        state.count = keep * state.count + 1.0
        state.sum_w = keep * state.sum_w + w
        state.sum_s = keep * state.sum_s + s
        state.sum_ss = keep * state.sum_ss + s * s
        state.sum_sw = keep * state.sum_sw + s * w
        state.sum_u = keep * state.sum_u + u
        state.sum_uu = keep * state.sum_uu + u * u
        state.sum_us = keep * state.sum_us + u * s
        state.sum_uw = keep * state.sum_uw + u * w
        state.late_sum_u = keep * state.late_sum_u + late_u
        state.late_sum_uu = keep * state.late_sum_uu + late_u * late_u
        state.late_sum_us = keep * state.late_sum_us + late_u * s
        state.late_sum_uw = keep * state.late_sum_uw + late_u * w
    state.last_moved_m = moved_m
    state.last_dt_s = dt_s
    state.older_applied_n = last_n
    state.last_applied_n = applied_n


def believe(state: Any, find_delay: bool) -> None:
    """Mass and delay from the plane that fits better; nothing where neither force speeds the device up.

    Args:
        state: an object with the fields of `FeltFields`, from `FELT_SAMPLES` on.
        find_delay: whether the delay is to be found too.
    """
    mean_u = state.sum_u / state.count
    mean_late_u = state.late_sum_u / state.count
    variance = state.sum_uu - mean_u * state.sum_u
    covariance = state.sum_uw - mean_u * state.sum_w
    late_variance = state.late_sum_uu - mean_late_u * state.late_sum_u
    late_covariance = state.late_sum_uw - mean_late_u * state.sum_w
    braked = True
    variance_s = state.sum_ss - state.sum_s * state.sum_s / state.count
    if variance_s > 0.0:  # take out what goes with the speed
        us = state.sum_us - mean_u * state.sum_s
        late_us = state.late_sum_us - mean_late_u * state.sum_s
        sw = state.sum_sw - state.sum_s * state.sum_w / state.count
        variance -= us * us / variance_s
        covariance -= us * sw / variance_s
        late_variance -= late_us * late_us / variance_s
        late_covariance -= late_us * sw / variance_s
        # b >= 0 in the plane without delay, or so little below that an active device or rounding explains it
        pushed = sw * variance - us * covariance
        braked = pushed * state.period_s <= LEAST_PUSH * variance * variance_s
    explained = 0.0
    late_explained = 0.0
    if variance > LEAST_EXCITATION * state.sum_uu and covariance > 0.0:
        explained = covariance * covariance / variance
    if late_variance > LEAST_EXCITATION * state.late_sum_uu and late_covariance > 0.0:
        late_explained = late_covariance * late_covariance / late_variance
    if find_delay and (explained > 0.0 or late_explained > 0.0):
        state.forces_late = late_explained > explained or not braked
    if state.forces_late:
        if late_explained > 0.0:
            state.felt_mass_kg = _bounded(late_variance / late_covariance)
    elif explained > 0.0:
        state.felt_mass_kg = _bounded(variance / covariance)


def _bounded(value: float) -> float:
    if -LIMIT < value < LIMIT:
        return value
    return LIMIT if value > 0.0 else -LIMIT
