"""The picture of a map: laws side by side, the analytic limits drawn over each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, Colormap, LinearSegmentedColormap, ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from hapticd.figures import style
from hapticd.figures.picture import encoded
from hapticd.offline.outcome import PRESSED, Outcome
from hapticd_studies.zwidth.curves import Curve
from hapticd_studies.zwidth.plane import MapAxis
from hapticd_studies.zwidth.sweep import ZwidthPlan

_COLOURS = {
    Outcome.SETTLED: style.BLUE,
    Outcome.ELSEWHERE: style.SAND,
    Outcome.MOVING: style.PALE,
    Outcome.DIVERGED: style.GREY,
}
_LINES: dict[str, dict[str, Any]] = {
    "stable": {"color": style.INK, "linestyle": "-", "linewidth": 1.8},
    "passive": {"color": style.RED, "linestyle": (0, (5, 3)), "linewidth": 1.8},
    "quantised-passive": {"color": style.INK, "linestyle": (0, (1.2, 1.6)), "linewidth": 2.0},
}
_COLUMNS = 3


def draw(plan: ZwidthPlan, tables: Sequence[np.ndarray[Any, Any]], found: Sequence[Curve]) -> bytes:
    """The map as a PNG file."""
    with style.applied():
        return _draw_cells(plan, tables, found) if plan.method == "grid" else _draw_edges(plan, tables, found)


def _draw_cells(plan: ZwidthPlan, tables: Sequence[np.ndarray[Any, Any]], found: Sequence[Curve]) -> bytes:
    columns = min(_COLUMNS, len(tables))
    rows = -(-len(tables) // columns)
    figure, axes = style.figure(0.9 + 3.1 * columns, 1.25 + 2.9 * rows, rows, columns, sharex=True, sharey=True)
    share = plan.starts > 1
    for at, (table, reading) in enumerate(zip(tables, plan.readings, strict=True)):
        panel = axes[at // columns][at % columns]
        settled = table[:, 0] == Outcome.SETTLED
        shape = (len(plan.y.values), len(plan.x.values))
        edges = (_cell_edges(plan.x), _cell_edges(plan.y))
        colours: Colormap
        if share:
            colours = LinearSegmentedColormap.from_list("share", [style.PALE, style.BLUE])
            panel.pcolormesh(*edges, table[:, 1].reshape(shape) / plan.starts, cmap=colours, vmin=0.0, vmax=1.0)
        else:
            colours = ListedColormap([_COLOURS[outcome] for outcome in PRESSED])
            norm = BoundaryNorm(np.arange(-0.5, len(PRESSED)), len(PRESSED))
            panel.pcolormesh(*edges, table[:, 0].reshape(shape), cmap=colours, norm=norm)
        _curves(panel, plan, found)
        _frame(panel, plan)
        panel.grid(visible=False)
        panel.set_title(_wrapped(reading.label), loc="left")
        panel.set_title(f"{100.0 * settled.mean():.1f} %", loc="right", fontweight="normal")
        panel.tick_params(labelbottom=at + columns >= len(tables))
        if at + columns >= len(tables):
            panel.set_xlabel(plan.x.quantity.axis_label)
        if at % columns == 0:
            panel.set_ylabel(plan.y.quantity.axis_label)
    for at in range(len(tables), rows * columns):
        axes[at // columns][at % columns].set_visible(False)
    if share:
        patches = [Patch(color=style.BLUE, label="all starts settled"), Patch(color=style.PALE, label="none")]
    else:
        seen = {int(outcome) for table in tables for outcome in np.unique(table[:, 0])}
        patches = [
            Patch(facecolor=_COLOURS[outcome], edgecolor=style.GREY, linewidth=0.5, label=outcome.words)
            for outcome in PRESSED
            if outcome in seen
        ]
    figure.legend(handles=[*patches, *_curve_handles(found)], loc="outside lower center", ncols=2 if columns < 3 else 3)
    return encoded(figure, ".png")


def _draw_edges(plan: ZwidthPlan, tables: Sequence[np.ndarray[Any, Any]], found: Sequence[Curve]) -> bytes:
    figure, axes = style.figure(6.4, 5.0)
    panel = axes[0][0]
    y = np.array(plan.y.values) * plan.y.quantity.shown_scale
    handles = []
    for at, (table, reading) in enumerate(zip(tables, plan.readings, strict=True)):
        colour = style.SERIES[at % len(style.SERIES)]
        x = edge_middles(plan.x, table) * plan.x.quantity.shown_scale
        width = 1.4 + 5.0 * (len(tables) - 1 - at) / len(tables)  # the last is the thinnest, so that all can be seen
        panel.plot(x, y, color=colour, linewidth=width, solid_capstyle="butt", clip_on=False)
        handles.append(Line2D([], [], color=colour, linewidth=width, label=reading.label))
    _curves(panel, plan, found)
    _frame(panel, plan)
    panel.margins(0.0)
    panel.set_xlabel(plan.x.quantity.axis_label)
    panel.set_ylabel(plan.y.quantity.axis_label)
    panel.set_title("Edge of what settles; along the border there is none in this range", loc="left")
    figure.legend(handles=[*handles, *_curve_handles(found)], loc="outside lower center", ncols=2)
    return encoded(figure, ".png")


def edge_middles(axis: MapAxis, table: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Where to draw the edge of each line; without one, at the end of the range that it lies beyond."""
    low, high = axis.values[0], axis.values[-1]
    settles_low, settles_high = table[:, 0] > 0.5, table[:, 1] > 0.5
    settles_upward = np.sum(~settles_low & settles_high) > np.sum(settles_low & ~settles_high)
    beyond = np.where(settles_low == settles_upward, low, high)
    middles = [axis.between(*bracket) if not math.isnan(bracket[0]) else math.nan for bracket in table[:, 2:4]]
    return np.where(settles_low == settles_high, beyond, middles)


