"""What a model without some terms answers otherwise than the full one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hapticd.offline.felt import MOVING_HZ, WINDOW_S, felt_index
from hapticd.offline.run import Run

_LEAST_SETTLING_S = 0.002
"""Settling times closer than this are the same whatever the tolerance: a tick or two of a threshold [s]."""


@dataclass(frozen=True, slots=True)
class Answers:
    """A run held against the one of the full model; shares are of the full model's.

    Attributes:
        verdict: what became of it.
        same_verdict: whether that is what became of the full model.
        settled_s: when it settled; NaN when it never did or has nowhere to [s].
        settling: how much earlier or later, a share; 0 where neither settles, infinite where only one does.
        force: root mean square of the difference in force, tick by tick, a share.
        energy: largest difference of the energy into the walls, a share of the largest.
        stiffness: difference of the stiffness shown at the end, a share.
        path: of a run in space the largest distance of the two paths, a share of the way that the full one goes.
        felt: of a run in space how many times the threshold of a hand the difference of the two paths vibrates.
    """

    verdict: str
    same_verdict: bool
    settled_s: float
    settling: float
    force: float
    energy: float
    stiffness: float
    path: float = 0.0
    felt: float = 0.0

    def broken(self, tolerance: float) -> list[str]:
        """The answers that are not the full model's within a share."""
        found = [] if self.same_verdict else ["verdict"]
        for name in ("settling", "force", "energy", "stiffness", "path"):
            if not getattr(self, name) <= tolerance:
                found.append(name)
        if tolerance == 0.0:
            return found + ["felt"] * (self.felt > 0.0)
        return found + ["felt"] * (self.felt > _FELT)


_FELT = 1.0
"""A vibration below this is not felt."""

_POSITION = ("position_x_m", "position_y_m", "position_z_m")
_FORCE = ("force_x_n", "force_y_n", "force_z_n")


def answers(run: Run, full: Run) -> Answers:
    """Hold a run against that of the full model."""
    largest_j = max(map(abs, full.columns["energy_j"]))
    energy_j = run.energy_error_j(full)
    path, felt = _paths(run, full) if full.in_space else (0.0, 0.0)
    return Answers(
        verdict=run.outcome.words,
        same_verdict=run.outcome is full.outcome,
        settled_s=run.settled_s,
        settling=_settling(run.settled_s, full.settled_s),
        force=force_error(run, full),
        energy=energy_j / largest_j if largest_j > 0.0 else (0.0 if energy_j == 0.0 else math.inf),
        stiffness=_share(run.displayed_stiffness_n_per_m, full.displayed_stiffness_n_per_m),
        path=path,
        felt=felt,
    )


def force_error(run: Run, full: Run) -> float:
    """Root mean square of the difference in force over that of the full model; infinite when the run ends early."""
    if run.ticks < full.ticks:
        return math.inf
    names = _FORCE if full.in_space else ("force_n",)
    ours, theirs = _columns(run, names)[: full.ticks], _columns(full, names)
    off = float(np.sqrt(np.mean((ours - theirs) ** 2)))
    size = float(np.sqrt(np.mean(theirs**2)))
    return off / size if size > 0.0 else (0.0 if off == 0.0 else math.inf)


def _paths(run: Run, full: Run) -> tuple[float, float]:
    """Largest distance as a share of the way, and how far the difference is felt; infinite when the run ends early."""
    if run.ticks < full.ticks:
        return math.inf, math.inf
    way_m = _columns(full, _POSITION)
    off_m = _columns(run, _POSITION)[: full.ticks] - way_m
    largest_m, size_m = (float(np.linalg.norm(each, axis=1).max()) for each in (off_m, way_m - way_m[0]))
    end_m = off_m[-round(WINDOW_S / full.period_s) :]
    felt = math.hypot(*(felt_index(each, full.period_s, MOVING_HZ) for each in end_m.T))
    return largest_m / size_m if size_m > 0.0 else (0.0 if largest_m == 0.0 else math.inf), felt


def _columns(run: Run, names: Sequence[str]) -> np.ndarray[Any, Any]:
    return np.array([run.columns[name] for name in names]).T


def _settling(one_s: float, full_s: float) -> float:
    if not math.isnan(one_s) and not math.isnan(full_s) and abs(one_s - full_s) <= _LEAST_SETTLING_S:
        return 0.0
    return _share(one_s, full_s)


def _share(one: float, full: float) -> float:
    if math.isnan(one) or math.isnan(full):
        return 0.0 if math.isnan(one) and math.isnan(full) else math.inf
    if one == full:
        return 0.0
    return abs(one - full) / abs(full) if full != 0.0 else math.inf
