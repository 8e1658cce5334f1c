"""How every figure looks: one hand, units at the axes, legible in print and to the colour-blind."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

INK = "#1b1f24"
GRID = "#d9dde2"
BLUE = "#1f5f99"
ORANGE = "#e69f00"
SAND = "#e9c46a"
PALE = "#eceff2"
GREY = "#a7afb8"
SLATE = "#6b7684"
RED = "#c8372d"
WALL = "#ece7dd"
"""What is inside a wall is shaded like this."""

SERIES = (BLUE, ORANGE, "#0a9273", "#c887b0", "#8a2f1b", "#62b5e5")
"""For curves, in this order; told apart with any colour vision."""

_DEEP = 1e5  # below any limit of an axis in mm

RC: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.labelsize": 9.5,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "text.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.6,
    "savefig.dpi": 160,
}


def applied() -> AbstractContextManager[None]:
    """The style, for as long as a figure is made."""
    return mpl.rc_context(RC)


def shade_wall(axes: Axes) -> None:
    """Shade what is inside the wall, below zero, whatever limits the axes come to have."""
    across = axes.get_yaxis_transform()
    axes.add_artist(Rectangle((0.0, -_DEEP), 1.0, _DEEP, transform=across, color=WALL, zorder=0, lw=0))
    axes.add_artist(Line2D([0.0, 1.0], [0.0, 0.0], transform=across, color=SLATE, lw=0.7, zorder=1))


def blank(width_in: float, height_in: float) -> Figure:
    """A figure without axes, and without a window."""
    drawn = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(drawn)
    return drawn


def figure(width_in: float, height_in: float, rows: int = 1, columns: int = 1, **shared: Any) -> tuple[Figure, Any]:
    """A figure with a 2-d array of axes."""
    drawn = blank(width_in, height_in)
    return drawn, drawn.subplots(rows, columns, squeeze=False, **shared)


def plain_ticks(axis: Axis, steps: Sequence[float] = (1.0, 2.0, 5.0)) -> None:
    """Numbers as they are spoken on a logarithmic axis: 1, 2, 5, 10; over many decades 1, 10, 100."""
    axis.set_major_locator(LogLocator(subs=steps))
    axis.set_major_formatter(FormatStrFormatter("%g"))
    axis.set_minor_formatter(NullFormatter())
