"""Figures of what one run cannot show: shares over many starts, maps, and the table of readings."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from hapticd.figures.style import figure as sheet
from hapticd.offline.outcome import PRESSED, Criterion
from hapticd_studies.paper.claims import HELD, OFF_COUNT, Evidence
from hapticd_studies.paper.starts import HANDS_N, NATIVE_N_PER_M, NOISES_M, WINDOW_HANDS_N, WINDOW_READINGS
from hapticd_studies.paper.style import BLUE, GREEN, GREY, INK, ORANGE, OUTCOMES, PURPLE, RED, WIDTH_IN
from hapticd_studies.paper.window import window_shares

_COLOURS = (GREEN, BLUE, ORANGE)


def native_limit(evidence: Evidence) -> Figure:
    """Span at the end against stiffness, without a law, a dot a start."""
    shares = evidence.shares
    spans_mm = shares.native.peak_to_peak_m.reshape(len(NATIVE_N_PER_M), len(HANDS_N), -1) * 1e3
    figure, ((axes,),) = sheet(WIDTH_IN, 3.0)
    for row, at in enumerate(np.arange(len(NATIVE_N_PER_M))):
        for hand, (newton, colour) in enumerate(zip(HANDS_N, _COLOURS, strict=True)):
            spread = (np.linspace(-0.1, 0.1, spans_mm.shape[2]) if spans_mm.shape[2] > 1 else 0.0) + 0.25 * (hand - 1)
            label = f"{-newton:g} N" if row == 0 else ""
            axes.plot(at + spread, np.maximum(spans_mm[row, hand], 1e-3), ".", ms=3.0, color=colour, label=label)
    still_mm = Criterion().still_m * 1e3
    axes.axhline(still_mm, color=RED, lw=0.9, ls="--")
    axes.text(-0.45, 1.15 * still_mm, "keeps moving", color=RED, fontsize=7.5)
    axes.axhline(0.01, color=GREY, lw=0.8, ls=":")
    axes.text(2.5, 0.0108, "one count", color=GREY, fontsize=7.5)
    axes.set_yscale("log")
    axes.set_xticks(range(len(NATIVE_N_PER_M)), [f"{k * 1e-3:g}" for k in NATIVE_N_PER_M])
    axes.set_xlim(-0.5, len(NATIVE_N_PER_M) - 0.5)
    axes.grid(axis="x", visible=False)
    axes.set_xlabel("stiffness [kN/m]")
    axes.set_ylabel("span of the last 0.5 s [mm]")
    axes.legend(title="hand", loc="lower right", ncol=3, markerscale=2.5)
    return figure


def tdpa_map(evidence: Evidence) -> Figure:
    """How far the device still moves, over hand force and start, under three laws."""
    shares = evidence.shares
    shape = (len(shares.map_hands_n), len(shares.map_drops_m))
    figure, grid = sheet(WIDTH_IN, 4.9, 2, 3, sharex=True, sharey=True)
    edges = (_edges(shares.map_drops_m * 1e3), _edges(-shares.map_hands_n))
    for column, (name, asked) in enumerate(shares.maps.items()):
        spans_mm = np.clip(asked.peak_to_peak_m.reshape(shape) * 1e3, 1e-3, 1e2)
        spans = grid[0, column].pcolormesh(*edges, spans_mm, norm=LogNorm(3e-3, 30.0), cmap="YlGnBu", rasterized=True)
        grid[1, column].pcolormesh(*edges, asked.outcome.reshape(shape), cmap=OUTCOMES, vmin=-0.5, vmax=3.5)
        grid[0, column].set_title(name)
        grid[1, column].set_xlabel("start above the wall [mm]")
    for axes in grid.flat:
        axes.grid(visible=False)
    for axes in grid[:, 0]:
        axes.set_ylabel("hand force [N]")
    figure.colorbar(spans, ax=grid[0], label="span at the end [mm]", pad=0.01, aspect=14)
    handles = [Patch(color=OUTCOMES(int(outcome)), label=outcome.words) for outcome in PRESSED]
    figure.legend(handles=handles, loc="outside lower center", ncol=4)
    return figure


def window(evidence: Evidence) -> Figure:
    """Share that rests at 12 kN/m over hand and noise, without and with the window, in each reading."""
    shares = window_shares(evidence).mean(axis=0)
    figure, grid = sheet(WIDTH_IN, 3.8, 2, len(WINDOW_READINGS), sharex=True, sharey=True)
    hands_n = -np.array(WINDOW_HANDS_N)
    for column, reading in enumerate(WINDOW_READINGS):
        for row, title in enumerate(("without", "window 2+2")):
            axes = grid[row, column]
            drawn = axes.pcolormesh(
                _edges(hands_n), np.arange(len(NOISES_M) + 1), shares[column, :, row], vmin=0.0, vmax=1.0, cmap="YlGnBu"
            )
            axes.set_yticks(np.arange(len(NOISES_M)) + 0.5, [f"{noise * 1e6:g}" for noise in NOISES_M])
            axes.set_title(f"{reading}\n{title}")
            axes.grid(visible=False)
        grid[1, column].set_xlabel("hand [N]")
    for axes in grid[:, 0]:
        axes.set_ylabel("noise [µm]")
    figure.colorbar(drawn, ax=grid, label="share at rest", pad=0.01, aspect=20)
    return figure


def damping_at_speed(evidence: Evidence) -> Figure:
    """The damping in force against the speed at which it acts: where TDPA goes wrong."""
    figure, ((axes,),) = sheet(WIDTH_IN, 2.9)
    drawn = [("fig10", "TDPA unbounded, exact", RED), ("fig10-bounded", "TDPA, bounded", PURPLE)]
    drawn += [(name, f"energy cycles, {name[-2:]} kN/m", colour) for name, colour in zip(HELD, _COLOURS, strict=True)]
    for name, label, colour in drawn:
        run = evidence.runs[name]
        acting = run.in_contact & (run.damping_n_s_per_m > 0.0) & (run.v_m_per_s != 0.0)
        speed = np.abs(run.v_m_per_s[acting]) * 1e3
        axes.plot(speed, run.damping_n_s_per_m[acting], ".", ms=2.0, color=colour, label=label, rasterized=True)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(1e-2, 1e3)
    axes.set_xlabel("speed [mm/s]")
    axes.set_ylabel("damping in force\n[N s/m]")
    axes.axhline(500.0, color=GREY, lw=0.8, ls="--")
    axes.text(
        *(1.2e-2, 600.0, "2 m/T: a damper alone is unstable above"),
        color=INK,
        fontsize=7.5,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
    )
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), markerscale=4.0)
    return figure


def long_contact(evidence: Evidence) -> Figure:
    """Energy of a long contact, with and without steps of the position."""
    figure, ((all_of_it, motion),) = sheet(WIDTH_IN, 2.8, 1, 2, width_ratios=(1.6, 1.0))
    colours = {"fig9-12-off": GREY, **dict(zip(HELD, _COLOURS, strict=True))}
    for name, run in evidence.long.items():
        stiffness = f"{run.scenario.stiffness_n_per_m * 1e-3:g} kN/m"
        continuous = run.resolution_m == 0.0
        colour = PURPLE if continuous else colours[name]
        style = ":" if continuous and "18" in name else "--" if continuous else "-"
        off = ", 3.03 N" if name in OFF_COUNT else ""
        label = stiffness + (", continuous" if continuous else off)
        all_of_it.plot(run.t_s[::50], run.energy_j[::50] * 1e3, color=colour, ls=style, label=label)
        last = run.t_s >= run.t_s[-1] - 0.2
        if not continuous:
            motion.plot(
                run.t_s[last] - run.t_s[last][0], (run.x_m[last] - run.x_m[last].mean()) * 1e6, color=colour, lw=0.9
            )
    all_of_it.set_xlabel("time [s]")
    all_of_it.set_ylabel("energy into the wall [mJ]")
    all_of_it.legend(loc="lower left")
    motion.set_xlabel("last 0.2 s [s]")
    motion.set_ylabel("position, less its mean [µm]")
    return figure


def readings(evidence: Evidence) -> Figure:
    """Every reading against every scenario."""
    table = evidence.table
    rows = len(table.readings)
    figure, ((axes,),) = sheet(WIDTH_IN, 2.3 + 0.155 * rows)
    axes.pcolormesh(table.outcome, cmap=OUTCOMES, vmin=-0.5, vmax=3.5, edgecolors="white", lw=0.6)
    axes.set_yticks(np.arange(rows) + 0.5, [reading.name for reading in table.readings], fontsize=7.0)
    axes.set_xticks(np.arange(len(table.scenarios)) + 0.5, table.scenarios, rotation=90, fontsize=7.0)
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    axes.set_ylim(rows, 0)
    for row, passed in enumerate(table.passed):
        axes.text(len(table.scenarios) + 0.3, row + 0.5, f"{passed}", va="center", fontsize=7.0, color=_grade(passed))
    if table.single < rows:
        axes.axhline(table.single, color=INK, lw=1.0)
    axes.axvline(4, color=INK, lw=1.0)
    handles = [Patch(color=OUTCOMES(int(outcome)), label=outcome.words) for outcome in PRESSED]
    figure.legend(handles=handles, loc="outside lower center", ncol=4)
    return figure


def _grade(passed: int) -> str:
    return GREEN if passed == 28 else RED if passed < 14 else INK


def _edges(centres: np.ndarray) -> np.ndarray:
    """Edges of cells around these centres, equally far apart."""
    half = 0.5 * (centres[1] - centres[0])
    return np.append(centres - half, centres[-1] + half)
