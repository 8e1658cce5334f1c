"""Many loops at once: studies ask for points, all points of a law run as one batch, each study reads its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from hapticd import plugins
from hapticd.offline.felt import WINDOW_S
from hapticd.offline.outcome import Criterion, Outcome
from hapticd.offline.presses import aimed, judge
from hapticd.simulation.batch import Batch, BatchResult, Point
from hapticd_studies.felt_ends import felt_ends

Array = np.ndarray[Any, Any]

law_named = cache(plugins.law)
"""Laws by name; looking one up reads every installed package."""

FEW_TICKS = 400_000
"""So few are run interpreted: compiling a law takes as long."""

_AT_ONCE = 1000  # the last second of a point takes 50 kB


@dataclass(slots=True)
class Asked:
    """Points that a study has asked for, and what became of them once they have run.

    Attributes:
        points: the loops.
        outcome: the verdict on each, by the criterion of every study.
        peak_to_peak_m, damping_n_s_per_m, settled_s: as in `BatchResult`.
        felt, chatter_n: felt index of the last second, and the span of the force in it [N].
    """

    points: Sequence[Point]
    outcome: Array = field(default_factory=lambda: np.empty(0))
    peak_to_peak_m: Array = field(default_factory=lambda: np.empty(0))
    damping_n_s_per_m: Array = field(default_factory=lambda: np.empty(0))
    settled_s: Array = field(default_factory=lambda: np.empty(0))
    felt: Array = field(default_factory=lambda: np.empty(0))
    chatter_n: Array = field(default_factory=lambda: np.empty(0))

    def rest(self, among: Array | None = None) -> str:
        """What of those that came to rest is felt, in words; empty where none did.

        Args:
            among: true or false, a value a point: only of these.
        """
        settled = self.settled if among is None else self.settled & among
        if not settled.any():
            return ""
        felt, chatter_n = self.felt[settled], self.chatter_n[settled]
        return f", felt {np.median(felt):.2g} times the threshold, force spans {np.median(chatter_n):.2g} N (medians)"

    @property
    def settled(self) -> Array:
        """Which points came to rest in their place."""
        settled: Array = self.outcome == Outcome.SETTLED
        return settled

    def shares(self, of: Array, *shape: int) -> Array:
        """Share of the starts, the innermost axis, for which something is so.

        Args:
            of: true or false, a value a point.
            shape: lengths of the other axes.
        """
        shares: Array = of.reshape(*shape, -1).mean(axis=-1)
        return shares


class Runs:
    """Collects points law by law, then runs them."""

    def __init__(self) -> None:
        self._asked: dict[str, list[Asked]] = {}

    def ask(self, law: str, points: Sequence[Point]) -> Asked:
        """Want these points under this law."""
        asked = Asked([aimed(point, Criterion()) for point in points])
        self._asked.setdefault(law, []).append(asked)
        return asked

    @property
    def count(self) -> int:
        """Points in all."""
        return sum(len(asked.points) for every in self._asked.values() for asked in every)

    def run(self, duration_s: float, progress: Callable[[int], None]) -> None:
        """Run all points.

        Args:
            duration_s: simulated time of each [s].
            progress: hears now and then how many points have been done since it was last told.
        """
        for law, every in self._asked.items():
            points = [point for asked in every for point in asked.points]
            few = sum(duration_s / point.period_s for point in points) <= FEW_TICKS
            parts = [
                _columns(law, points[first : first + _AT_ONCE], duration_s, few, progress)
                for first in range(0, len(points), _AT_ONCE)
            ]
            columns = [np.concatenate(each) for each in zip(*parts, strict=True)]
            first = 0
            for asked in every:
                part = slice(first, first + len(asked.points))
                first = part.stop
                (
                    asked.outcome,
                    asked.peak_to_peak_m,
                    asked.damping_n_s_per_m,
                    asked.settled_s,
                    asked.felt,
                    asked.chatter_n,
                ) = (column[part] for column in columns)


def _columns(
    law: str, points: Sequence[Point], duration_s: float, few: bool, progress: Callable[[int], None]
) -> tuple[Array, ...]:
    batch = Batch(law_named(law), points, duration_s, Criterion().window_s, trace_every=1, trace_last_s=WINDOW_S)
    result = _result(batch, few, progress)
    return (
        judge(Criterion(), points, result),
        np.where(result.finite, result.peak_to_peak_m, np.inf),
        result.damping_n_s_per_m,
        result.settled_s,
        *felt_ends(points, result),
    )


def _result(batch: Batch, few: bool, progress: Callable[[int], None]) -> BatchResult:
    if not few:
        return batch.run(progress=progress)
    result = batch.run_interpreted()
    progress(len(result.finite))
    return result
