"""A replay on paper: its columns in a file, and one figure of all laws."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np

from hapticd.errors import ConfigError, HapticdError
from hapticd.offline.plot import GRID, INK
from hapticd_views.recording.output import part_of
from hapticd_views.replay.replay import Replay

FIGURES = (".png", ".svg", ".pdf")
TABLES = (".csv", ".npz")

_PANELS = (
    ("x_m", "position [mm]", 1e3),
    ("force_n", "force [N]", 1.0),
    ("energy_j", "energy into the walls [mJ]", 1e3),
)


def check(output: Path) -> None:
    """Refuse what no replay is written to, before the work.

    Raises:
        ConfigError: the suffix is not known.
    """
    if output.suffix not in (*FIGURES, *TABLES):
        raise ConfigError(f"{output}: must end in {', '.join((*TABLES, *FIGURES))}")


def write(replay: Replay, output: Path, overwrite: bool) -> None:
    """Write the columns (.csv, .npz) or the figure (.png, .svg, .pdf).

    Raises:
        ConfigError: it cannot be written there.
        HapticdError: matplotlib is not installed, or the disk is full.
    """
    check(output)
    with part_of(output, overwrite) as part:
        if output.suffix == ".npz":
            with part.open("xb") as file:
                np.savez(file, allow_pickle=False, **replay.columns)
        elif output.suffix == ".csv":
            columns = replay.columns
            with part.open("x", encoding="utf-8", newline="") as text:
                writer = csv.writer(text, lineterminator="\n")
                writer.writerow(columns)
                writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))
        else:
            figure(replay).savefig(part, format=output.suffix[1:], dpi=160)


def figure(replay: Replay) -> Any:
    """Position, force and energy over time, every law over what was recorded.

    Raises:
        HapticdError: matplotlib is not installed.
    """
    try:
        from matplotlib import colormaps
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise HapticdError("a figure needs matplotlib: pip install 'hapticd[study]'") from None
    columns = replay.columns
    found = Figure(figsize=(8.0, 8.0), layout="constrained")
    found.suptitle(f"{replay.file.name}: the hand's {replay.hand} replayed", color=INK)
    panels = found.subplots(len(_PANELS), 1, sharex=True)
    colours = colormaps["tab10"].colors  # type: ignore[attr-defined]  # a listed map has them
    for panel, (name, label, scale) in zip(panels, _PANELS, strict=True):
        for at, trace in enumerate(replay.traces):
            first = at == 0
            panel.plot(
                columns["t_s"],
                columns[f"{trace.law}.{name}"] * scale,
                color=INK if first else colours[(at - 1) % len(colours)],
                linewidth=2.2 if first else 0.9,
                alpha=0.35 if first else 1.0,
                label=trace.law,
            )
        panel.set_ylabel(label)
        panel.grid(color=GRID, linewidth=0.6)
        panel.spines[["top", "right"]].set_visible(False)
    panels[-1].set_xlabel("time [s]")
    found.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=5, frameon=False, fontsize=8)
    return found
