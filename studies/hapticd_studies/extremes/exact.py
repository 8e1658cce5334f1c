"""The linear loop without rounding: its characteristic polynomial in decimals, and whether a circle holds its roots.

    z^(d+1) (z^2 - p z + q) + (c1 z + c0) ((K + B/T) z - B/T)          p, q: trace and determinant of one free period

Nothing here is shared with the plant: exponentials, sines and cosines of the analytic solution, with as many digits
as cancellation takes away and then some, and the recursion of Schur and Cohn in place of an eigenvalue solver. That
decides without iteration whether all eigenvalues lie within a circle, so that their radius can be enclosed as
narrowly as wanted. Every answer carries a bound of its own rounding; where that does not suffice, digits are added.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from decimal import MAX_EMAX, MIN_EMIN, Decimal, localcontext
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from hapticd_studies.extremes.case import LoopCase
from hapticd_studies.extremes.verdict import MARGIN, Verdict

_DIGITS = (40, 160, 640, 2560)
"""Significant digits of the coefficients, tried one after the other."""

_BELOW = 1 - Decimal(str(MARGIN))
_ABOVE = 1 + Decimal(str(MARGIN))


class FreePeriod(NamedTuple):
    """What a period without the wall does; x and v at its end, from x, v and a held force.

    Attributes:
        trace, determinant: of the map of position and velocity.
        slope, swing, area: S', S and its integral, of S, the answer to a unit impulse of acceleration.
        force_now, force_before: c1 and c0, what the force of this period and of the one before add to the position
            [m/N].
    """

    trace: Decimal
    determinant: Decimal
    slope: Decimal
    swing: Decimal
    area: Decimal
    force_now: Decimal
    force_before: Decimal


def verdict(place: LoopCase) -> Verdict:
    """Stable, marginal or unstable."""
    if not inside(place, _ABOVE):
        return Verdict.UNSTABLE
    return Verdict.STABLE if inside(place, _BELOW) else Verdict.MARGINAL


def inside(place: LoopCase, radius: Decimal) -> bool:
    """Whether all eigenvalues of the linear loop lie within a circle about 0; one on the circle does not."""
    for least in _DIGITS:
        digits = least + place.force_delay_samples
        answer = _all_inside(_polynomial(place, digits), radius, digits)
        if answer is not None:
            return answer
    return False


def between(place: LoopCase, low: float, high: float) -> bool:
    """Whether the spectral radius lies between two numbers."""
    return inside(place, Decimal(high)) and (low <= 0.0 or not inside(place, Decimal(low)))


def growth(place: LoopCase, digits: int = 15) -> Decimal:
    """The spectral radius, by halving."""
    with _precision(digits + 10):
        low, high = Decimal(0), Decimal(1)
        while not inside(place, high):
            low, high = high, high * high * 2
        if not low:
            low = high / 2
            while inside(place, low):
                low, high = low * low, low
                if low < Decimal("1e-1000"):
                    return Decimal(0)
        while high - low > high.scaleb(-digits):
            middle = (low + high) / 2 if low * 4 > high else (low * high).sqrt()
            if inside(place, middle):
                high = middle
            else:
                low = middle
        return +high


def rounding(place: LoopCase) -> float:
    """How far the spectral radius moves when every coefficient of the polynomial is wrong in its last digits.

    And when mass or spring of the hand are: a hand that swings thousands of times a period has a phase whose last digit
    is thousands of times that of its frequency. To first order a root z moves by the sum of errors e |c_i z^i| over
    |p'(z)|. e: a rounding of a double for each operation that a coefficient is made of, about 64 and one more for each
    state.
    """
    coefficients = np.array([float(value) for value in _polynomial(place, 40)])
    roots = np.roots(coefficients)
    sizes = np.abs(roots)
    slopes = np.abs(np.polyval(np.polyder(coefficients), roots))
    each = np.polyval(np.abs(coefficients), sizes) / np.maximum(slopes, np.finfo(float).tiny)
    outermost = sizes >= (1.0 - 1e-6) * sizes.max()
    roundings = 64.0 + len(coefficients)
    return float(roundings * (np.finfo(float).eps * each[outermost].max() + _moved_by_a_digit(place)))


def _moved_by_a_digit(place: LoopCase) -> float:
    """How far the spectral radius moves with the last digit of the mass and of the hand's spring."""
    if not place.hand_stiffness_n_per_m:
        return 0.0
    nudged = (
        replace(place, mass_kg=math.nextafter(place.mass_kg, math.inf)),
        replace(place, hand_stiffness_n_per_m=math.nextafter(place.hand_stiffness_n_per_m, math.inf)),
    )
    here = growth(place, 25)
    return float(sum(abs(growth(one, 25) - here) for one in nudged))


