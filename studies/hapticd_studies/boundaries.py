"""How stiff a sampled wall may be: the analytic limits that measured regions are held against.

    m a + b v = F + F_hand,     F(n) = -K x(n-d) - B (x(n-d) - x(n-d-1)) / T,     held over a period T

A limit is the largest K [N/m]: 0 where no stiffness will do, infinite where any will, NaN where a formula is silent.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from hapticd.simulation.options import Flexible
from hapticd.simulation.plant import flow
from hapticd_studies.sampled import Sampled, flexible_plant, late_plant

DAMPER_PEAK = (0.6862915010152397, 0.1444693492260521, 0.0624304893523135, 0.0347816935996251)
"""Largest stiffness [m/T^2] that any wall damping makes stable on a bare mass, with 0, 1, 2, 3 samples of delay."""


@dataclass(frozen=True, slots=True)
class Loop:
    """What a limit depends on.

    Attributes:
        mass_kg: mass that moves, hand included [kg].
        viscous_n_s_per_m: damping of the device itself, b: all that a limit for any operator may count on [N s/m].
        period_s: T [s].
        wall_damping_n_s_per_m: B [N s/m].
        delay_samples: d.
        coulomb_n: Coulomb friction [N].
        resolution_m: step of the position sensor [m].
        hand_n_per_m: spring of the hand [N/m].
        hand_n_s_per_m: damping of the hand [N s/m].
        late_s: time besides the samples of delay [s].
        flexible: a spring between motor and handle.
        hand_kg: what of the mass is the hand's, which then moves with the handle [kg].
    """

    mass_kg: float
    viscous_n_s_per_m: float
    period_s: float
    wall_damping_n_s_per_m: float = 0.0
    delay_samples: int = 0
    coulomb_n: float = 0.0
    resolution_m: float = 0.0
    hand_n_per_m: float = 0.0
    hand_n_s_per_m: float = 0.0
    late_s: float = 0.0
    flexible: Flexible | None = None
    hand_kg: float = 0.0

    @property
    def rigid(self) -> bool:
        """Whether the force comes on a sample and nothing bends: closed forms hold."""
        return self.late_s == 0.0 and self.flexible is None

    @property
    def damping_n_s_per_m(self) -> float:
        """Damping of device and hand, which the loop of this one hand has [N s/m]."""
        return self.viscous_n_s_per_m + self.hand_n_s_per_m


@dataclass(frozen=True, slots=True)
class Boundary:
    """One analytic limit.

    Attributes:
        key: name in files.
        label: name in a legend, with its source.
        limit_n_per_m: the limit of a loop.
    """

    key: str
    label: str
    limit_n_per_m: Callable[[Loop], float]


def stable_limit(loop: Loop) -> float:
    """Where the linear loop stops being stable, without quantisation, friction or force limit [N/m].

    Closed forms where there are some: a spring alone with d = 0 or 1, and the digital damper on a bare mass.
    """
    if loop.hand_n_per_m == 0.0 and loop.rigid:
        if loop.wall_damping_n_s_per_m == 0.0 and loop.delay_samples in (0, 1):
            return spring_limit(loop.mass_kg, loop.damping_n_s_per_m, loop.period_s, loop.delay_samples)
        if loop.damping_n_s_per_m == 0.0 and loop.delay_samples == 0 and loop.wall_damping_n_s_per_m > 0.0:
            return damper_limit(loop.mass_kg, loop.wall_damping_n_s_per_m, loop.period_s)
    return linear_limit(loop)


def spring_limit(mass_kg: float, viscous_n_s_per_m: float, period_s: float, delay_samples: int = 0) -> float:
    """The exact limit of a spring alone, d = 0 or 1; about 2b/T and 2b/3T [N/m].

    d = 0    z^2 + (K c1 - 1 - a) z + a + K c0                    a = exp(-bT/m)
    d = 1    z^3 - (1 + a) z^2 + (a + K c1) z + K c0
    """
    if viscous_n_s_per_m <= 0.0:
        return 0.0
    loses, a, c1, c0 = _plant(mass_kg, viscous_n_s_per_m, period_s)
    if delay_samples == 0:
        return min(loses / c0, 2.0 * (1.0 + a) / (c1 - c0) if c1 > c0 else math.inf)
    if delay_samples == 1:
        s = c1 + (1.0 + a) * c0
        return 2.0 * loses / (s + math.sqrt(s * s + 4.0 * c0 * c0 * loses))
    raise ValueError("a spring alone has a closed form with 0 or 1 samples of delay only")


def damper_limit(mass_kg: float, damping_n_s_per_m: float, period_s: float) -> float:
    """K < (2B/T)(1 - u)/(1 + u), u = BT/2m: a digital damper on a bare mass, no delay [N/m]."""
    u = damping_n_s_per_m * period_s / (2.0 * mass_kg)
    return max(0.0, 2.0 * damping_n_s_per_m / period_s * (1.0 - u) / (1.0 + u))


def damper_peak(mass_kg: float, period_s: float, delay_samples: int = 0) -> float:
    """The largest stiffness that any wall damping makes stable on a bare mass, up to 3 samples of delay [N/m]."""
    return DAMPER_PEAK[delay_samples] * mass_kg / (period_s * period_s)


def passive_limit(loop: Loop) -> float:
    """Colgate and Schenkel 1997: passive for b > KT/2 + |B|, and with a late spring alone for b > K(T/2 + dT) [N/m]."""
    damping = abs(loop.wall_damping_n_s_per_m)
    if loop.flexible is not None or ((loop.delay_samples or loop.late_s) and damping > 0.0):
        return math.nan
    late_s = (0.5 + loop.delay_samples) * loop.period_s + loop.late_s
    return max(0.0, (loop.viscous_n_s_per_m - damping) / late_s)


def quantised_passive_limit(loop: Loop) -> float:
    """Abbott and Okamura 2005: with a quantised position a spring is passive for K <= min(2b/T, 2 f_c/step) [N/m]."""
    if not (loop.coulomb_n > 0.0 and loop.resolution_m > 0.0):
        return math.nan
    if loop.wall_damping_n_s_per_m != 0.0 or loop.delay_samples or not loop.rigid:
        return math.nan
    return min(2.0 * max(0.0, loop.viscous_n_s_per_m) / loop.period_s, 2.0 * loop.coulomb_n / loop.resolution_m)


BOUNDARIES = (
    Boundary("stable", "linear loop, exact", stable_limit),
    Boundary("passive", "passive: Colgate & Schenkel 1997", passive_limit),
    Boundary("quantised-passive", "passive, quantised: Abbott & Okamura 2005", quantised_passive_limit),
)


@lru_cache(maxsize=65536)
def linear_limit(loop: Loop) -> float:
    """The limit of the linear loop by where its roots cross the unit circle; for any delay, damping and hand [N/m].

    On the circle z = exp(j theta) the loop closes for K = -z^d D/N - B (1 - 1/z)/T, of which the real ones count.
    """
    if not loop.rigid:
        return _sampled(loop).limit(loop.wall_damping_n_s_per_m, loop.period_s)
    numerator, denominator = _open_loop(loop)
    damping, period_s, delay = loop.wall_damping_n_s_per_m, loop.period_s, loop.delay_samples

    def closing(theta: float) -> complex:
        z = cmath.exp(1j * theta)
        plant = (z * z + denominator[0] * z + denominator[1]) / (numerator[0] * z + numerator[1])
        return -(z**delay) * plant - damping * (1.0 - 1.0 / z) / period_s

    angles = np.unique(np.concatenate([np.geomspace(1e-5, math.pi, 400), np.linspace(1e-3, math.pi, 400)]))[:-1]
    imaginary = [closing(float(theta)).imag for theta in angles]
    crossings = [closing(math.pi).real]
    for (low, high), (at_low, at_high) in zip(pairwise(angles), pairwise(imaginary), strict=True):
        if (at_low < 0.0) != (at_high < 0.0):
            crossings.append(closing(_root(lambda theta: closing(theta).imag, float(low), float(high))).real)
    above = sorted(stiffness for stiffness in crossings if stiffness > 0.0)
    if not is_stable(loop, 0.5 * above[0] if above else 1.0):
        return 0.0
    return above[0] if above else math.inf


def is_stable(loop: Loop, stiffness_n_per_m: float) -> bool:
    """Whether every root of the linear loop lies inside the unit circle."""
    if not loop.rigid:
        return _sampled(loop).grows(stiffness_n_per_m, loop.wall_damping_n_s_per_m, loop.period_s) < 1.0
    numerator, denominator = _open_loop(loop)
    delay = loop.delay_samples
    damping = loop.wall_damping_n_s_per_m / loop.period_s
    # z^(d+1) (z^2 + d1 z + d0) + (c1 z + c0) ((K + B/T) z - B/T)
    polynomial = np.zeros(delay + 4)
    polynomial[:3] = [1.0, *denominator]
    polynomial[-3:] += np.convolve(numerator, [stiffness_n_per_m + damping, -damping])
    return bool(np.all(np.abs(np.roots(polynomial)) < 1.0))


def _plant(mass_kg: float, viscous_n_s_per_m: float, period_s: float) -> tuple[float, float, float, float]:
    """1 - a, a, c1, c0 of a mass with viscous friction."""
    decay = viscous_n_s_per_m / mass_kg
    a, swing, area = flow(decay, 0.0, period_s)
    c1 = area / mass_kg
    return decay * swing, a, c1, swing * swing / mass_kg - a * c1


def _open_loop(loop: Loop) -> tuple[tuple[float, float], tuple[float, float]]:
    """From force to position, (c1 z + c0) / (z^2 + d1 z + d0): (c1, c0) and (d1, d0)."""
    stiffness = loop.hand_n_per_m / loop.mass_kg
    slope, swing, area = flow(loop.damping_n_s_per_m / loop.mass_kg, stiffness, loop.period_s)
    keeps = 1.0 - stiffness * area
    c1 = area / loop.mass_kg
    return (c1, swing * swing / loop.mass_kg - slope * c1), (
        -(keeps + slope),
        keeps * slope + stiffness * swing * swing,
    )


@lru_cache(maxsize=4096)
def _sampled(loop: Loop) -> Sampled:
    """The plant of a loop whose force comes between samples, or that bends."""
    whole = math.floor(loop.late_s / loop.period_s + 1e-9)
    late_s = max(0.0, loop.late_s - whole * loop.period_s)
    delay = loop.delay_samples + whole
    if loop.flexible is None:
        rates = loop.damping_n_s_per_m / loop.mass_kg, loop.hand_n_per_m / loop.mass_kg
        return late_plant(loop.mass_kg, *rates, loop.period_s, late_s, delay)
    values = {
        "mass_kg": loop.mass_kg - loop.hand_kg,
        "viscous_n_s_per_m": loop.viscous_n_s_per_m,
        "hand_mass_kg": loop.hand_kg,
        "hand_damping_n_s_per_m": loop.hand_n_s_per_m,
        "hand_stiffness_n_per_m": loop.hand_n_per_m,
    }
    return flexible_plant(loop.flexible, values, loop.period_s, late_s, delay)


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    rising = function(high) > 0.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        if (function(middle) > 0.0) == rising:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)
