"""One quantity of one run, or of several over each other, in one set of axes.

A run alone is shown whole, with what was measured and asked for; of several, each has a colour and a dash.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from hapticd.figures import style
from hapticd.figures.curves import Array, Curves

SMOOTHED_S = 0.02
"""The displayed stiffness is that of mean force over mean depth in this time [s]."""

_DASHES: Sequence[Any] = ("-", (0, (4, 1.5)), (0, (1, 1)), (0, (6, 1.5, 1, 1.5)))
_AIM: dict[str, Any] = {"color": style.INK, "linewidth": 0.8, "linestyle": (0, (5, 3))}
_END: dict[str, Any] = {"marker": "v", "linestyle": "none", "markersize": 3.4, "mec": "white", "mew": 0.3, "zorder": 5}
_MOST_VECTORS = 20_000


def hand(at: int) -> dict[str, Any]:
    """Colour and dash of the run at a place among several."""
    return {"color": style.SERIES[at % len(style.SERIES)], "linestyle": _DASHES[at // len(style.SERIES) % len(_DASHES)]}


def position(axes: Axes, runs: Sequence[Curves]) -> None:
    """Where the device is, the wall shaded, and where it should rest."""
    if len(runs) == 1 and "x_measured_m" in runs[0]:
        axes.plot(*runs[0].line("x_measured_m", 1e3), color=style.ORANGE, linewidth=0.7, label="measured")
    for at, run in enumerate(runs):
        label = "true" if "x_measured_m" in run else "measured"
        axes.plot(*run.line("x_m", 1e3), **hand(at), label=label if len(runs) == 1 else run.name)
    _aims(axes, [run.rest_m * 1e3 for run in runs], "balance")
    axes.set_ylabel("position [mm]")
    if any(run.inside.any() for run in runs):
        style.shade_wall(axes)


def force(axes: Axes, runs: Sequence[Curves]) -> None:
    """The force on the device, and what wall and law asked for where that was another one."""
    told = len(runs) == 1 and "force_requested_n" in runs[0]
    differs = told and bool((runs[0]["force_requested_n"] != runs[0]["force_n"]).any())
    if differs:
        axes.plot(*runs[0].line("force_requested_n"), color=style.ORANGE, linewidth=0.7, label="asked for")
    for at, run in enumerate(runs):
        alone = "applied" if differs else ""
        axes.plot(*run.line("force_n"), **hand(at), label=alone if len(runs) == 1 else run.name)
    axes.set_ylabel("force [N]")


def energy(axes: Axes, runs: Sequence[Curves]) -> None:
    """Energy into the walls, with the ends of the first wall's cycles."""
    marked = False
    for at, run in enumerate(runs):
        if "energy_j" not in run:
            continue
        axes.plot(*run.line("energy_j", 1e3), **hand(at), label="" if len(runs) == 1 else run.name)
        if "cycle" in run:
            ends = run.cycle_ends()
            colour = style.ORANGE if len(runs) == 1 else hand(at)["color"]
            axes.plot(run["t_s"][ends], run["energy_j"][ends] * 1e3, color=colour, **_END)
            marked = marked or len(ends) > 0
    if marked:
        axes.plot([], [], color=style.ORANGE if len(runs) == 1 else style.SLATE, **_END, label="end of a cycle")
    axes.axhline(0.0, color=style.SLATE, linewidth=0.7, zorder=1)
    axes.set_ylabel("energy [mJ]")


def damping(axes: Axes, runs: Sequence[Curves]) -> None:
    """Damping of the law on the first wall."""
    for at, run in enumerate(runs):
        if "damping_n_s_per_m" in run:
            time_s, values = run.line("damping_n_s_per_m")
            axes.plot(time_s, values, **hand(at), drawstyle="steps-post", label="" if len(runs) == 1 else run.name)
    axes.axhline(0.0, color=style.SLATE, linewidth=0.7, zorder=1)
    axes.set_ylabel("damping [N s/m]")