@lru_cache(maxsize=1024)
def free_period(
    viscous_n_s_per_m: float, hand_stiffness_n_per_m: float, mass_kg: float, period_s: float, digits: int
) -> FreePeriod:
    """One period of a device without a wall, to `digits` digits.

    Args:
        viscous_n_s_per_m: viscous friction [N s/m].
        hand_stiffness_n_per_m: spring of the hand [N/m].
        mass_kg: what moves [kg].
        period_s: the period [s].
        digits: significant digits of every number.
    """
    with _precision(digits + _lost_digits(viscous_n_s_per_m, hand_stiffness_n_per_m, mass_kg, period_s)):
        mass, period = Decimal(mass_kg), Decimal(period_s)
        decay, stiffness = Decimal(viscous_n_s_per_m) / mass, Decimal(hand_stiffness_n_per_m) / mass
        envelope = (-decay * period / 2).exp()
        split = decay * decay / 4 - stiffness
        if split == 0:
            cosine, sine = Decimal(1), period
        elif split > 0:
            root = split.sqrt()
            up, down = (root * period).exp(), (-root * period).exp()
            cosine, sine = (up + down) / 2, (up - down) / (2 * root)
        else:
            root = (-split).sqrt()
            cosine, sine = _cosine_and_sine(root * period)
            sine /= root
        swing = envelope * sine
        slope = envelope * cosine - decay * swing / 2
        if stiffness:
            area = (1 - slope - decay * swing) / stiffness
        elif decay:
            area = (period - swing) / decay
        else:
            area = period * period / 2
        before = (swing * swing - slope * area) / mass
        return FreePeriod(2 * envelope * cosine, envelope * envelope, slope, swing, area, area / mass, before)


@lru_cache(maxsize=1024)
def friction_integrals(
    viscous_n_s_per_m: float, hand_stiffness_n_per_m: float, mass_kg: float, period_s: float
) -> tuple[Decimal, Decimal, Decimal]:
    """The integrals of S'^2, S' S and S^2 over a period, times b: the heat of friction, since v = v0 S' + q S.

    From S'' + a S' + w S = 0, multiplied by S', 1 and S:

        a int S'^2 = (1 - S'^2 - w S^2) / 2     int S' S = S^2 / 2     w int S^2 = int S'^2 - S S' - a S^2 / 2

    Args:
        viscous_n_s_per_m: viscous friction, b [N s/m].
        hand_stiffness_n_per_m: spring of the hand [N/m].
        mass_kg: what moves [kg].
        period_s: the period [s].

    Returns:
        In [N s^2/m, N s^3/m, N s^4/m].
    """
    if viscous_n_s_per_m == 0.0:
        return Decimal(0), Decimal(0), Decimal(0)
    digits = 40 + 2 * _lost_digits(viscous_n_s_per_m, hand_stiffness_n_per_m, mass_kg, period_s)
    free = free_period(viscous_n_s_per_m, hand_stiffness_n_per_m, mass_kg, period_s, digits)
    with _precision(digits):
        mass, period, viscous = Decimal(mass_kg), Decimal(period_s), Decimal(viscous_n_s_per_m)
        decay, stiffness = viscous / mass, Decimal(hand_stiffness_n_per_m) / mass
        slope, swing = free.slope, free.swing
        of_slopes = (1 - slope * slope - stiffness * swing * swing) / (2 * decay)
        if stiffness:
            of_swings = (of_slopes - swing * slope - decay * swing * swing / 2) / stiffness
        else:
            of_swings = (period - 2 * swing + of_slopes) / (decay * decay)
        return viscous * of_slopes, viscous * swing * swing / 2, viscous * of_swings


