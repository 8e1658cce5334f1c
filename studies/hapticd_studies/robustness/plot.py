"""The pictures: who settles, where the law ends, how well it feels the mass; and one device over time."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from hapticd.figures import style
from hapticd.figures.picture import encoded
from hapticd.offline.outcome import Outcome
from hapticd_studies.robustness.devices import WITHIN_REACH
from hapticd_studies.robustness.readings import PAPER, short
from hapticd_studies.robustness.report import RobustnessReport
from hapticd_studies.robustness.sweep import COLUMNS

_GROUPS = (("no delay", style.BLUE, "o", 0.14), ("one sample of force delay", style.ORANGE, "D", -0.14))
_NONE_PERCENT = 0.03
"""Where no failure at all stands on a logarithmic axis [%]."""


def draw(report: RobustnessReport) -> bytes:
    """The study as a PNG file."""
    with style.applied():
        paper = [table for r, table in zip(report.plan.readings, report.tables, strict=True) if r.label == PAPER]
        height_in = 1.6 + 0.24 * len(report.summaries)
        if not paper:
            alone, axes = style.figure(7.0, height_in)
            _failures(axes[0][0], report)
            return encoded(alone, ".png")
        figure = style.blank(10.5, max(6.4, height_in))
        grid = figure.add_gridspec(2, 2, width_ratios=(1.05, 1.0))
        _failures(figure.add_subplot(grid[:, 0]), report)
        _felt_mass(figure.add_subplot(grid[0, 1]), report, paper[0])
        _settling(figure.add_subplot(grid[1, 1]), report, paper[0])
        handles = [
            Line2D([], [], linestyle="none", marker=marker, color=colour, markersize=5.0, label=label)
            for label, colour, marker, _ in _GROUPS
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
        return encoded(figure, ".png")


def draw_one(title: str, time_s: Any, runs: Sequence[tuple[str, Any, Any]], target_m: float) -> bytes:
    """One device over time.

    Args:
        title: what it is.
        time_s: of the samples.
        runs: of each law its label, true position and damping.
        target_m: where it should settle [m].
    """
    with style.applied():
        figure, axes = style.figure(7.2, 5.2, 2, 1, sharex=True)
        above, below = axes[0][0], axes[1][0]
        for at, (label, x_m, damping) in enumerate(runs):
            colour = (style.GREY, style.BLUE)[at] if len(runs) == 2 else style.SERIES[at % len(style.SERIES)]
            above.plot(time_s, x_m * 1e3, color=colour, linewidth=0.9, label=label)
            below.plot(time_s, damping, color=colour, linewidth=1.2)
        above.axhline(target_m * 1e3, color=style.INK, linewidth=0.9, linestyle=(0, (5, 3)), label="balance")
        above.set_ylabel("Position [mm]")
        below.set_ylabel("Damping of the law [N s/m]")
        below.set_xlabel("Time [s]")
        above.set_title(title, loc="left")
        figure.legend(*above.get_legend_handles_labels(), loc="outside lower center", ncols=4)
        return encoded(figure, ".png")


def _failures(panel: Axes, report: RobustnessReport) -> None:
    summaries = report.summaries
    rows = np.arange(len(summaries))[::-1]
    shares = [one.prompt for one in summaries], [one.late for one in summaries]
    for (_, colour, marker, above), group in zip(_GROUPS, shares, strict=True):
        percent = [max(_NONE_PERCENT, 100.0 * (1.0 - share.share)) for share in group]
        panel.plot(percent, rows + above, linestyle="none", marker=marker, color=colour, markersize=5.0)
    panel.set_xscale("log")
    panel.set_xlim(_NONE_PERCENT / 1.5, 150.0)
    panel.set_xticks([_NONE_PERCENT, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0])
    panel.set_xticklabels(["0", "0.1", "0.3", "1", "3", "10", "30", "100"])
    panel.minorticks_off()
    panel.set_yticks(rows, [_label(one.reading) for one in summaries])
    for tick, one in zip(panel.get_yticklabels(), summaries, strict=True):
        tick.set_fontsize(7.5)
        tick.set_fontweight("bold" if ":" not in one.reading else "normal")
    panel.set_ylim(-0.8, len(summaries) - 0.2)
    panel.set_xlabel("Devices within reach that do not settle [%]")
    panel.set_title(f"{len(report.devices)} random devices", loc="left")
    panel.tick_params(axis="y", length=0.0)


def _felt_mass(panel: Axes, report: RobustnessReport, table: np.ndarray[Any, Any]) -> None:
    true_kg = np.array([device.mass_kg for device in report.devices])
    felt_kg = table[:, COLUMNS.index("felt_mass_kg")]
    known = felt_kg > 0.0
    late = np.array([device.delayed for device in report.devices])
    ends = np.array([true_kg.min() * 0.95, true_kg.max() * 1.05])
    panel.plot(ends, ends, color=style.INK, linewidth=0.9)
    for group, (_, colour, marker, _) in zip((~late, late), _GROUPS, strict=True):
        chosen = known & group
        panel.plot(
            true_kg[chosen], felt_kg[chosen], linestyle="none", marker=marker, markersize=2.4, color=colour, alpha=0.6
        )
    panel.set_xlim(ends[0], ends[1])
    panel.set_ylim(0.0, 2.0 * ends[1])
    panel.set_xlabel("True mass, hand included [kg]")
    panel.set_ylabel("Felt mass [kg]")
    felt = report.felt_mass
    if felt and felt.median is not None:
        panel.set_title(f"Felt / true: {felt.median:.2f}, 5-95 % {felt.low:.2f} to {felt.high:.2f}", loc="left")


def _settling(panel: Axes, report: RobustnessReport, table: np.ndarray[Any, Any]) -> None:
    share = 100.0 * np.array([device.peak_share for device in report.devices])
    late = np.array([device.delayed for device in report.devices])
    settled = table[:, 0] == Outcome.SETTLED
    time_s = table[:, COLUMNS.index("settled_s")]
    panel.set_yscale("log")
    panel.set_xscale("log")
    for group, (_, colour, marker, _) in zip((~late, late), _GROUPS, strict=True):
        chosen = settled & group & (time_s > 0.0)
        panel.plot(
            share[chosen], time_s[chosen], linestyle="none", marker=marker, markersize=2.4, color=colour, alpha=0.6
        )
    never = ~settled
    top_s = np.full(int(never.sum()), 9.0)
    panel.plot(share[never], top_s, linestyle="none", marker="x", markersize=5.0, color=style.RED)
    panel.text(0.02, 0.97, f"× {never.sum()} do not settle", color=style.RED, transform=panel.transAxes, va="top")
    panel.axvline(100.0 * WITHIN_REACH, color=style.INK, linewidth=0.9, linestyle=(0, (5, 3)))
    style.plain_ticks(panel.xaxis, (1.0,))
    style.plain_ticks(panel.yaxis)
    panel.set_xlabel("Wall stiffness [% of the damper peak]")
    panel.set_ylabel("Settles within [s]")
    panel.set_title(f"{PAPER} with its defaults", loc="left")


def _label(reading: str) -> str:
    """A reading in a few short lines."""
    name, values = short(reading)
    return textwrap.fill(values if values and name == PAPER else f"{name}, {values}".removesuffix(", "), 38)
