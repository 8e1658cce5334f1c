"""Many loops at once: studies ask for points, all points of a law run as one batch, each study reads its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from hapticd import plugins
from hapticd.offline.outcome import Criterion, Outcome
from hapticd.offline.presses import aimed, judge
from hapticd.simulation.batch import Batch, BatchResult, Point

Array = np.ndarray[Any, Any]

law_named = cache(plugins.law)
"""Laws by name; looking one up reads every installed package."""

FEW_TICKS = 400_000
"""So few are run interpreted: compiling a law takes as long."""


@dataclass(slots=True)
class Asked:
    """Points that a study has asked for, and what became of them once they have run.

    Attributes:
        points: the loops.
        outcome: the verdict on each, by the criterion of every study.
        peak_to_peak_m, damping_n_s_per_m, settled_s: as in `BatchResult`.
    """

    points: Sequence[Point]
    outcome: Array = field(default_factory=lambda: np.empty(0))
    peak_to_peak_m: Array = field(default_factory=lambda: np.empty(0))
    damping_n_s_per_m: Array = field(default_factory=lambda: np.empty(0))
    settled_s: Array = field(default_factory=lambda: np.empty(0))

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
            result = _result(law, points, duration_s, progress)
            outcome = judge(Criterion(), points, result)
            first = 0
            for asked in every:
                part = slice(first, first + len(asked.points))
                first = part.stop
                asked.outcome = outcome[part]
                asked.peak_to_peak_m = np.where(result.finite, result.peak_to_peak_m, np.inf)[part]
                asked.damping_n_s_per_m = result.damping_n_s_per_m[part]
                asked.settled_s = result.settled_s[part]


def _result(law: str, points: Sequence[Point], duration_s: float, progress: Callable[[int], None]) -> BatchResult:
    batch = Batch(law_named(law), points, duration_s, Criterion().window_s)
    if sum(duration_s / point.period_s for point in points) <= FEW_TICKS:
        result = batch.run_interpreted()
        progress(len(points))
        return result
    return batch.run(progress=progress)