def _polynomial(place: LoopCase, digits: int) -> list[Decimal]:
    """The characteristic polynomial of the linear loop, highest power first."""
    free = free_period(
        place.viscous_n_s_per_m, place.hand_stiffness_n_per_m, place.mass_kg, place.period_s, digits + 10
    )
    with _precision(digits + 10):
        period, stiffness = Decimal(place.period_s), Decimal(place.stiffness_n_per_m)
        damping = Decimal(place.wall_damping_n_s_per_m) / period
        if damping:
            now = stiffness + damping
            wall = [free.force_now * now, free.force_before * now - free.force_now * damping]
            wall.append(-free.force_before * damping)
        else:  # one power of z fewer
            wall = [free.force_now * stiffness, free.force_before * stiffness]
        found = [Decimal(1), -free.trace, free.determinant] + [Decimal(0)] * (place.force_delay_samples + len(wall) - 2)
        for at, value in enumerate(wall):
            found[len(found) - len(wall) + at] += value
        return found


def _lost_digits(viscous_n_s_per_m: float, hand_stiffness_n_per_m: float, mass_kg: float, period_s: float) -> int:
    """How many digits 1 - S' - a S and the like lose at most, since their terms are larger than they are."""
    sizes = (viscous_n_s_per_m / mass_kg * period_s, hand_stiffness_n_per_m / mass_kg * period_s * period_s)
    return 20 + math.ceil(sum(3.0 * abs(math.log10(abs(size))) for size in sizes if size) + max(0.0, -sizes[0]))


def _all_inside(polynomial: list[Decimal], radius: Decimal, digits: int) -> bool | None:
    """Schur and Cohn: whether all roots lie within the radius; None when the digits do not suffice to tell.

    A polynomial has all its roots in the unit circle when its last coefficient is smaller than its first, and the
    polynomial of lower degree that is left of it has, once its mirror image times their quotient is taken away.
    """
    with _precision(digits + 10):
        power = Decimal(1)
        left = []
        for value in reversed(polynomial):
            left.append(value * power)
            power *= radius
        most = max(map(abs, left))
        error = most.scaleb(-digits)  # of any coefficient, at most
        while len(left) > 1:
            first, last = left[-1], left[0]
            if not last:
                del left[0]
                continue
            if abs(first) <= error:
                return None
            share = last / first
            uncertain = error * (1 + abs(share)) / (abs(first) - error)
            gap = 1 - abs(share)
            if abs(gap) <= uncertain:
                return None
            if gap < 0:
                return False
            error += error * abs(share) + uncertain * most + most.scaleb(-digits - 8)
            most += most * abs(share)
            left = [value - share * other for value, other in zip(left[1:], left[-2::-1], strict=True)]
        return True


def _cosine_and_sine(angle: Decimal) -> tuple[Decimal, Decimal]:
    halvings = max(0, 4 * angle.adjusted() + 12)
    small = angle / 2**halvings
    sums = [Decimal(1), small, Decimal(0), Decimal(0)]  # of cos and sin the positive terms, then the negative ones
    term, n = small, 1
    while term and term.adjusted() > small.adjusted() - 2 * len(small.as_tuple().digits):
        n += 1
        term = term * small / n
        sums[n % 4] += term
    cosine, sine = sums[0] - sums[2], sums[1] - sums[3]
    for _ in range(halvings):
        cosine, sine = cosine * cosine - sine * sine, 2 * cosine * sine
    return cosine, sine


@contextmanager
def _precision(digits: int) -> Iterator[None]:
    with localcontext() as context:
        context.prec = digits
        context.Emax, context.Emin = MAX_EMAX, MIN_EMIN
        yield
