"""Whole figures, by name: panels one under the other over the same time, one panel alone, and the paper's Fig. 9."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hapticd.errors import ConfigError
from hapticd.figures import panels, style
from hapticd.figures.curves import Curves

COLUMN_IN, PAGE_IN = 3.5, 7.2
"""Widths of a figure in one column of a journal, and across the page [inch]."""

FIG9_S = 0.5
"""How much of each run the figure after the paper's Fig. 9 shows [s]."""

Panel = Callable[[Axes, Sequence[Curves]], None]

STACKED: dict[str, tuple[Panel, ...]] = {
    "run": (panels.position, panels.force, panels.energy, panels.damping),
    "position": (panels.position,),
    "force": (panels.force,),
    "energy": (panels.energy,),
    "damping": (panels.damping,),
    "stiffness": (panels.stiffness,),
}
"""Figures over time."""

PLAIN: dict[str, Panel] = {"loop": panels.loop, "lateness": panels.lateness}
"""Figures over something else."""

NAMES = (*STACKED, *PLAIN, "fig9")
"""What `draw` can draw."""

_NEEDED = {"energy": "energy_j", "damping": "damping_n_s_per_m", "lateness": "late_us"}

_PRINT: Any = {
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.5,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 7.5,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.2,
    "legend.borderaxespad": 0.2,
    "lines.linewidth": 1.0,
    "figure.dpi": 300,
    "savefig.dpi": "figure",
    # Names of files, runs and laws are drawn as they are: a $ in one begins no mathematics, and so numbers have none.
    "text.parse_math": False,
    "axes.formatter.use_mathtext": False,
}


def draw(name: str, runs: Sequence[Curves], title: str = "") -> Figure:
    """A figure of one run, or of several over each other.

    Args:
        name: one of `NAMES`.
        runs: at least one.
        title: above it.

    Raises:
        ConfigError: there is no such figure.
        HapticdError: none of the runs has what it shows.
    """
    if name not in NAMES:
        raise ConfigError(f"figure {name!r}: there are {', '.join(NAMES)}")
    needed = _NEEDED.get(name)
    if needed is not None and not any(needed in run for run in runs):
        raise ConfigError(f"{', '.join(run.name for run in runs)}: no column {needed}, which figure {name} shows")
    with printed():
        if name == "fig9":
            return controlled([run.from_contact().between(-0.02, FIG9_S) for run in runs], title)
        runs = [_listed(run) for run in runs]
        if name in PLAIN:
            figure, grid = style.figure(COLUMN_IN, 2.6)
            PLAIN[name](grid[0, 0], runs)
            _name_curves(figure, grid, len(runs))
        else:
            figure = _stacked(STACKED[name], runs)
        if title and len(runs) == 1:
            figure.suptitle(title, fontsize=8.5, fontweight="bold")
        elif title:  # beside the names of the runs there is no room for another line
            figure.legends[0].set_title(title)
            figure.legends[0].get_title().set(fontweight="bold", fontsize=8.5)
        return figure


def printed() -> AbstractContextManager[None]:
    """The style of a figure for print, for as long as one is made."""
    return mpl.rc_context({**style.RC, **_PRINT})


def controlled(runs: Sequence[Curves], title: str = "") -> Figure:
    """The paper's Fig. 9: position, energy, damping and force, a run a column.

    Args:
        runs: each with the stretch that is shown.
        title: above it.
    """
    width_in = COLUMN_IN if len(runs) == 1 else PAGE_IN
    figure, grid = style.figure(width_in, 5.6 if len(runs) == 1 else 6.6, 4, len(runs), sharex=True, sharey="row")
    for column, run in zip(grid.T, runs, strict=True):
        for axes, panel in zip(column, (panels.position, panels.energy, panels.damping, panels.force), strict=True):
            panel(axes, [run])
            axes.margins(x=0.0)
        if run.rest_m == run.rest_m and run.stiffness_n_per_m == run.stiffness_n_per_m:
            column[3].axhline(-run.rest_m * run.stiffness_n_per_m, color=style.INK, lw=0.8, ls=(0, (5, 3)))
        if len(runs) > 1:
            column[0].set_title(run.name)
        column[3].set_xlabel("time [s]")
    for axes in grid[:, 1:].flat:
        axes.set_ylabel("")
    figure.legend(*_named(grid.flat), loc="outside lower center", ncols=3 if len(runs) == 1 else 5)
    figure.align_ylabels(grid[:, 0])
    if title:
        figure.suptitle(title, fontsize=8.5, fontweight="bold")
    return figure


def _listed(run: Curves) -> Curves:
    """A run under a name that a legend shows: matplotlib leaves out one that begins with an underscore."""
    return replace(run, name=f" {run.name}") if run.name.startswith("_") else run


def _stacked(wanted: Sequence[Panel], runs: Sequence[Curves]) -> Figure:
    height_in = 2.6 if len(wanted) == 1 else 1.45 * len(wanted) + 0.4
    figure, grid = style.figure(COLUMN_IN, height_in, len(wanted), sharex=True)
    for axes, panel in zip(grid[:, 0], wanted, strict=True):
        panel(axes, runs)
        axes.margins(x=0.0)
    grid[-1, 0].set_xlabel("time [s]")
    _name_curves(figure, grid, len(runs))
    figure.align_ylabels(grid[:, 0])
    return figure


def _name_curves(figure: Figure, grid: Any, runs: int) -> None:
    """Name the curves above the axes, where the names hide nothing: of one run in place, of several once for all."""
    if runs > 1:
        figure.legend(*_named(grid.flat), loc="outside upper center", ncols=min(runs, 3))
        return
    for axes in grid.flat:
        handles, labels = axes.get_legend_handles_labels()
        if handles:
            axes.legend(handles, labels, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(labels))


def _named(rows: Any) -> tuple[list[Any], list[str]]:
    """Each name of all panels once."""
    found: dict[str, Any] = {}
    for axes in rows:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    return list(found.values()), list(found)
