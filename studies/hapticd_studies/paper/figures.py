"""The paper's own figures, drawn from our runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hapticd.figures import sheets
from hapticd.figures.style import figure as sheet
from hapticd.figures.style import shade_wall
from hapticd_studies.paper.claims import HELD, OFF_COUNT, SHOWN_S, Evidence
from hapticd_studies.paper.experiments import SMOOTHED_SAMPLES
from hapticd_studies.paper.recording import Array, Recording
from hapticd_studies.paper.style import BLUE, GREEN, GREY, ORANGE, PURPLE, RED, WIDTH_IN, limits

_MARK = {"marker": "v", "ls": "none", "ms": 4.0, "mec": "white", "mew": 0.4, "zorder": 5}


def loop(evidence: Evidence) -> Figure:
    """Fig. 1: the held force over the displacement of one press and release."""
    run = evidence.runs["fig1"]
    figure, grid = sheet(WIDTH_IN, 3.0, 1, 2, width_ratios=(1.6, 1.0))
    for axes, close in zip(grid[0], (False, True), strict=True):
        touched = np.flatnonzero(run.force_n > 0.0)
        path = slice(int(touched[0]), int(touched[-1]) + 2)
        depth_mm, force_n = -run.x_m[path] * 1e3, run.force_n[path]
        turn = int(np.argmax(depth_mm))
        for part, colour, label in (
            (slice(0, turn + 1), GREEN, "press: stored"),
            (slice(turn, None), RED, "release: given back"),
        ):
            # A force is held until the next sample: first the way, then the step.
            axes.step(depth_mm[part], force_n[part], where="post", color=colour, label=label)
        deepest = np.array([0.0, float(depth_mm.max())])
        axes.plot(deepest, run.scenario.stiffness_n_per_m * deepest * 1e-3, color=GREY, lw=0.8, ls="--", label="spring")
        axes.set_xlabel("depth [mm]")
        if close:
            axes.set_xlim(0.85 * deepest[1], 1.01 * deepest[1])
            axes.set_ylim(0.85 * force_n.max(), 1.02 * force_n.max())
    grid[0, 0].set_ylabel("force [N]")
    grid[0, 0].legend(loc="upper left")
    return figure


def leak(evidence: Evidence) -> Figure:
    """Fig. 3: position, power and energy of a wall without a controller."""
    run = evidence.runs["fig3"]
    figure, grid = sheet(WIDTH_IN, 5.6, 3, sharex=True)
    position, power, energy = grid[:, 0]
    shown = run.t_s <= 1.0
    t_s = run.t_s[shown]
    _position(position, run, shown)
    flow_w = run.flow_j()[shown] / run.period_s
    power.fill_between(t_s, flow_w, 0.0, where=flow_w > 0.0, color=GREEN, alpha=0.75, lw=0, label="storing")
    power.fill_between(t_s, flow_w, 0.0, where=flow_w < 0.0, color=RED, alpha=0.75, lw=0, label="releasing")
    power.set_ylabel("power into\nthe wall [W]")
    power.legend(loc="upper left", ncol=2)
    _energy(energy, run, shown)
    ends = [0, *(end for end in run.cycle_ends(2) if shown[end])]
    for before, end in pairwise(ends):
        levels = run.energy_j[[before, end]] * 1e3
        energy.plot([run.t_s[before], run.t_s[end]], [levels[0]] * 2, color=PURPLE, lw=0.6, ls=":")
        energy.plot([run.t_s[end]] * 2, levels, color=PURPLE, lw=2.0, solid_capstyle="butt")
    energy.plot([], [], color=PURPLE, lw=2.0, label="generated in the cycle")
    energy.legend(loc="lower left")
    energy.set_xlabel("time [s]")
    return figure


def converging(evidence: Evidence) -> Figure:
    """Fig. 6: position, energy and damping of an undamped mass, sets 1 and 2."""
    figure, grid = sheet(WIDTH_IN, 5.8, 3, 2, sharex=True, sharey="row")
    sets = (
        [("fig6-set1", BLUE, "")],
        [("fig6-set2-wall", BLUE, "active wall"), ("fig6-set2-device", ORANGE, "active device")],
    )
    titles = ("set 1: undamped", "set 2: −1 N s/m from 0.2 s on")
    for column, (runs, title) in enumerate(zip(sets, titles, strict=True)):
        for name, colour, label in runs:
            run = evidence.runs[name]
            shown = run.t_s <= 1.5
            _position(grid[0, column], run, shown, colour, label)
            _energy(grid[1, column], run, shown, colour)
            _damping(grid[2, column], run, shown, colour)
        grid[0, column].set_title(title)
        grid[2, column].set_xlabel("time [s]")
    for axes in grid[:, 1]:
        axes.axvline(0.2, color=GREY, lw=0.8, ls="--")
    grid[0, 1].legend(loc="lower right", ncol=2)
    _outer_labels(grid)
    return figure


def without_window(evidence: Evidence) -> Figure:
    """Fig. 7: false cycles and what they do, with and without the window, in two readings."""
    names = ("fig7", "fig7-literal", "fig7-literal-window")
    titles = ("as shipped\nno window", "E_tot, no cap\nno window", "E_tot, no cap\nwindow 2+2")
    figure, grid = sheet(WIDTH_IN, 5.8, 3, 3)
    for column, (name, title) in enumerate(zip(names, titles, strict=True)):
        run = evidence.runs[name]
        shown = run.t_s <= 1.0
        _position(grid[0, column], run, shown)
        grid[0, column].set_title(title)
        close = (run.t_s >= 0.4) & (run.t_s <= 0.44)
        energy = grid[1, column]
        level_j = run.energy_j[close].mean()
        energy.plot(run.t_s[close], (run.energy_j[close] - level_j) * 1e3, color=BLUE, marker=".", ms=2.5)
        for window, colour, label in ((1, RED, "sign of power changes"), (2, GREEN, "accepted by 2+2")):
            ends = [end for end in run.cycle_ends(window) if close[end]]
            energy.plot(run.t_s[ends], (run.energy_j[ends] - level_j) * 1e3, color=colour, label=label, **_MARK)
        energy.set_ylabel("energy,\nless its mean [mJ]")
        damping = grid[2, column]
        _damping(damping, run, shown)
        damping.set_yscale("symlog", linthresh=10.0)
        damping.set_ylim(0.0, 1e6)
        damping.set_yticks([0, 10, 1e3, 1e5])
        for axes in grid[:, column]:
            axes.set_xlabel("time [s]")
    _same_height(grid[0])
    figure.legend(*grid[1, 0].get_legend_handles_labels(), loc="outside lower center", ncol=2)
    _outer_labels(grid, keep_x=True)
    return figure


def uncontrolled(evidence: Evidence) -> Figure:
    """Fig. 8: position and energy at 12 kN/m without a law."""
    run = evidence.runs["fig8"]
    figure, grid = sheet(WIDTH_IN, 3.6, 2, sharex=True)
    position, energy = grid[:, 0]
    shown = run.t_s <= 2.0
    _position(position, run, shown)
    _energy(energy, run, shown)
    ends = [end for end in run.cycle_ends(2) if shown[end]]
    energy.plot(run.t_s[ends], run.energy_j[ends] * 1e3, color=PURPLE, label="cycle ends", **_MARK)
    energy.legend(loc="lower left")
    energy.set_xlabel("time [s]")
    return figure


def controlled(evidence: Evidence) -> Figure:
    """Fig. 9: position, energy, damping and force at 12, 18 and 20 kN/m."""
    runs = [evidence.runs[name] for name in HELD]
    named = [replace(run.curves, name=f"{run.scenario.stiffness_n_per_m * 1e-3:g} kN/m") for run in runs]
    return sheets.controlled([curves.between(0.0, sheets.FIG9_S) for curves in named])


def passivity_control(evidence: Evidence) -> Figure:
    """Fig. 10: TDPA at 12 kN/m: unbounded with either observer, and bounded."""
    drawn = (
        ("fig10", "unbounded, exact observer"),
        ("fig10-printed", "unbounded, printed observer"),
        ("fig10-bounded", "bounded"),
    )
    figure, grid = sheet(WIDTH_IN, 7.0, 4, 3, sharex=True)
    for column, (name, title) in enumerate(drawn):
        run = evidence.runs[name]
        shown = run.t_s <= 2.0
        _position(grid[0, column], run, shown)
        grid[0, column].set_title(title)
        _energy(grid[1, column], run, shown)
        _damping(grid[2, column], run, shown)
        grid[2, column].set_yscale("symlog", linthresh=10.0)
        grid[2, column].set_ylim(0.0, 1e6)
        grid[2, column].set_yticks([0, 10, 1e3, 1e5])
        _force(grid[3, column], run, shown)
        grid[3, column].set_xlabel("time [s]")
    for row in (0, 3):
        _same_height(grid[row])
    _outer_labels(grid)
    return figure


def displayed_stiffness(evidence: Evidence) -> Figure:
    """Fig. 11: force over true depth tick by tick, and smoothed as the paper's plot looks."""
    figure, grid = sheet(WIDTH_IN, 4.4, 2, 3, sharex=True, sharey=True)
    for axes, name in zip(grid.flat, (*HELD, *OFF_COUNT), strict=True):
        run = evidence.runs[name]
        stiffness = run.scenario.stiffness_n_per_m
        shown = run.until(SHOWN_S) & run.in_contact
        for samples, colour, label, width in (
            (1, ORANGE, "tick by tick", 0.5),
            (SMOOTHED_SAMPLES, BLUE, f"over {SMOOTHED_SAMPLES} ms", 1.4),
        ):
            over = run.stiffness_n_per_m_over(samples)
            axes.plot(run.t_s[shown], over[shown] * 1e-3, color=colour, lw=width, label=label)
        axes.axhline(stiffness * 1e-3, color=GREY, lw=0.9, ls="--", label="commanded")
        axes.set_title(f"{stiffness * 1e-3:g} kN/m, {-run.scenario.hand_n:g} N")
    grid[0, 0].set_ylim(0.0, 35.0)
    for axes in grid[:, 0]:
        axes.set_ylabel("displayed stiffness\n[kN/m]")
    for axes in grid[1]:
        axes.set_xlabel("time [s]")
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncol=3)
    return figure


