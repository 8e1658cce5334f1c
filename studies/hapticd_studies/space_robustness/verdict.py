"""One case run with the daemon's own tick, and whether it is steady.

A hand that comes to rest is judged as a press anywhere: still, and where forces balance. One that goes on is judged by
the fast part of the position, from 40 Hz up, where no hand moves: a glide must have none; where impacts or stick and
slip are part of what happens, it must not grow from one stretch of the run to the last.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any

import numpy as np

from hapticd.offline.felt import MOVING_HZ, WINDOW_S, felt_index
from hapticd.offline.outcome import Criterion
from hapticd.offline.rehearsal import ticks_in
from hapticd.offline.track import track
from hapticd.simulation.batch.space_kernel import TRACE_COLUMNS
from hapticd.simulation.space.device import SpatialDevice
from hapticd.tick.space.tick import SpaceTick
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.space_robustness.cases import DURATION_S, Case

GROWS = 1.25
"""The fast part may be so much larger at the end than before, where it belongs to what happens."""

COLUMNS = ("verdict", "span_m", "limit_m", "misplaced_m", "felt_index", "peak_force_n", "damping_n_s_per_m")
"""Of each run. `span_m` is what is judged, against `limit_m`; `felt_index` is of the last second, from 40 Hz up where
the hand moves."""


_POSITION = slice(TRACE_COLUMNS.index("x_m"), TRACE_COLUMNS.index("z_m") + 1)
_FORCE = slice(TRACE_COLUMNS.index("fx_n"), TRACE_COLUMNS.index("fz_n") + 1)


class Verdict(IntEnum):
    """What became of a run, from good to bad."""

    STEADY = 0
    ELSEWHERE = 1
    UNSTEADY = 2
    STOPPED = 3

    @property
    def words(self) -> str:
        """For people."""
        return ("steady", "still, but out of place", "unsteady", "stopped")[self]


def judged(case: Case, law: LawSpec, criterion: Criterion, compiled: bool = False) -> list[float]:
    """The row of a case under a law: `COLUMNS`.

    Args:
        case: the case.
        law: the law.
        criterion: what still and in place mean.
        compiled: run it as machine code, which takes a while to make and gives the same numbers.
    """
    loaded = case.loaded(law)
    tick, space, trace, fault, _ = track(loaded, ticks_in(loaded, DURATION_S), compiled)
    peak_n = max((math.hypot(*row) for row in trace[:, _FORCE].tolist()), default=0.0)
    damping = max(contact.normal.damping_n_s_per_m for contact in tick.solids)
    if fault is not None or not len(trace):
        return [float(Verdict.STOPPED), math.inf, 0.0, math.nan, math.inf, peak_n, damping]
    way = trace[:, _POSITION]
    period_s = case.period_s
    end = way[-round(WINDOW_S / period_s) :]
    limit_m = criterion.still_limit_m(space.options)
    if case.hand in ("press", "let go"):
        felt = _length(felt_index(axis, period_s) for axis in end.T)
        span_m = _length(np.ptp(way[-round(criterion.window_s / period_s) :], axis=0))
        misplaced_m, place_m = _misplaced(case, criterion, tick, space)
        verdict = (
            Verdict.UNSTEADY if span_m > limit_m else Verdict.ELSEWHERE if misplaced_m > place_m else Verdict.STEADY
        )
    else:
        felt = _length(felt_index(axis, period_s, MOVING_HZ) for axis in end.T)
        before_m, span_m = fast_m(way, period_s)
        misplaced_m = math.nan
        if case.hand == "tap" or case.rough:
            limit_m = max(limit_m, GROWS * before_m)
        verdict = Verdict.STEADY
    if span_m > limit_m:
        verdict = Verdict.UNSTEADY
    return [float(verdict), span_m, limit_m, misplaced_m, felt, peak_n, damping]


def fast_m(way: Any, period_s: float) -> tuple[float, float]:
    """How far the fast part of a position spans, in the second third of a run and in the last [m].

    Args:
        way: a row a tick, a column an axis [m].
        period_s: between ticks [s].
    """
    count = len(way)
    steps = np.arange(count)[:, None] / (count - 1.0)
    level = way - (way[0] + (way[-1] - way[0]) * steps)  # else the ends do not fit together
    lines = np.fft.rfft(level, axis=0)
    lines[np.fft.rfftfreq(count, period_s) < MOVING_HZ] = 0.0
    fast = np.fft.irfft(lines, count, axis=0)
    third, margin = count // 3, count // 30  # the transform itself rings at the very ends
    return _length(np.ptp(fast[third : 2 * third], axis=0)), _length(np.ptp(fast[2 * third : -margin], axis=0))


def _misplaced(case: Case, criterion: Criterion, tick: SpaceTick, space: SpatialDevice) -> tuple[float, float]:
    """How far the device is from where the hand's force and the springs balance, and how far it may be [m]."""
    hand = space.options.space.hand
    at = np.array(space.position_m)
    aim = np.array(hand.aim.at_m)  # type: ignore[union-attr]  # a hand that rests holds a point
    force = np.zeros(3) if case.hand == "let go" else np.array(hand.force.newton)
    springs = np.array(hand.stiffness_n_per_m)
    left_n = force - springs * (at - aim)
    stiffness, depth_m = float(springs.max()), 0.0
    for contact in tick.solids:
        proxy = contact.solid.proxy
        if proxy.touching:
            normal = np.array((proxy.normal_x, proxy.normal_y, proxy.normal_z))
            stretch = np.array((proxy.stretch_x, proxy.stretch_y, proxy.stretch_z))
            left_n = left_n + contact.solid.stiffness_n_per_m * (proxy.depth_m * normal + stretch)
            stiffness = max(stiffness, contact.solid.stiffness_n_per_m)
            depth_m = max(depth_m, proxy.depth_m)
    held_m = float(np.linalg.norm(space.options.space.coulomb_n or (0.0,))) / stiffness  # Coulomb friction holds it
    pressed_m = float(np.linalg.norm(hand.force.newton or (0.0,))) / case.stiffness_n_per_m
    depth_m = max(depth_m, pressed_m)  # a hand that has let go: what it was pressed to
    may_m = max(criterion.place_share * depth_m, criterion.place_counts * space.options.resolution_m) + held_m
    return float(np.linalg.norm(left_n)) / stiffness, may_m


def _length(values: Any) -> float:
    return math.sqrt(sum(float(value) ** 2 for value in values))
