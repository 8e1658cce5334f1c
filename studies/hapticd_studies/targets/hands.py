"""Hands that move, for ten minutes, and a wall or a hand that becomes another."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hapticd.config.walls import WallChange, WallConfig
from hapticd.law import state_fields
from hapticd.offline.outcome import Criterion, Outcome
from hapticd.simulation.batch import Batch, Point
from hapticd.simulation.options import Change, SimulationOptions
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.transparency import arrivals
from hapticd_studies.transparency.arrivals import HARD
from hapticd_studies.transparency.devices import MAX_FORCE_N, Held
from hapticd_studies.transparency.runs import columns_of
from hapticd_studies.transparency.scores import weighted_damping

KNOWN_S = 10.0
"""After this time the law has learnt what it can of a hand."""

FIRMER = 3.0
STIFFENS_S = 0.5 * arrivals.DURATION_S

SOFTENS_S, SOFTENED_S = 3.0, 5.0
HARD_N_PER_M, SOFT_N_PER_M = 12e3, 2e3
HANDS_OVER_S, HANDED_S = 6.0, 20.0
CYCLE_S = 0.5
TAKEOVER_N_PER_M = 15e3
WITHIN_S = CYCLE_S
_WITHIN = 1.05  # of k T / 2


def long_moved(
    devices: Sequence[Held], law: LawSpec, duration_s: float, criterion: Criterion, threads: int | None
) -> list[list[float]]:
    """A hand of this duration: the damping that stays, and that weighted by its work, from the first touch and later.

    Returns:
        A row a device: base, weighted damping, weighted damping once the hand has been there for `KNOWN_S` [N s/m];
        NaN: the law says none.
    """
    points = [
        Point(device.moved(duration_s), device.wall, device.params(law), device.period_s, MAX_FORCE_N)
        for device in devices
    ]
    result = Batch(law.law, points, duration_s, criterion.window_s, trace_every=1, ledger=False).run(threads)
    names = state_fields(law.law)
    if "damping_n_s_per_m" not in names:
        return [[math.nan] * 3 for _ in devices]
    base = result.states["base_n_s_per_m"] if "base_n_s_per_m" in names else result.damping_n_s_per_m
    found = []
    for at, device in enumerate(devices):
        _, v, x_m, _, _, damping = columns_of(result, at)
        first = round(KNOWN_S / device.period_s)
        later = weighted_damping(x_m[first:], v[first:], damping[first:])
        found.append([float(base[at]), weighted_damping(x_m, v, damping), later])
    return found


def stiffened(devices: Sequence[Held], law: LawSpec, criterion: Criterion, threads: int | None) -> list[list[float]]:
    """Whether each device is held by the end of a hard arrival whose hand grips three times as firmly half-way."""
    points, places = [], []
    for device in devices:
        hand = device.options.hand
        grip = Change(
            at_s=STIFFENS_S,
            hand_damping_n_s_per_m=FIRMER * hand.damping_n_s_per_m,
            hand_stiffness_n_per_m=FIRMER * hand.stiffness_n_per_m,
        )
        point = arrivals.point(HARD, device, device.params(law), MAX_FORCE_N)
        options = point.device.model_copy(update={"changes": (grip,)})
        points.append(Point(options, point.wall, point.params, point.period_s, MAX_FORCE_N))
        springs = device.stiffness_n_per_m + FIRMER * hand.stiffness_n_per_m
        places.append(type(HARD.balance(device))(-HARD.force_n / springs, springs))
    result = Batch(law.law, points, arrivals.DURATION_S, criterion.window_s, ledger=False).run(threads)
    ended = zip(devices, places, result.finite, result.peak_to_peak_m, -result.mean_depth_m, strict=True)
    return [
        [float(finite and criterion.outcome(device.options, at, span_m, mean_m) == Outcome.SETTLED)]
        for device, at, finite, span_m, mean_m in ended
    ]


def softening(forces_n: Sequence[float], law: LawSpec, threads: int | None) -> list[list[float]]:
    """How long the damping stays above k T / 2 after a wall of the omega7 model went from 12 to 2 kN/m [s].

    The hands press without a pause; infinite: to the end.
    """
    wall = WallConfig(
        stiffness_n_per_m=HARD_N_PER_M, changes=(WallChange(at_s=SOFTENS_S, stiffness_n_per_m=SOFT_N_PER_M),)
    )
    hands: list[dict[str, object]] = [{"force": {"profile": "constant", "newton": -force_n}} for force_n in forces_n]
    return _above(_omega(hands), wall, law, SOFT_N_PER_M, SOFTENS_S, SOFTENED_S, threads)


def taking_over(forces_n: Sequence[float], law: LawSpec, threads: int | None) -> list[list[float]]:
    """How many presses and releases the damping stays above k T / 2 after another hand took over.

    A device of 1 N s/m, one sample late, at 15 kN/m asks for more; from 6 s on a hand gives it 30 N s/m.
    """
    wall = WallConfig(stiffness_n_per_m=TAKEOVER_N_PER_M)
    steady = [(0.0, 1.0), (HANDS_OVER_S, 1.0)]
    hands: list[dict[str, object]] = []
    for force_n in forces_n:
        points = [(time_s, -force_n * share) for time_s, share in steady]
        for at in range(round((HANDED_S - HANDS_OVER_S) / CYCLE_S)):
            from_s = HANDS_OVER_S + at * CYCLE_S
            points += [(from_s + 0.3 * CYCLE_S, 0.5), (from_s + 0.7 * CYCLE_S, 0.5), (from_s + CYCLE_S, -force_n)]
        hands.append({"stiffness_n_per_m": 100.0, "force": {"profile": "recorded", "points": points}})
    late = {"viscous_n_s_per_m": 1.0, "resolution_m": 2e-6, "force_delay_samples": 1}
    held = {"changes": [{"at_s": HANDS_OVER_S, "viscous_n_s_per_m": 30.0}]}
    rows = _above(_omega(hands, **late, **held), wall, law, TAKEOVER_N_PER_M, HANDS_OVER_S, HANDED_S, threads)
    return [[row[0] / CYCLE_S] for row in rows]


def _omega(hands: Sequence[dict[str, object]], **keys: object) -> list[SimulationOptions]:
    start = {"model": "omega7", "initial_position_m": 0.002, **keys}
    return [SimulationOptions.model_validate({**start, "hand": hand}) for hand in hands]


def _above(
    devices: Sequence[SimulationOptions],
    wall: WallConfig,
    law: LawSpec,
    stiffness: float,
    from_s: float,
    duration_s: float,
    threads: int | None,
) -> list[list[float]]:
    points = [Point(device, wall, law.params, 1e-3, MAX_FORCE_N) for device in devices]
    result = Batch(law.law, points, duration_s, 0.5, trace_every=1, ledger=False).run(threads)
    first, most = round(from_s / 1e-3), _WITHIN * 0.5 * stiffness * 1e-3
    found = []
    for at in range(len(devices)):
        _, _, x_m, _, _, damping = columns_of(result, at)
        inside = np.where(x_m < 0.0, damping, math.inf)[first:]
        least = inside.reshape(-1, round(WITHIN_S / 1e-3)).min(axis=1)
        above = np.flatnonzero((least > most) & np.isfinite(least))
        after = 0 if not len(above) else int(above[-1]) + 1
        found.append([after * WITHIN_S if after < len(least) else math.inf])
    return found