def moving(evidence: Evidence) -> Figure:
    """A moving hand: force and damping at 4 and 12 kN/m."""
    names = ("moving-4", "moving-12", "moving-12-ring")
    figure, grid = sheet(WIDTH_IN, 4.4, 2, 3, sharex=True, sharey="row")
    for column, name in enumerate(names):
        run = evidence.runs[name]
        force, damping = grid[:, column]
        force.plot(run.t_s, run.force_n, color=BLUE, lw=0.8, label="applied")
        force.plot(run.t_s, run.spring_n(), color=ORANGE, lw=0.8, label="spring")
        force.set_title(f"{run.scenario.stiffness_n_per_m * 1e-3:g} kN/m, {run.scenario.law}")
        force.margins(x=0.0)
        _damping(damping, run, np.ones(run.ticks, bool))
        damping.set_xlabel("time [s]")
    grid[0, 0].set_ylabel("force [N]")
    grid[0, 0].legend(loc="upper left")
    _outer_labels(grid)
    return figure


def _position(axes: Axes, run: Recording, shown: Array, colour: str = BLUE, label: str = "") -> None:
    axes.plot(run.t_s[shown], run.x_m[shown] * 1e3, color=colour, label=label)
    axes.set_ylabel("position [mm]")
    axes.margins(x=0.0)
    shade_wall(axes)


