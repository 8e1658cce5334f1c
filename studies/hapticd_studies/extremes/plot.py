"""The picture: where the places lie and what becomes of their loops, and how well the books balance."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from hapticd.figures import style
from hapticd.figures.picture import encoded
from hapticd_studies.extremes.case import draw as draw_place
from hapticd_studies.extremes.report import ExtremesReport
from hapticd_studies.extremes.sweep import BALANCE_SHARE
from hapticd_studies.extremes.verdict import Verdict

_COLOURS = {Verdict.STABLE: style.BLUE, Verdict.MARGINAL: style.SAND, Verdict.UNSTABLE: style.GREY}
_LEAST = 1e-20
"""Where an error of nothing stands on a logarithmic axis."""


def draw(report: ExtremesReport) -> bytes:
    """The study as a PNG file."""
    with style.applied():
        figure, axes = style.figure(10.5, 4.8, 1, 2, width_ratios=(1.25, 1.0))
        _map(axes[0][0], report)
        _books(axes[0][1], report)
        figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside lower left", ncols=5, markerscale=6.0)
        return encoded(figure, ".png")


def _map(panel: Axes, report: ExtremesReport) -> None:
    places = [draw_place(report.plan.seed, index) for index in range(report.plan.count)]
    stiffness = np.array([one.stiffness_n_per_m * one.period_s**2 / one.mass_kg for one in places])
    damping = np.array(
        [(one.viscous_n_s_per_m + one.wall_damping_n_s_per_m) * one.period_s / one.mass_kg for one in places]
    )
    exact = report.column("exact")
    for verdict in Verdict:
        chosen = (exact == verdict) & (damping > 0.0)
        panel.plot(
            stiffness[chosen],
            damping[chosen],
            linestyle="none",
            marker=".",
            markersize=0.8,
            color=_COLOURS[verdict],
            label=verdict.words,
            rasterized=True,
        )
    wrong = sorted({index for index, _ in report.disagreements})
    if wrong:
        panel.plot(
            stiffness[wrong], np.abs(damping[wrong]), linestyle="none", marker="x", color=style.RED, label="disagrees"
        )
    panel.set_xscale("log")
    panel.set_yscale("log")
    ends = np.array([stiffness.min(), stiffness.max()])
    panel.plot(ends, ends / 2.0, color=style.INK, linewidth=1.0, label="K = 2b/T")
    panel.set_xlim(*ends)
    panel.set_ylim(damping[damping > 0.0].min(), damping.max())
    panel.set_xlabel("Stiffness [m/T²]")
    panel.set_ylabel("Damping of device and wall [m/T]")
    judged = int(np.sum(~np.isnan(exact)))
    panel.set_title(f"{judged} linear loops, {len(report.disagreements)} disagreements", loc="left")


def _books(panel: Axes, report: ExtremesReport) -> None:
    edges = np.geomspace(_LEAST, 10.0, 64)
    for name, label, colour in (
        ("balance", "all books", style.BLUE),
        ("wall_balance", "the wall's", style.ORANGE),
        ("ledger", "the ledger's sums", style.SERIES[2]),
    ):
        values = report.column(name)
        values = np.maximum(values[~np.isnan(values)], _LEAST * 1.01)
        panel.hist(values, edges.tolist(), histtype="step", color=colour, label=label, linewidth=1.4)
    panel.axvline(BALANCE_SHARE, color=style.INK, linewidth=0.9, linestyle=(0, (5, 3)))
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xlabel("Residual, as a share of what went through; left end: none")
    panel.set_ylabel("Runs")
    beyond = int(np.sum(report.column("balance") > BALANCE_SHARE))
    panel.set_title(f"Energy books; {beyond} beyond the line", loc="left")
    panel.legend(loc="upper right")
