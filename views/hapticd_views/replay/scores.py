"""What a law made of the recorded hand, in columns and in a row of a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

CALM_S = 0.1
"""What is slower than this is the hand, what is faster is the loop [s]."""


@dataclass(slots=True)
class Trace:
    """One law over the replayed part, an element a tick, along the first wall's normal.

    Attributes:
        law: its name; "recorded" for what was recorded.
        x_m: position relative to the wall, < 0 inside [m].
        force_n, force_requested_n: applied, and asked for; > 0 pushes out [N].
        energy_j: into all walls [J].
        damping_n_s_per_m: of the law [N s/m].
        in_contact: inside the wall.
        generated_j, dissipated_j: of all walls, over the part [J].
        fault: why the daemon would have stopped; "" when it would not.
    """

    law: str
    x_m: Any = field(default_factory=list)
    force_n: Any = field(default_factory=list)
    force_requested_n: Any = field(default_factory=list)
    energy_j: Any = field(default_factory=list)
    damping_n_s_per_m: Any = field(default_factory=list)
    in_contact: Any = field(default_factory=list)
    generated_j: float = math.nan
    dissipated_j: float = math.nan
    fault: str = ""

    def columns(self) -> dict[str, Any]:
        """Its columns as arrays."""
        names = ("x_m", "force_n", "force_requested_n", "energy_j", "damping_n_s_per_m", "in_contact")
        return {name: np.asarray(getattr(self, name)) for name in names}


@dataclass(frozen=True, slots=True)
class Score:
    """A row of the table; NaN for what there is not.

    Attributes:
        law: its name; "recorded" for what was recorded.
        depth_m: deepest position inside the wall [m].
        shaking_m: root mean square of the position about its mean over 0.1 s, in contact [m].
        peak_force_n: largest force, magnitude [N].
        stiffness_n_per_m: displayed: mean force over mean depth in contact [N/m].
        generated_j, dissipated_j: energy that the walls made; that walls and law took [J].
        damping_n_s_per_m: largest of the law [N s/m].
        force_off_n, position_off_m: root mean square of the difference from what was recorded [N], [m].
        ticks: how many there are: fewer where the model diverged.
        fault: why the daemon would have stopped; "" when it would not.
    """

    law: str
    depth_m: float
    shaking_m: float
    peak_force_n: float
    stiffness_n_per_m: float
    generated_j: float
    dissipated_j: float
    damping_n_s_per_m: float
    force_off_n: float
    position_off_m: float
    ticks: int
    fault: str


def score(trace: Trace, recorded: Trace, period_s: float) -> Score:
    """The figures of a law.

    Args:
        trace: what it made.
        recorded: what was recorded in the same ticks.
        period_s: time between ticks [s].
    """
    x_m, force_n = np.asarray(trace.x_m), np.asarray(trace.force_n)
    inside = np.asarray(trace.in_contact, bool)
    depth_m = -float(x_m[inside].sum())
    calm = x_m - _running_mean(x_m, max(1, round(CALM_S / period_s)))
    count = len(x_m)
    return Score(
        law=trace.law,
        depth_m=max(0.0, -float(x_m.min())),
        shaking_m=_rms(calm[inside]) if inside.any() else math.nan,
        peak_force_n=float(np.abs(force_n).max()),
        stiffness_n_per_m=float(force_n[inside].sum()) / depth_m if depth_m > 0.0 else math.nan,
        generated_j=trace.generated_j,
        dissipated_j=trace.dissipated_j,
        damping_n_s_per_m=float(np.max(trace.damping_n_s_per_m)),
        force_off_n=_rms(force_n - np.asarray(recorded.force_n)[:count]),
        position_off_m=_rms(x_m - np.asarray(recorded.x_m)[:count]),
        ticks=count,
        fault=trace.fault,
    )


def table(scores: Sequence[Score], digits: int = 4) -> list[str]:
    """The scores for people, a line a law, numbers with this many digits."""
    rows = [
        ["law", "depth", "shaking", "peak force", "stiffness", "made", "taken", "damping", "off", "off"],
        ["", "mm", "um", "N", "N/m", "mJ", "mJ", "N s/m", "N", "mm"],
    ]
    for one in scores:
        values = (
            (one.depth_m, 1e3), (one.shaking_m, 1e6), (one.peak_force_n, 1.0), (one.stiffness_n_per_m, 1.0),
            (one.generated_j, 1e3), (one.dissipated_j, 1e3), (one.damping_n_s_per_m, 1.0), (one.force_off_n, 1.0),
            (one.position_off_m, 1e3),
        )  # fmt: skip
        rows.append([one.law, *(_shown(value * scale, digits) for value, scale in values)])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        others = map(str.rjust, row[1:], widths[1:])
        lines.append("  ".join([row[0].ljust(widths[0]), *others]).rstrip())
    return [*lines, *(f"{one.law}: would have stopped: {one.fault}" for one in scores if one.fault)]


def _shown(value: float, digits: int) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}g}"


def _rms(values: Any) -> float:
    return math.sqrt(float(np.mean(np.square(values))))


def _running_mean(values: Any, width: int) -> Any:
    """The mean about each element, of fewer at the ends."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    at = np.arange(len(values))
    low = np.maximum(0, at - width // 2)
    high = np.minimum(len(values), at + width // 2 + 1)
    return (sums[high] - sums[low]) / (high - low)
