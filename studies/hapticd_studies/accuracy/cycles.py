"""How well the ends of energy cycles are seen: the detector's verdicts against the motion that really was."""

from __future__ import annotations

import bisect
import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from hapticd.offline.run import Run
from hapticd.tick.energy import CycleFields, cycle_ended


@dataclass(frozen=True, slots=True)
class Detection:
    """What a detector made of one run.

    Attributes:
        cycles: presses and releases that there were.
        detected: verdicts.
        false: verdicts with no cycle of their own.
        missed: cycles without a verdict before the next one.
        late_ticks: median delay of the others; NaN without any.
    """

    cycles: int
    detected: int
    false: int
    missed: int
    late_ticks: float


def true_ends(run: Run, least_m: float) -> list[int]:
    """Ticks at which a press and release really ended, by the true position.

    That is an outer turning point inside the wall, or the last tick in contact, after a press and a release that
    were both longer than `least_m`; smaller ones are no cycles that a sensor could show.
    """
    ends: list[int] = []
    deepest = highest = math.inf
    at = -1
    released = False
    for tick, x_m in enumerate(run.columns["x_m"]):
        if x_m >= 0.0:
            if released or (deepest < -least_m):
                ends.append(at if released and highest > x_m else tick)
            deepest = highest = math.inf
            released = False
            continue
        if not released:
            if x_m < deepest:
                deepest = x_m
            elif x_m - deepest > least_m:
                released, highest, at = True, x_m, tick
            continue
        if x_m > highest:
            highest, at = x_m, tick
        elif highest - x_m > least_m:
            ends.append(at)
            released, deepest = False, x_m
    return ends


def detected_ends(run: Run, window: int) -> list[int]:
    """Ticks at which the detector says that a cycle has ended, from the measured positions as the daemon has them."""
    state = CycleFields()
    state.window_energy_j = state.window_minimum_j = 0.0
    state.window_falls = state.window_rises = 0
    found = []
    energy_j = 0.0
    x_measured_m = run.columns["x_measured_m"]
    last_m = x_measured_m[0]
    applied_n = 0.0
    for tick, (x_m, force_n, inside) in enumerate(
        zip(x_measured_m, run.columns["force_n"], run.columns["in_contact"], strict=True)
    ):
        energy_j -= applied_n * (x_m - last_m)
        if cycle_ended(state, energy_j, bool(inside), window, window):
            found.append(tick)
        last_m, applied_n = x_m, force_n
    return found


def judge(true: Sequence[int], detected: Sequence[int]) -> Detection:
    """Pair verdicts with cycles: a verdict belongs to the last cycle that ended before it, and to no other verdict's.

    A sensor with steps may lose contact a tick early, so one tick before the end is in time.
    """
    late = []
    taken = set()
    for tick in detected:
        last = bisect.bisect_right(true, tick) - 1
        early = last + 1 < len(true) and true[last + 1] == tick + 1
        own = last if last >= 0 and last not in taken else last + 1 if early else -1
        if own >= 0 and own not in taken:
            taken.add(own)
            late.append(max(0, tick - true[own]))
    return Detection(
        cycles=len(true),
        detected=len(detected),
        false=len(detected) - len(late),
        missed=len(true) - len(late),
        late_ticks=float(statistics.median(late)) if late else math.nan,
    )


def least_swing_m(run: Run) -> float:
    """The smallest swing that counts as one: two steps of the sensor, or seven times its noise [m]."""
    return max(2.0 * run.options.resolution_m, 7.0 * run.options.noise_m, 1e-9)
