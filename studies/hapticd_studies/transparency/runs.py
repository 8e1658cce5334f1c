"""The runs of a device under a law, and the row of figures that they come to.

A device is run five times: under its moving hand, in a hard and a gentle arrival that stay, under a hand that presses
with two slow sines at once, and under one with a sine faster than any hand.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from hapticd.law import state_fields
from hapticd.offline.felt import MOVING_HZ, WINDOW_S, felt_index
from hapticd.offline.outcome import Criterion, Outcome
from hapticd.simulation.batch import Batch, BatchResult, Point
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.transparency import arrivals, scores
from hapticd_studies.transparency.arrivals import GENTLE, HARD, Arrival
from hapticd_studies.transparency.devices import MAX_FORCE_N, Held

Array = npt.NDArray[np.float64]
Row = list[float]

PROBES_HZ = ((2.0, 7.0), (18.0,))
"""Sines that are pressed with together; a law may take what is faster than a hand for a ring."""
PROBE_MEAN_N, PROBE_EACH_N = -4.0, 1.0
PROBE_FROM_S = 1.0

MOVING_COLUMNS = (
    "finite",
    "contact_share",
    "error_in",
    "error_hold",
    "error_out",
    "pull_share",
    "pull_worst_n",
    "exits",
    "exits_felt",
    "leave_s",
    "leave_m_per_s",
    "work_over_leak",
    "weighted_n_s_per_m",
    "base_n_s_per_m",
    "buzz_share",
)
"""Under the moving hand; `buzz_share`: of windows of 1 s wholly in contact, those felt from 40 Hz up."""

REST_COLUMNS = ("outcome", "settled_s", "misplaced_share", "span_m", "felt", "chatter_n", "hardness_share")
"""In an arrival; `misplaced_share`: too deep by this share of the depth; `hardness_share`: rate-hardness over k."""

PROBE_COLUMNS = tuple(
    name for together in PROBES_HZ for hz in together for name in (f"shown_share_{hz:g}hz", f"shown_n_s_per_m_{hz:g}hz")
)
"""Displayed impedance: stiffness over that of the wall, and damping."""

COLUMNS = (
    *MOVING_COLUMNS,
    *(f"{how}_{name}" for how in ("hard", "gentle") for name in REST_COLUMNS),
    *PROBE_COLUMNS,
)


def seconds_of(duration_s: float) -> float:
    """Simulated time of a device under a law whose hand moves for `duration_s` [s]."""
    return duration_s + (2 + len(PROBES_HZ)) * arrivals.DURATION_S


def rows(
    devices: Sequence[Held], law: LawSpec, duration_s: float, criterion: Criterion, threads: int | None = None
) -> list[Row]:
    """The row of each device under a law, in the order of `COLUMNS`."""
    moving = moving_runs(devices, law, duration_s, criterion, threads)
    rest = _arrivals(devices, law, criterion, threads)
    probed = _probes(devices, law, criterion, threads)
    return [[*a, *b, *c] for a, b, c in zip(_moving(devices, law, duration_s, moving), rest, probed, strict=True)]


def moving_runs(
    devices: Sequence[Held], law: LawSpec, duration_s: float, criterion: Criterion, threads: int | None = None
) -> BatchResult:
    """Each device under its moving hand, every tick in the trace."""
    points = [
        # A target that is not looked at: the arrivals need one, and so both run as the same machine code.
        Point(device.moved(duration_s), device.wall, device.params(law), device.period_s, MAX_FORCE_N, target_m=0.0)
        for device in devices
    ]
    return Batch(law.law, points, duration_s, criterion.window_s, trace_every=1, ledger=False).run(threads)


def phases_at(device: Held, duration_s: float, time_s: Array) -> tuple[npt.NDArray[np.int64], list[float]]:
    """Of each moment what the hand is about, and when it begins to leave."""
    found = device.movement(duration_s)
    starts, kinds = np.array([at for at, _ in found.phases]), np.array([kind for _, kind in found.phases])
    order = np.argsort(starts, kind="stable")
    at = np.searchsorted(starts[order], time_s, side="right") - 1
    return kinds[order][at], found.releases


def times_of(device: Held, ticks: int) -> Array:
    """When each sample of a trace was taken [s]."""
    return np.arange(1, ticks + 1, dtype=np.float64) * device.period_s


def _moving(devices: Sequence[Held], law: LawSpec, duration_s: float, result: BatchResult) -> list[Row]:
    names = state_fields(law.law)
    found = []
    for at, device in enumerate(devices):
        true_m, v, x_m, force, _, damping = columns_of(result, at)
        time_s = times_of(device, len(true_m))
        phases, releases = phases_at(device, duration_s, time_s)
        base = math.nan
        if "base_n_s_per_m" in names:
            base = float(result.states["base_n_s_per_m"][at])
        elif "damping_n_s_per_m" in names:
            base = float(result.damping_n_s_per_m[at])
        left = scores.exits(x_m, force)
        k = device.stiffness_n_per_m
        found.append(
            [
                float(result.finite[at]),
                float(np.mean(x_m < 0.0)),
                *scores.force_errors(true_m, force, k, MAX_FORCE_N, phases),
                scores.pull_share(x_m, force),
                float(left.pull_n.max()) if len(left.pull_n) else math.nan,
                float(len(left.pull_n)),
                float(left.felt),
                *scores.departure(true_m, v, time_s, releases),
                scores.work_over_leak(true_m, x_m, force, k),
                scores.weighted_damping(x_m, v, damping) if "damping_n_s_per_m" in names else math.nan,
                base,
                _buzz(true_m, device.period_s),
            ]
        )
    return found


def _arrivals(devices: Sequence[Held], law: LawSpec, criterion: Criterion, threads: int | None) -> list[Row]:
    found: list[Row] = [[] for _ in devices]
    for how in (HARD, GENTLE):
        points = [arrivals.point(how, device, device.params(law), MAX_FORCE_N) for device in devices]
        batch = Batch(law.law, points, arrivals.DURATION_S, criterion.window_s, trace_every=1, ledger=False)
        result = batch.run(threads)
        for at, device in enumerate(devices):
            found[at] += _rest(how, device, criterion, result, at)
    return found


def _rest(how: Arrival, device: Held, criterion: Criterion, result: BatchResult, at: int) -> Row:
    true_m, v, _, force, _, _ = columns_of(result, at)
    mean_m, span_m = -float(result.mean_depth_m[at]), float(result.peak_to_peak_m[at])
    finite = bool(result.finite[at])
    ended = arrivals.outcome(how, device, criterion, finite, span_m, mean_m)
    last = round(WINDOW_S / device.period_s)
    wanted_m = how.balance(device).x_m
    hard = scores.rate_hardness(true_m, v, force, device.period_s) if how.speed_m_per_s else math.nan
    return [
        float(ended),
        float(result.settled_s[at]),
        mean_m / wanted_m - 1.0,
        span_m,
        felt_index(true_m[-last:], device.period_s) if ended != Outcome.DIVERGED else math.inf,
        float(np.ptp(force[-last:])) if ended != Outcome.DIVERGED else math.inf,
        hard / device.stiffness_n_per_m,
    ]


def _probes(devices: Sequence[Held], law: LawSpec, criterion: Criterion, threads: int | None) -> list[Row]:
    times = [at * 0.002 for at in range(round(arrivals.DURATION_S / 0.002) + 1)]
    found: list[Row] = [[] for _ in devices]
    for together in PROBES_HZ:
        force = [(s, PROBE_MEAN_N + sum(PROBE_EACH_N * math.sin(math.tau * hz * s) for hz in together)) for s in times]
        points = [
            Point(device.pressed(force), device.wall, device.params(law), device.period_s, MAX_FORCE_N, target_m=0.0)
            for device in devices
        ]
        batch = Batch(law.law, points, arrivals.DURATION_S, criterion.window_s, trace_every=1, ledger=False)
        result = batch.run(threads)
        for at, device in enumerate(devices):
            for hz in together:
                shown = _shown(device, result, at, hz)
                found[at] += [shown.real / device.stiffness_n_per_m, shown.imag / (math.tau * hz)]
    return found


def _shown(device: Held, result: BatchResult, at: int, hz: float) -> complex:
    if not result.finite[at]:
        return complex(math.nan, math.nan)
    true_m, _, _, pushed, _, _ = columns_of(result, at)
    time_s = times_of(device, len(true_m))
    first = round(PROBE_FROM_S / device.period_s)
    return scores.impedance(true_m[first:], pushed[first:], time_s[first:], hz)


def _buzz(true_m: Array, period_s: float) -> float:
    """Share of the seconds wholly in contact that are felt from 40 Hz up; NaN without one."""
    window, hop = round(WINDOW_S / period_s), round(0.5 * WINDOW_S / period_s)
    inside = [
        true_m[first : first + window]
        for first in range(0, len(true_m) - window + 1, hop)
        if float(true_m[first : first + window].max()) < 0.0
    ]
    if not inside:
        return math.nan
    return float(np.mean([felt_index(one, period_s, MOVING_HZ) > 1.0 for one in inside]))


def columns_of(result: BatchResult, at: int) -> list[Any]:
    """The trace of a point, a contiguous array a column, as far as it ran."""
    trace = result.trace[at][: int(result.ticks[at])]
    return [np.ascontiguousarray(trace[:, column]) for column in range(trace.shape[1])]
