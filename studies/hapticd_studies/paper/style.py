"""What these figures have beyond the style of all studies: walls are shaded, and each verdict has a colour."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap

from hapticd_studies import style

BLUE, ORANGE, RED, GREY, INK = style.BLUE, style.ORANGE, style.RED, style.SERIES[5], style.INK
GREEN, PURPLE = style.SERIES[2], style.SERIES[3]
WALL = "#ece7dd"
"""What is inside a wall is shaded like this."""

OUTCOMES = ListedColormap(["#dbe9df", style.SAND, "#df8250", "#7c1d1a"])
"""Settled, out of place, moving, diverged: light to dark, so that a print in grey keeps the order."""

WIDTH_IN = 7.2
"""Width of a figure on an A4 page with margins [inch]."""

_MORE: Any = {
    "font.size": 8.5,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.labelsize": 8.5,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.0,
    "legend.title_fontsize": 8.0,
    "lines.linewidth": 1.1,
    "agg.path.chunksize": 10000,
}


@contextmanager
def look(dots_per_inch: int) -> Iterator[None]:
    """Draw in this style."""
    with style.applied(), mpl.rc_context({**_MORE, "savefig.dpi": dots_per_inch}):
        yield


def shade_wall(axes: Axes) -> None:
    """Shade what is inside the wall, below zero; call it when the limits are final."""
    low, high = axes.get_ylim()
    if low < 0.0:
        axes.axhspan(low, min(0.0, high), color=WALL, zorder=0, lw=0)
        axes.axhline(0.0, color=GREY, lw=0.7, zorder=1)
        axes.set_ylim(low, high)


def limits(axes: Axes, values: Any, margin: float = 0.08) -> None:
    """Vertical limits that leave some air around what is finite."""
    finite = np.asarray(values)[np.isfinite(values)]
    low, high = float(finite.min()), float(finite.max())
    air = (high - low or abs(high) or 1.0) * margin
    axes.set_ylim(low - air, high + air)
