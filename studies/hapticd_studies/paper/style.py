"""What these figures have beyond the style of all: a smaller hand, and a colour for each verdict."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap

from hapticd.figures import style

BLUE, ORANGE, RED, GREY, INK = style.BLUE, style.ORANGE, style.RED, style.SLATE, style.INK
GREEN, PURPLE = style.SERIES[2], style.SERIES[3]
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


def limits(axes: Axes, values: Any, margin: float = 0.08) -> None:
    """Vertical limits that leave some air around what is finite."""
    finite = np.asarray(values)[np.isfinite(values)]
    low, high = float(finite.min()), float(finite.max())
    air = (high - low or abs(high) or 1.0) * margin
    axes.set_ylim(low - air, high + air)
