"""The figure of docs/your-simulator.md: `python -m tests.your_simulator.figure docs/your-simulator.svg`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from hapticd.figures import style
from hapticd.figures.picture import save
from tests.your_simulator.coupling import TICK_S, coupled, plain

RATES_HZ = (60, 200, 500)
DURATION_S = 4.0
COLUMN_TICKS = 10
WIDTH_IN = 7.0
HEIGHT_IN = 3.6


def draw(path: Path) -> None:
    """Draw the force on the hand along x: without hapticd above, with it below, a column a rate."""
    with style.applied():
        figure, grid = style.figure(WIDTH_IN, HEIGHT_IN, 2, len(RATES_HZ), sharex=True, sharey=True)
        for column, rate_hz in enumerate(RATES_HZ):
            above, below = grid[0][column], grid[1][column]
            above.set_title(f"simulator at {rate_hz} Hz")
            _curve(above, plain(rate_hz, DURATION_S).force_n[:, 0], style.RED)
            _curve(below, coupled(rate_hz, DURATION_S).force_n[:, 0], style.BLUE)
            below.set_xlabel("time [s]")
        grid[0][0].set_ylabel("plain: force [N]")
        grid[1][0].set_ylabel("hapticd: force [N]")
        save(figure, path)


def _curve(axes: Axes, force_n: npt.NDArray[np.float64], colour: str) -> None:
    """A curve whose swings are all seen: of each 10 ms its least and its largest."""
    columns = force_n.reshape(-1, COLUMN_TICKS)
    ends = np.stack([columns.min(axis=1), columns.max(axis=1)], axis=1)
    axes.plot(np.repeat(np.arange(len(columns)), 2) * COLUMN_TICKS * TICK_S, ends.ravel(), color=colour, lw=0.7)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
