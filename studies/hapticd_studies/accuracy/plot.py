"""The work-precision diagram: what a period costs against what it errs by, with the front that nothing beats."""

from __future__ import annotations

import math

from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from hapticd.figures import style
from hapticd.figures.picture import encoded
from hapticd_studies.accuracy.model import ModelRow, ModelStudy
from hapticd_studies.accuracy.report import AccuracyReport

_NOTHING = 1e-18
"""Where no error at all stands on a logarithmic axis [m]."""

_MARKERS = {
    "exact": ("*", style.INK),
    "explicit-euler": ("o", style.SERIES[0]),
    "semi-implicit-euler": ("D", style.SERIES[1]),
    "velocity-verlet": ("^", style.SERIES[2]),
    "rk4": ("s", style.SERIES[3]),
    "adaptive": ("P", style.SERIES[4]),
    "float32": ("X", style.SERIES[5]),
    "without a term": ("v", style.GREY),
}


def draw(report: AccuracyReport) -> bytes:
    """The diagram as a PNG file: errors under the same forces, and errors in the loop."""
    with style.applied():
        figure, axes = style.figure(10.0, 4.9, 1, 2, sharey=True)
        _panel(axes[0][0], report.model, "Under the same forces", [row.same_forces_m for row in report.model.rows])
        _panel(axes[0][1], report.model, "In the loop", [row.position_m for row in report.model.rows])
        _front(axes[0][1], report.model)
        axes[0][0].set_ylabel("cost of a period, times the cheapest")
        families = {row.family for row in report.model.rows}
        handles = [
            Line2D([], [], linestyle="none", marker=marker, color=colour, markersize=6.0, label=family)
            for family, (marker, colour) in _MARKERS.items()
            if family in families
        ]
        front = Line2D([], [], color=style.RED, linewidth=1.2, drawstyle="steps-post", label="Pareto front")
        figure.legend(handles=[*handles, front], loc="outside lower center", ncols=5)
        return encoded(figure, ".png")


def _panel(panel: Axes, model: ModelStudy, title: str, errors: list[float]) -> None:
    for family, (marker, colour) in _MARKERS.items():
        points = [
            (max(error, _NOTHING), row.cost.ratio)
            for row, error in zip(model.rows, errors, strict=True)
            if row.family == family and math.isfinite(error)
        ]
        if points:
            line = "-" if family not in ("exact", "without a term", "adaptive") else ""
            panel.plot(*zip(*points, strict=True), marker=marker, linestyle=line, linewidth=0.8, color=colour)
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xlim(left=0.3 * _NOTHING)
    panel.set_xlabel(f"largest error of the position [m]; 0 stands at {_NOTHING:g}")
    panel.set_title(title, loc="left")


def _front(panel: Axes, model: ModelStudy) -> None:
    best: list[ModelRow] = sorted((row for row in model.rows if row.best), key=lambda row: row.position_m)
    points = [(max(row.position_m, _NOTHING), row.cost.ratio) for row in best]
    panel.plot(*zip(*points, strict=True), color=style.RED, linewidth=1.2, drawstyle="steps-post", zorder=0)
    for x, y in points:
        panel.plot(x, y, marker="o", markersize=11.0, fillstyle="none", color=style.RED, markeredgewidth=1.2)
