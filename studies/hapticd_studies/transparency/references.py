"""What constant dampers do on a device: the least that keeps it calm, by bisection, and the best at settling."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hapticd import plugins
from hapticd.offline.outcome import Criterion, Outcome
from hapticd.simulation.batch import Batch, Point
from hapticd_studies.transparency.arrivals import DURATION_S, GENTLE, HARD, Arrival, outcome, point
from hapticd_studies.transparency.devices import MAX_FORCE_N, Held

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

COLUMNS = ("least_n_s_per_m", "best_hard_s", "best_gentle_s")
"""Of each device; NaN where no constant damper does it."""

PRESSES_N = (0.5, 1.5, 3.05, 6.0)
PRESS_S = DURATION_S
_FIRST_LEAKS = 1.0 / 16.0
_HALVINGS = 8
_RATIOS = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.85, 1.0, 1.3)


def references(devices: Sequence[Held], criterion: Criterion, threads: int | None = None) -> list[list[float]]:
    """The row of each device, in the order of `COLUMNS`."""
    least = least_damping(devices, criterion, threads)
    hard, gentle = (_best_s(devices, how, criterion, threads) for how in (HARD, GENTLE))
    return [list(map(float, row)) for row in zip(least, hard, gentle, strict=True)]


def least_damping(devices: Sequence[Held], criterion: Criterion, threads: int | None = None) -> Array:
    """The smallest constant damper that keeps presses of 0.5 to 6 N still and in place, to 0.4 %; NaN: none does.

    Found from below: the first of the doublings of k T / 32 that does, then halved towards the last that does not.
    """
    count = len(devices)
    most = np.array([0.8 * device.mass_kg / device.period_s for device in devices])
    low, high = np.zeros(count), np.array([_FIRST_LEAKS * device.leak_n_s_per_m for device in devices])
    free = calm(devices, low, criterion, threads)
    found = free.copy()
    for _ in range(64):
        open_ = np.flatnonzero(~found & (low < most))
        if not len(open_):
            break
        held = calm([devices[int(at)] for at in open_], high[open_], criterion, threads)
        found[open_[held]] = True
        low[open_[~held]] = high[open_[~held]]
        high[open_[~held]] = np.minimum(2.0 * high[open_[~held]], 1.0001 * most[open_[~held]])
    open_ = np.flatnonzero(found & ~free)
    for _ in range(_HALVINGS if len(open_) else 0):
        middle = 0.5 * (low[open_] + high[open_])
        held = calm([devices[int(at)] for at in open_], middle, criterion, threads)
        high[open_[held]], low[open_[~held]] = middle[held], middle[~held]
    least: Array = np.where(free, 0.0, np.where(found, high, math.nan))
    return least


def calm(devices: Sequence[Held], damping: Array, criterion: Criterion, threads: int | None = None) -> Bools:
    """Whether a constant damper keeps every press still and in place, one a device."""
    law = plugins.law("damper")
    tried = [
        (Arrival(force_n, 0.001, 0.0), device, float(at))
        for force_n in PRESSES_N
        for device, at in zip(devices, damping, strict=True)
    ]
    points = [_point(how, device, at) for how, device, at in tried]
    result = Batch(law, points, PRESS_S, criterion.window_s, ledger=False).run(threads)
    held = [
        outcome(how, device, criterion, bool(result.finite[at]), result.peak_to_peak_m[at], -result.mean_depth_m[at])
        == Outcome.SETTLED
        for at, (how, device, _) in enumerate(tried)
    ]
    every: Bools = np.min(np.array(held, dtype=bool).reshape(len(PRESSES_N), -1), axis=0)
    return every


def fastest_damping(devices: Sequence[Held], how: Arrival, criterion: Criterion, threads: int | None = None) -> Array:
    """The constant damper of those tried that settles each device soonest; NaN: none does [N s/m]."""
    settled_s = _settled_s(devices, how, criterion, threads)
    ratios = np.argmin(np.where(np.isnan(settled_s), math.inf, settled_s), axis=0)
    found = [_of_ratio(device, _RATIOS[int(at)]) for device, at in zip(devices, ratios, strict=True)]
    return np.where(np.isnan(settled_s).all(axis=0), math.nan, np.array(found))


def _best_s(devices: Sequence[Held], how: Arrival, criterion: Criterion, threads: int | None) -> Array:
    """The shortest settling time under any of the damping ratios tried; NaN: none settles."""
    best: Array = np.fmin.reduce(_settled_s(devices, how, criterion, threads))
    return best


def _settled_s(devices: Sequence[Held], how: Arrival, criterion: Criterion, threads: int | None) -> Array:
    """Settling times, a row a damping ratio; NaN: it does not settle."""
    law = plugins.law("damper")
    points = [_point(how, device, _of_ratio(device, ratio)) for ratio in _RATIOS for device in devices]
    result = Batch(law, points, PRESS_S, criterion.window_s, ledger=False).run(threads)
    settled: Array = result.settled_s.reshape(len(_RATIOS), -1)
    return settled


def _of_ratio(device: Held, ratio: float) -> float:
    """A damper in N s/m, no more than the sampled loop bears."""
    most = (0.3 if device.late else 0.7) * device.mass_kg / device.period_s
    return min(2.0 * ratio * math.sqrt(device.stiffness_n_per_m * device.mass_kg), most)


def _point(how: Arrival, device: Held, damping: float) -> Point:
    params = plugins.law("damper").Params(damping_n_s_per_m=damping)
    return point(how, device, params, MAX_FORCE_N)
