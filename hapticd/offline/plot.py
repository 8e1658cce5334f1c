"""Pictures of a run, simulated or recorded alike: columns in, a matplotlib figure out."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from hapticd.errors import HapticdError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK, GRID, BLUE, ORANGE, GREY = "#1b1f24", "#d9dde2", "#2f6f9f", "#d9822b", "#a7afb8"


def draw(columns: Mapping[str, Sequence[float]], title: str, rest_m: float = math.nan) -> Figure:
    """Position, force, energy with the ends of its cycles, and damping, one under the other over the same time.

    Args:
        columns: at least t_s, x_m, x_measured_m, force_n, force_requested_n, energy_j, cycle and damping_n_s_per_m.
        title: of the figure.
        rest_m: where the device should rest; NaN: nowhere [m].

    Raises:
        HapticdError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise HapticdError("a plot needs matplotlib: pip install 'hapticd[study]'") from None
    time_s = columns["t_s"]
    figure = Figure(figsize=(7.0, 7.0), layout="constrained")
    figure.suptitle(title, color=INK)
    position, force, energy, damping = figure.subplots(4, 1, sharex=True)
    deepest_m = min(columns["x_m"])
    position.axhspan(min(0.0, deepest_m * 1.05e3), 0.0, color=GRID, label="wall", linewidth=0.0)
    position.plot(time_s, _times(columns["x_measured_m"], 1e3), color=ORANGE, linewidth=0.8, label="measured")
    position.plot(time_s, _times(columns["x_m"], 1e3), color=BLUE, linewidth=1.2, label="true")
    if not math.isnan(rest_m):
        position.axhline(rest_m * 1e3, color=INK, linewidth=0.8, linestyle=(0, (5, 3)), label="balance")
    position.set_ylabel("position [mm]")
    force.plot(time_s, columns["force_requested_n"], color=ORANGE, linewidth=0.8, label="asked for")
    force.plot(time_s, columns["force_n"], color=BLUE, linewidth=1.2, label="applied")
    force.set_ylabel("force [N]")
    energy.plot(time_s, _times(columns["energy_j"], 1e3), color=BLUE, linewidth=1.2)
    ends = [at + 1 for at, (before, after) in enumerate(pairwise(columns["cycle"])) if after != before]
    marks = [columns["energy_j"][at] * 1e3 for at in ends]
    energy.plot([time_s[at] for at in ends], marks, "o", color=ORANGE, markersize=3.0, label="end of a cycle")
    energy.set_ylabel("energy [mJ]")
    damping.plot(time_s, columns["damping_n_s_per_m"], color=BLUE, linewidth=1.2)
    damping.set_ylabel("damping [N s/m]")
    damping.set_xlabel("time [s]")
    for panel in (position, force, energy, damping):
        panel.grid(color=GRID, linewidth=0.6)
        panel.spines[["top", "right"]].set_visible(False)
        if panel is not damping:
            panel.legend(loc="upper right", fontsize=7.5, frameon=False)
    return figure


def inline_image(figure: Figure) -> str:
    """A figure as an HTML image that carries its own data."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=80)
    return f'<img alt="run" src="data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode("ascii")}">'


def _times(values: Sequence[float], factor: float) -> list[float]:
    return [value * factor for value in values]
