"""What a law did to a wall under a hand, from the arrays of one run; pure functions, SI units.

`true_m` and `x_m` are the true and the measured position, < 0 inside; `force_n` is what the loop applied from that
sample to the next; `v_m_per_s` is the true velocity and `damping` that of the law.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

FELT_SHARE = 0.07
"""A change of force by less than this is not felt (the difference threshold of forces)."""


class Exits(NamedTuple):
    """Every way out of the wall.

    Attributes:
        pull_n: largest force towards the wall on the way, >= 0 [N].
        push_n: largest force outward on the way [N].
    """

    pull_n: Array
    push_n: Array

    @property
    def felt(self) -> int:
        """How many pull enough to be felt."""
        return int((self.pull_n > FELT_SHARE * self.push_n).sum())


def exits(x_m: Array, force_n: Array) -> Exits:
    """The ways out: from the last sample that moved inward to the last one inside."""
    inside = x_m < 0.0
    leaving = np.flatnonzero(inside[:-1] & ~inside[1:])
    moved = np.diff(x_m, prepend=x_m[:1])
    inward = np.flatnonzero((moved < 0.0) | ~inside)
    pull, push = np.zeros(len(leaving)), np.zeros(len(leaving))
    for at, stop in enumerate(leaving):
        before = int(np.searchsorted(inward, stop, side="right")) - 1
        way = force_n[(int(inward[before]) if before >= 0 else 0) : stop + 1]
        pull[at], push[at] = max(0.0, -float(way.min())), max(0.0, float(way.max()))
    return Exits(pull, push)


def pull_share(x_m: Array, force_n: Array) -> float:
    """Share of the ticks in contact at which the wall pulls; NaN without contact."""
    inside = x_m < 0.0
    return float(np.mean(force_n[inside] < 0.0)) if inside.any() else math.nan


def departure(true_m: Array, v_m_per_s: Array, time_s: Array, releases: list[float]) -> tuple[float, float]:
    """Median time from letting go to leaving [s], and median speed there [m/s]; NaN when nothing left.

    A release that is not followed by an exit before the next one takes as long as that.
    """
    took, speed = [], []
    bounds = [*np.searchsorted(time_s, releases).tolist(), len(time_s)]
    for first, stop in itertools.pairwise(bounds):
        if first >= len(true_m) or true_m[first] >= 0.0:
            continue
        outside = np.flatnonzero(true_m[first:stop] >= 0.0)
        if len(outside):
            took.append(float(time_s[first + outside[0]] - time_s[first]))
            speed.append(float(v_m_per_s[first + outside[0]]))
        elif stop < len(time_s):
            took.append(float(time_s[stop] - time_s[first]))
            speed.append(0.0)
    return (float(np.median(took)), float(np.median(speed))) if took else (math.nan, math.nan)


def weighted_damping(x_m: Array, v_m_per_s: Array, damping: Array) -> float:
    """Mean of the damping, weighted by the work it does [N s/m]; NaN without motion inside."""
    inside = x_m < 0.0
    power = damping[inside] * v_m_per_s[inside] ** 2
    total = float(power.sum())
    if total > 0.0:
        return float((power * damping[inside]).sum()) / total
    return 0.0 if inside.any() else math.nan


def work_over_leak(true_m: Array, x_m: Array, force_n: Array, stiffness: float) -> float:
    """What a law takes from the motion, over what the sampled spring leaks; NaN without contact.

    The work is that of all that is not the spring, -(F + k x) dx to the next sample; the leak is (k / 2) sum dx^2.
    A constant damper B in a slow motion has 2 B / (k T).
    """
    inside = x_m[:-1] < 0.0
    moved = np.diff(true_m)[inside]
    leak = 0.5 * stiffness * float((moved * moved).sum())
    extra = force_n[:-1][inside] + stiffness * x_m[:-1][inside]
    return -float((extra * moved).sum()) / leak if leak > 0.0 else math.nan


def force_errors(true_m: Array, force_n: Array, stiffness: float, limit_n: float, phases: Ints) -> list[float]:
    """Root mean square of the difference to an ideal spring at the true position, over the rms of that spring.

    Args:
        true_m: of the run [m].
        force_n: of the run [N].
        stiffness: of the spring [N/m].
        limit_n: no force is larger, the ideal one included [N].
        phases: of each sample 0, 1 or 2: while the hand presses more, stays, eases.

    Returns:
        One a phase; NaN where the ideal spring has no force.
    """
    ideal = np.minimum(np.where(true_m < 0.0, -stiffness * true_m, 0.0), limit_n)
    off = force_n - ideal
    found = []
    for phase in range(3):
        chosen = phases == phase
        size = float((ideal[chosen] ** 2).sum())
        found.append(math.sqrt(float((off[chosen] ** 2).sum()) / size) if size > 0.0 else math.nan)
    return found


def rate_hardness(true_m: Array, v_m_per_s: Array, force_n: Array, period_s: float) -> float:
    """Largest rise of the force over 2 ms in the first 10 ms of a contact, over the impact speed [N/m].

    An ideal wall has about its stiffness. NaN without a contact.
    """
    hits = np.flatnonzero(true_m < 0.0)
    if not len(hits) or v_m_per_s[hits[0]] >= 0.0:
        return math.nan
    first = max(0, int(hits[0]) - 1)
    span = max(1, round(2e-3 / period_s))
    early = force_n[first : first + max(span + 1, round(0.01 / period_s))]
    if len(early) <= span:
        return math.nan
    rise = float((early[span:] - early[:-span]).max()) / (span * period_s)
    return rise / -float(v_m_per_s[hits[0]])


def impedance(true_m: Array, force_n: Array, time_s: Array, frequency_hz: float) -> complex:
    """-F / x at one frequency of a steady motion: the real part is the stiffness that is shown [N/m].

    A Hann window keeps other frequencies out from 2 / duration on.
    """
    count = len(true_m)
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(count) / count)
    wave = window * np.exp(-2j * np.pi * frequency_hz * time_s)
    moved = complex((wave * (true_m - true_m.mean())).sum())
    pushed = complex((wave * (force_n - force_n.mean())).sum())
    return -pushed / moved if moved != 0.0 else complex(math.nan, math.nan)