def _energy(axes: Axes, run: Recording, shown: Array, colour: str = BLUE) -> None:
    axes.plot(run.t_s[shown], run.energy_j[shown] * 1e3, color=colour)
    axes.set_ylabel("energy into\nthe wall [mJ]")
    axes.margins(x=0.0)


def _damping(axes: Axes, run: Recording, shown: Array, colour: str = BLUE) -> None:
    axes.plot(run.t_s[shown], run.damping_n_s_per_m[shown], color=colour, drawstyle="steps-post", lw=_thin(run))
    axes.set_ylabel("damping α\n[N s/m]")
    axes.margins(x=0.0)


def _force(axes: Axes, run: Recording, shown: Array) -> None:
    axes.plot(run.t_s[shown], run.force_n[shown], color=BLUE, lw=_thin(run))
    axes.set_ylabel("force [N]")
    axes.axhline(-run.scenario.hand_n, color=GREY, lw=0.8, ls="--")
    axes.margins(x=0.0)


def _thin(run: Recording) -> float:
    """Line width of what changes at every tick."""
    return 0.5 if run.scenario.law == "tdpa" else 1.1


def _same_height(row: Sequence[Axes]) -> None:
    """The same limits for plots that are to be compared."""
    spans = [axes.get_ylim() for axes in row]
    for axes in row:
        limits(axes, [value for span in spans for value in span], margin=0.0)


def _outer_labels(grid: Array, keep_x: bool = False) -> None:
    """Keep the labels of the first column, and of the last row."""
    for axes in grid[:, 1:].flat:
        axes.set_ylabel("")
    if not keep_x:
        for axes in grid[:-1].flat:
            axes.set_xlabel("")
