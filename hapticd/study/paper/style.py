"""How every figure looks: legible in print, in grey too, with a unit on every axis."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap

BLUE, ORANGE, GREEN, RED, PURPLE, GREY = "#0b5394", "#d9730d", "#2e7d32", "#b3261e", "#7b3fa0", "#6b7280"
WALL = "#e9e4da"
"""What is inside a wall is shaded like this."""

OUTCOMES = ListedColormap(["#dfeedd", "#f2d98b", "#e08a5b", "#8c1d18"])
"""Settled, out of place, moving, diverged: light to dark, so that grey print keeps the order."""

WIDTH_IN = 7.2
"""Width of a figure on an A4 page with margins [inch]."""

_LOOK: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.size": 8.5,
    "axes.titlesize": 9.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 8.5,
    "axes.labelcolor": "#1f2933",
    "axes.edgecolor": "#52606d",
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#d9dee4",
    "grid.linewidth": 0.5,
    "xtick.color": "#52606d",
    "ytick.color": "#52606d",
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "lines.linewidth": 1.1,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "agg.path.chunksize": 10000,
}


@contextmanager
def look() -> Iterator[None]:
    """Draw in this style, whatever the user's own settings are, and without a screen."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.use("agg", force=False)
        mpl.rcParams.update(_LOOK)
        yield


def shade_wall(axes: Axes, label: str = "") -> None:
    """Shade what is inside the wall, below zero; call it when the limits are final."""
    low, high = axes.get_ylim()
    if low < 0.0:
        axes.axhspan(low, min(0.0, high), color=WALL, zorder=0, lw=0)
        axes.axhline(0.0, color=GREY, lw=0.7, zorder=1)
        axes.set_ylim(low, high)
        if label:
            axes.text(0.99, 0.04, label, transform=axes.transAxes, ha="right", va="bottom", color=GREY, fontsize=7.5)


def limits(axes: Axes, values: Any, margin: float = 0.08) -> None:
    """Vertical limits that leave some air around what is finite."""
    finite = np.asarray(values)[np.isfinite(values)]
    low, high = float(finite.min()), float(finite.max())
    air = (high - low or abs(high) or 1.0) * margin
    axes.set_ylim(low - air, high + air)