def stiffness(axes: Axes, runs: Sequence[Curves]) -> None:
    """Force over depth in contact, smoothed over 20 ms, and what was commanded; a run alone tick by tick as well."""
    highest = 0.0
    for at, run in enumerate(runs):
        shown = displayed_stiffness_n_per_m(run, SMOOTHED_S) * 1e-3
        if len(runs) == 1:
            each = displayed_stiffness_n_per_m(run, 0.0) * 1e-3
            axes.plot(*run.drawn(each), color=style.ORANGE, linewidth=0.5, label="tick by tick")
        label = f"over {SMOOTHED_S * 1e3:g} ms" if len(runs) == 1 else run.name
        axes.plot(*run.drawn(shown), **hand(at), label=label)
        known = shown[np.isfinite(shown)]
        if len(known):
            highest = max(highest, 1.15 * float(np.quantile(known, 0.95)))
        highest = max(highest, 1.25e-3 * np.nan_to_num(run.stiffness_n_per_m))
    _aims(axes, [run.stiffness_n_per_m * 1e-3 for run in runs], "commanded")
    axes.set_ylim(0.0, highest or 1.0)
    axes.set_ylabel("displayed stiffness [kN/m]")


def loop(axes: Axes, runs: Sequence[Curves]) -> None:
    """Force over depth: what lies between the way in and the way out is energy taken or made."""
    for at, run in enumerate(runs):
        near = run["x_m"] < 0.2 * max(-run["x_m"].min(), 1e-5)
        depth_mm, force_n = np.where(near, -run["x_m"], np.nan) * 1e3, run["force_n"]
        name = "" if len(runs) == 1 else run.name
        axes.plot(depth_mm, force_n, **hand(at), linewidth=0.6, label=name, rasterized=len(force_n) > _MOST_VECTORS)
        deepest_m = max(0.0, -float(run["x_m"].min()))
        if np.isfinite(run.stiffness_n_per_m):
            spring_n = run.stiffness_n_per_m * deepest_m
            axes.plot([0.0, deepest_m * 1e3], [0.0, spring_n], **_AIM, zorder=1, label="" if at else "spring")
    axes.set_xlabel("depth [mm]")
    axes.set_ylabel("force [N]")


def lateness(axes: Axes, runs: Sequence[Curves]) -> None:
    """How late ticks started, as a histogram on logarithmic axes; the latest one is always to be seen."""
    latest = max([float(run["late_us"].max()) for run in runs if "late_us" in run], default=1.0)
    edges = np.concatenate(([0.0], np.geomspace(1.0, max(latest, 10.0) * 1.1, 60)))
    for at, run in enumerate(runs):
        if "late_us" not in run:
            continue
        late_us = np.maximum(run["late_us"], 0.0)
        share = np.histogram(late_us, edges)[0] / len(late_us)
        label = f"{'' if len(runs) == 1 else run.name + ': '}99.9 % below {np.quantile(late_us, 0.999):.0f} µs"
        axes.stairs(share, np.maximum(edges, 0.8), **hand(at), linewidth=1.1, label=label)
        axes.plot(late_us.max(), 1.0 / len(late_us), marker="o", markersize=3.4, color=hand(at)["color"])
    axes.set_xscale("log")
    axes.set_yscale("log")
    style.plain_ticks(axes.xaxis, (1.0,))
    style.plain_ticks(axes.yaxis, (1.0,))
    axes.set_xlabel("late [µs]; the dot: the latest tick")
    axes.set_ylabel("share of ticks")


def displayed_stiffness_n_per_m(run: Curves, over_s: float) -> Array:
    """Force over depth tick by tick, both means over a time at the wall; NaN off it and without force [N/m]."""
    inside = run.held & (run["x_m"] < 0.0)
    kernel = np.ones(min(len(inside), max(1, round(over_s / run.period_s))))
    count = len(inside)
    force_n = np.convolve(np.where(inside, run["force_n"], 0.0), kernel)[:count]
    depth_m = np.convolve(np.where(inside, -run["x_m"], 0.0), kernel)[:count]
    over: Array = np.divide(force_n, depth_m, out=np.full(count, np.nan), where=inside & (depth_m > 1e-7))
    return over


def _aims(axes: Axes, levels: Sequence[float], label: str) -> None:
    """A dashed line at each level that is known."""
    for at, level in enumerate(sorted({level for level in levels if np.isfinite(level)})):
        axes.axhline(level, **_AIM, label="" if at else label)
