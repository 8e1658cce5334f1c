"""The picture of the study: what a device holds in every direction, and along two cuts."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from hapticd.figures import style
from hapticd.figures.picture import encoded
from hapticd_studies.space.study import TILTS, TURNS, SpaceFindings, look

_CUT_DEG = np.linspace(-90.0, 90.0, 61)


def draw(found: SpaceFindings) -> bytes:
    """The picture as a PNG file."""
    with style.applied():
        figure, axes = style.figure(9.4, 3.9, 1, 2, width_ratios=(1.15, 1.0))
        everywhere, cut = axes[0]
        _map(everywhere, found)
        _cut(cut, found)
        return encoded(figure, ".png")


def _map(panel: Axes, found: SpaceFindings) -> None:
    held = 1e-3 * np.array([each.exact_n_per_m for each in found.directions]).reshape(TURNS, TILTS)
    held = np.vstack([held, held[:1, ::-1]])  # half a turn on, the same line seen from below
    turns = np.linspace(0.0, 180.0, TURNS + 1)
    tilts = np.linspace(-90.0, 90.0, TILTS)
    shown = panel.contourf(turns, tilts, held.T, levels=12, cmap="cividis")
    figure: Any = panel.figure
    figure.colorbar(shown, ax=panel, label="held stiffness [kN/m]")
    for which, marker, place in ((found.weakest, "v", "weakest"), (found.strongest, "^", "strongest")):
        panel.plot(
            which.turn_deg,
            which.tilt_deg,
            marker,
            color="white",
            markeredgecolor=style.INK,
            markersize=9,
            clip_on=False,
            linestyle="none",
            label=f"{place}, {1e-3 * which.exact_n_per_m:.3g}",
        )
    panel.set(
        xlabel="normal, from x towards y [deg]",
        ylabel="normal, up from there [deg]",
        title="A plane that faces any way",
        xticks=range(0, 181, 30),
        yticks=range(-90, 91, 30),
    )
    panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2)


def _cut(panel: Axes, found: SpaceFindings) -> None:
    """Upright, through the strongest direction."""
    turn_deg = found.strongest.turn_deg
    line = [look(found.loop, turn_deg, float(tilt)) for tilt in _CUT_DEG]
    panel.plot(_CUT_DEG, [1e-3 * each.exact_n_per_m for each in line], color=style.BLUE, label="held, exactly")
    panel.plot(
        _CUT_DEG, [1e-3 * each.estimate_n_per_m for each in line], "--", color=style.ORANGE, label="2 b_n / T, no delay"
    )
    panel.plot(
        _CUT_DEG, [1e-3 * each.passive_n_per_m for each in line], ":", color=style.RED, label="passive, no delay"
    )
    panel.axhline(1e-3 * found.sticking_n_per_m, color=style.SLATE, lw=1.0, label="held where friction sticks")
    panel.set(
        xlabel=f"normal, up at {turn_deg:g} deg [deg]",
        ylabel="stiffness [kN/m]",
        title="Through the strongest direction",
        xticks=range(-90, 91, 30),
    )
    panel.set_ylim(bottom=0.0)
    panel.legend(loc="lower center")
