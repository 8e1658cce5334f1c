"""A day without a pause: the energy sums after 8.64e7 ticks against compensated ones, and whether the law still adapts.

Two devices run the loop of the daemon for 24 h at 1 kHz. The reference adds the same products with twice the digits.
Then each, as old as it is, is dropped onto a stiffer wall, where nothing settles without damping: once with the damping
that it has learnt, and once without, to see that it can still learn.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit

from hapticd import plugins
from hapticd.config.walls import WallConfig
from hapticd.offline.felt import WINDOW_S
from hapticd.offline.outcome import Criterion, Outcome
from hapticd.offline.presses import judge
from hapticd.simulation.batch import TRACE_COLUMNS, Batch, Point
from hapticd.simulation.compiler.compile import OPTIONS, compiled
from hapticd.simulation.compiler.threads import in_threads
from hapticd.simulation.options import SimulationOptions
from hapticd_studies.felt_ends import felt_ends

LAW = "energy-cycle"
PERIOD_S = 1e-3
DAY_TICKS = 86_400_000
CHUNK_TICKS = 480_000

STIFFNESS_N_PER_M = 12_000.0
NEW_STIFFNESS_N_PER_M = 20_000.0
EXAM_S = 5.0

SUM_SHARE = 1e-9
"""How close the sums of a day must be to the compensated ones, relative."""

HANDS: dict[str, dict[str, Any]] = {
    "pressed and let go once a second": {"profile": "press-and-release", "newton": -3.0, "period_s": 1.0},
    "shaken at 7 Hz, never let go": {"profile": "sine", "newton": 2.5, "offset_newton": -4.0, "frequency_hz": 7.0},
}

_MEASURED, _FORCE = TRACE_COLUMNS.index("x_measured_m"), TRACE_COLUMNS.index("force_n")
_SUMS = ("energy_j", "generated_j", "dissipated_j")


@dataclass(frozen=True, slots=True)
class LongRun:
    """One device after its day.

    Attributes:
        hand: what its hand did.
        ticks: how many.
        cycles: energy cycles that were detected.
        cycles_at_first, cycles_at_last: those of the first and of the last tenth of the day.
        sums_j: the ledger's sums by name [J].
        errors: relative to what went through the books, their distance from the compensated ones.
        resolution_j: half of the last digit of the largest sum [J].
        cycle_j: the energy that the last cycle made [J].
        running_j: the sum in which law and ledger look for cycles, at the end [J].
        damping_n_s_per_m: of the law at the end of the day.
        kept_n_s_per_m: damping after the new wall, of this law as it was.
        adapted_n_s_per_m: the same, of this law after its damping was set to 0.
        fresh_n_s_per_m: the same, of a new law.
        kept_outcome, outcome, fresh_outcome: `Outcome` on the new wall, of these three.
        felt, chatter_n: felt index of the last second there and span of its force [N], of these three.
    """

    hand: str
    ticks: int
    cycles: int
    cycles_at_first: int
    cycles_at_last: int
    sums_j: dict[str, float]
    errors: dict[str, float]
    resolution_j: float
    cycle_j: float
    running_j: float
    damping_n_s_per_m: float
    kept_n_s_per_m: float
    adapted_n_s_per_m: float
    fresh_n_s_per_m: float
    kept_outcome: Outcome
    outcome: Outcome
    fresh_outcome: Outcome
    felt: tuple[float, float, float]
    chatter_n: tuple[float, float, float]

    @property
    def holds(self) -> bool:
        """Whether the sums are right, cycles are still found, and the new wall is held."""
        return (
            all(error <= SUM_SHARE for error in self.errors.values())
            and self.cycles_at_last > 0
            and abs(self.cycles_at_last - self.cycles_at_first) <= 0.01 * self.cycles_at_first + 20.0
            and self.kept_outcome is Outcome.SETTLED
            and self.outcome is Outcome.SETTLED
            and self.adapted_n_s_per_m > 0.0
        )


def run_days(ticks: int = DAY_TICKS, progress: Callable[[int], None] | None = None) -> list[LongRun]:
    """Run both devices.

    Args:
        ticks: of each, to the nearest ten chunks.
        progress: told how many ticks are done.
    """
    law = plugins.law(LAW)
    wall = WallConfig(stiffness_n_per_m=STIFFNESS_N_PER_M)
    points = [Point(_device(force), wall, law.Params(), PERIOD_S) for force in HANDS.values()]
    chunks = 10 * max(1, round(ticks / CHUNK_TICKS / 10))
    chunk_ticks = min(CHUNK_TICKS, -(-ticks // 10))
    batch = Batch(law, points, chunk_ticks * PERIOD_S, chunk_ticks * PERIOD_S, trace_every=1)
    arrays = batch.arrays()
    sums = np.zeros((len(points), SUMS))
    counted = []
    for chunk in range(chunks):
        batch.run_on(arrays)
        in_threads(_sweep(), len(points), arrays.traces, STIFFNESS_N_PER_M, sums)
        counted.append(arrays.ledgers["cycle"].copy())
        if progress:
            progress((chunk + 1) * chunk_ticks)
    tenth = chunks // 10
    fresh, kept, emptied = _examined(arrays)
    days = []
    for at, hand in enumerate(HANDS):
        ledger, turnover = arrays.ledgers[at], sums[at, TURNOVER]
        truths = [sums[at, first] + sums[at, first + 1] for first in (WORK, GENERATED, DISSIPATED)]
        found = {name: float(ledger[name]) for name in _SUMS}
        largest = max(abs(value) for value in found.values())
        days.append(
            LongRun(
                hand=hand,
                ticks=chunks * chunk_ticks,
                cycles=int(counted[-1][at]),
                cycles_at_first=int(counted[tenth - 1][at]),
                cycles_at_last=int(counted[-1][at] - counted[-1 - tenth][at]),
                sums_j=found,
                errors={
                    name: float(abs(found[name] - true) / turnover) for name, true in zip(_SUMS, truths, strict=True)
                },
                resolution_j=0.5 * math.ulp(largest),
                cycle_j=float(ledger["cycle_generated_j"]),
                running_j=max(abs(float(ledger["_since_j"])), abs(float(arrays.law_states[at]["energy_j"]))),
                damping_n_s_per_m=float(arrays.law_states[at]["damping_n_s_per_m"]),
                kept_n_s_per_m=kept[at].damping_n_s_per_m,
                adapted_n_s_per_m=emptied[at].damping_n_s_per_m,
                fresh_n_s_per_m=fresh[at].damping_n_s_per_m,
                kept_outcome=kept[at].outcome,
                outcome=emptied[at].outcome,
                fresh_outcome=fresh[at].outcome,
                felt=(kept[at].felt, emptied[at].felt, fresh[at].felt),
                chatter_n=(kept[at].chatter_n, emptied[at].chatter_n, fresh[at].chatter_n),
            )
        )
    return days


def _device(force: dict[str, Any], **keys: Any) -> SimulationOptions:
    return SimulationOptions.model_validate({"model": "omega7", "hand": {"force": force}, **keys})


@dataclass(frozen=True, slots=True)
class _Exam:
    outcome: Outcome
    damping_n_s_per_m: float
    felt: float
    chatter_n: float


def _examined(old: Any) -> list[list[_Exam]]:
    """The end of new laws, old ones, and old ones without their damping, dropped onto a stiffer wall."""
    law, criterion = plugins.law(LAW), Criterion()
    device = _device({"profile": "constant", "newton": -3.0}, initial_position_m=5e-3)
    point = Point(device, WallConfig(stiffness_n_per_m=NEW_STIFFNESS_N_PER_M), law.Params(), PERIOD_S)
    points = [point] * len(HANDS)
    found = []
    for aged, emptied in ((False, False), (True, False), (True, True)):
        batch = Batch(law, points, EXAM_S, criterion.window_s, trace_every=1, trace_last_s=WINDOW_S)
        arrays = batch.arrays()
        if aged:
            arrays.law_states[:] = old.law_states
            arrays.ledgers[:] = old.ledgers
        if emptied:
            arrays.law_states["damping_n_s_per_m"] = 0.0
        batch.run_on(arrays)
        result = batch.result(arrays)
        outcomes = judge(criterion, points, result)
        ends = zip(outcomes, arrays.law_states["damping_n_s_per_m"], *felt_ends(points, result), strict=True)
        found.append([_Exam(Outcome(int(one)), *map(float, figures)) for one, *figures in ends])
    return found


WORK, GENERATED, DISSIPATED = 0, 2, 4
TURNOVER, _LAST, _SPRING, _WRITTEN = 6, 7, 8, 9
SUMS = 10
"""Three sums, each as its value and what that has lost; then what went through the books, and the tick before."""


def enter(trace: Any, stiffness: float, sums: Any) -> None:
    """Enter a stretch of one run into its books, with twice the digits of the ledger.

    Args:
        trace: (ticks, columns) as `TRACE_COLUMNS`.
        stiffness: of the wall [N/m].
        sums: an array of `SUMS`, zeros at first.
    """
    for row in range(len(trace)):
        measured = trace[row, _MEASURED]
        moved = measured - sums[_LAST]
        depth = max(0.0, -measured)
        change = abs(depth - max(0.0, -sums[_LAST]))
        add_product(sums, WORK, -sums[_WRITTEN], moved)
        add_product(sums, GENERATED, stiffness * change, 0.5 * change + max(0.0, measured))
        add_product(sums, DISSIPATED, sums[_SPRING], moved)
        add_product(sums, DISSIPATED, -sums[_WRITTEN], moved)
        sums[TURNOVER] += abs(sums[_WRITTEN] * moved) + stiffness * change * change
        sums[_WRITTEN] = trace[row, _FORCE]
        sums[_SPRING] = stiffness * depth
        sums[_LAST] = measured


def add_product(sums: Any, at: int, left: float, right: float) -> None:
    """Add a product without rounding it (Dekker 1971) to a sum that keeps what it loses (Neumaier 1974)."""
    product = left * right
    a = 134217729.0 * left
    a = a - (a - left)
    b = 134217729.0 * right
    b = b - (b - right)
    rest = ((a * b - product) + a * (right - b) + (left - a) * b) + (left - a) * (right - b)
    total = sums[at] + product
    part = total - sums[at]
    sums[at + 1] += rest + ((sums[at] - (total - part)) + (product - part))
    sums[at] = total


@lru_cache(maxsize=1)
def _sweep() -> Any:
    one = compiled(enter)

    @njit(**OPTIONS)  # type: ignore[untyped-decorator]  # numba publishes no types
    def sweep(first: Any, stop: Any, traces: Any, stiffness: float, sums: Any) -> None:
        for at in range(first, stop):
            one(traces[at], stiffness, sums[at])

    return sweep