def _curves(panel: Axes, plan: ZwidthPlan, found: Sequence[Curve]) -> None:
    scale_x, scale_y = plan.x.quantity.shown_scale, plan.y.quantity.shown_scale
    lines = [(curve, np.array(line).T * [[scale_x], [scale_y]]) for curve in found for line in curve.lines]
    for _, line in lines:
        panel.plot(*line, color="white", linewidth=3.4)  # a line then shows on any ground
    for curve, line in lines:
        panel.plot(*line, **_LINES[curve.key])


def _curve_handles(found: Sequence[Curve]) -> list[Line2D]:
    return [Line2D([], [], label=curve.label, **_LINES[curve.key]) for curve in found]


def _frame(panel: Axes, plan: ZwidthPlan) -> None:
    if plan.x.logarithmic:
        panel.set_xscale("log")
        style.plain_ticks(panel.xaxis)
    if plan.y.logarithmic:
        panel.set_yscale("log")
        style.plain_ticks(panel.yaxis)
    x, y = (_cell_edges(axis) for axis in (plan.x, plan.y))
    panel.set_xlim(x[0], x[-1])
    panel.set_ylim(y[0], y[-1])


def _cell_edges(axis: MapAxis) -> np.ndarray[Any, Any]:
    """Where cells begin and end, in shown units."""
    values = np.array(axis.values) * axis.quantity.shown_scale
    if len(values) == 1:
        return np.array([values[0] * 0.9 - 0.1, values[0] * 1.1 + 0.1])
    if axis.logarithmic:
        values = np.log(values)
    middles = 0.5 * (values[1:] + values[:-1])
    edges = np.concatenate([[2.0 * values[0] - middles[0]], middles, [2.0 * values[-1] - middles[-1]]])
    return np.exp(edges) if axis.logarithmic else edges


def _wrapped(label: str) -> str:
    """A law with parameters, one parameter a line."""
    return label.replace(":", "\n")
