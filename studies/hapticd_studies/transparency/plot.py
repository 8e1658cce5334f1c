"""The pictures: the laws side by side, a panel a question; and one device under its hand, over time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from hapticd.figures import style
from hapticd.figures.picture import encoded
from hapticd_studies.transparency.report import TransparencyReport
from hapticd_studies.transparency.summary import LawSummary

_GROUPS = (("no delay", style.BLUE, "o", 0.14), ("late", style.ORANGE, "D", -0.14))
_LEGEND = ("no delay", "one or two samples of force delay")
Value = Callable[[LawSummary], float]


def draw(report: TransparencyReport) -> bytes:
    """The study as a PNG file: a row a law, a panel a question."""
    laws = report.summaries["all"]
    with style.applied():
        figure = style.blank(11.0, 1.5 + 0.31 * len(laws))
        panels = figure.subplots(1, 6, sharey=True)
        _dots(panels[0], report, lambda one: 100.0 * (1.0 - one.held), "Not held [%]", zero=0.1)
        _dots(panels[1], report, lambda one: one.felt, "Felt at rest [threshold]", bar=1.0)
        _dots(panels[2], report, lambda one: one.settles_hard, "Settling, hard\n[best damper]", bar=1.0)
        _dots(panels[3], report, lambda one: one.work_over_leak, "Work of the law\n[leak]", zero=0.01, bar=1.0)
        _dots(panels[4], report, lambda one: 100.0 * one.error[2], "Force error while\nthe hand eases [%]", zero=0.1)
        _dots(panels[5], report, lambda one: 100.0 * one.exits_felt, "Exits with a felt\npull [%]", zero=0.1)
        rows = np.arange(len(laws))[::-1]
        panels[0].set_yticks(rows, [_label(one.law) for one in laws])
        panels[0].set_ylim(-0.7, len(laws) - 0.3)
        for panel in panels:
            panel.tick_params(axis="y", length=0.0)
        handles = [
            Line2D([], [], linestyle="none", marker=marker, color=colour, markersize=5.0, label=label)
            for label, (_, colour, marker, _) in zip(_LEGEND, _GROUPS, strict=True)
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
        return encoded(figure, ".png")


def draw_one(title: str, time_s: Any, runs: Sequence[tuple[str, Any, Any]]) -> bytes:
    """One device under its hand.

    Args:
        title: what it is.
        time_s: of the samples.
        runs: of each law its label, true position and force.
    """
    with style.applied():
        figure, axes = style.figure(7.2, 5.2, 2, 1, sharex=True)
        above, below = axes[0][0], axes[1][0]
        for at, (label, x_m, force_n) in enumerate(runs):
            colour = style.SERIES[at % len(style.SERIES)]
            above.plot(time_s[: len(x_m)], x_m * 1e3, color=colour, linewidth=0.9)
            below.plot(time_s[: len(x_m)], force_n, color=colour, linewidth=0.8, label=label)
        above.set_ylabel("Position [mm]")
        below.set_ylabel("Force of the wall [N]")
        below.set_xlabel("Time [s]")
        above.set_title(title, loc="left")
        figure.legend(*below.get_legend_handles_labels(), loc="outside lower center", ncols=4)
        return encoded(figure, ".png")


def _dots(
    panel: Axes, report: TransparencyReport, value: Value, label: str, zero: float = 0.0, bar: float | None = None
) -> None:
    """One value of every law, on a logarithmic axis; what is less than `zero` stands there as 0."""
    found = []
    for name, colour, marker, above in _GROUPS:
        summaries = report.summaries[name]
        rows = np.arange(len(summaries))[::-1] + above
        values = [value(one) for one in summaries]
        known = [(max(v, zero), row) for v, row in zip(values, rows, strict=True) if math.isfinite(v)]
        found += [v for v, _ in known]
        panel.plot(
            *(zip(*known, strict=True) if known else ((), ())),
            linestyle="none",
            marker=marker,
            color=colour,
            markersize=4.5,
        )
        for v, row in zip(values, rows, strict=True):
            if v == math.inf:
                panel.text(
                    0.98,
                    row,
                    "never",
                    transform=panel.get_yaxis_transform(),
                    ha="right",
                    va="center",
                    fontsize=7.0,
                    color=colour,
                )
    panel.set_xscale("log")
    low, high = (min(found), max(found)) if found else (1.0, 1.0)
    low, high = zero or low / 1.5, max(high, 10.0 * (zero or low / 1.5))
    panel.set_xlim(low / 1.6, high * 1.8)
    decades = [10.0**at for at in range(-6, 7) if low * 1.001 < 10.0**at < high * 1.8]
    panel.set_xticks([zero, *decades] if zero else decades, ["0"] * bool(zero) + [f"{at:g}" for at in decades])
    panel.minorticks_off()
    if bar is not None:
        panel.axvline(bar, color=style.INK, linewidth=0.9, linestyle=(0, (5, 3)))
    panel.set_xlabel(label)


def _label(law: str) -> str:
    return law.replace("damping_n_s_per_m=", "").replace(":", ", ")
