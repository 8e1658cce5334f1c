"""Exactly what a constant force does over a time: the zero-order hold."""

from __future__ import annotations

_TERMS = 17  # of the series below: the next one is under 1e-19 of the sum


def flow(decay_per_s: float, stiffness_per_s2: float, t_s: float) -> tuple[float, float, float]:
    """What x'' + a x' + w x = u makes of a start (x, v) in a time t, whatever a and w are.

        v(t) = S' v + S q        x(t) = x + S v + IS q        q = u - w x,  IS = integral of S from 0 to t

    S is the answer to a unit impulse. Its Taylor series over a short enough time, doubled as often as needed, has
    no case distinctions and does not cancel: not for a -> 0 or w -> 0, nor near critical damping.

    Returns:
        S', S [s] and IS [s^2] at t.
    """
    short_s = t_s
    doublings = 0
    while abs(decay_per_s) * short_s > 0.5 or abs(stiffness_per_s2) * short_s * short_s > 0.25:
        short_s = short_s * 0.5
        doublings += 1
    decay = decay_per_s * short_s
    stiffness = stiffness_per_s2 * short_s * short_s
    # S = short_s * (c1 + c2 + ...) with c(n+1) = -decay c(n) / (n+1) - stiffness c(n-1) / (n (n+1))
    before = 0.0
    term = 1.0
    slope = 0.0
    swing = 0.0
    area = 0.0
    for n in range(1, _TERMS):
        slope += n * term
        swing += term
        area += term / (n + 1)
        after = -(decay * term + stiffness * before / n) / (n + 1)
        before = term
        term = after
    swing = swing * short_s
    area = area * short_s * short_s
    for _ in range(doublings):
        rest = 1.0 - stiffness_per_s2 * area
        area = area * (1.0 + slope) + swing * (swing + decay_per_s * area)
        doubled = swing * (rest + slope)
        slope = slope * slope - stiffness_per_s2 * swing * swing
        swing = doubled
    return slope, swing, area
