"""Settings of ring-damping beside constant dampers: what excludes what."""

from __future__ import annotations

from collections.abc import Sequence

from hapticd.figures import style
from hapticd.figures.picture import encoded
from hapticd_studies.targets.report import Traded

_RING = (
    "",
    ":pull_after=0",
    ":pull_after=2",
    ":least_brake_ratio=0.05",
    ":least_brake_ratio=0.6",
    ":least_brake_ratio=0.6:pull_after=0",
    ":brake_ratio=0.4",
    ":hand_half_period_s=0.02",
    ":hand_half_period_s=0.1",
)
_DAMPERS = ("damper:damping_n_s_per_m=5", "damper:damping_n_s_per_m=20", "damper")
FRONT = ",".join([*(f"ring-damping{one}" for one in _RING), *_DAMPERS])
"""The laws that are drawn, as `--laws` takes them."""


def draw(points: Sequence[Traded]) -> bytes:
    """Settling against damping, and against exits that pull, a PNG file."""
    with style.applied():
        figure, axes = style.figure(10.0, 4.4, 1, 2)
        for panel, label, asked, values in (
            (axes[0][0], "Damping over need, 20 s of hands", 1.1, [one.over_need for one in points]),
            (axes[0][1], "Exits with a pull that is felt [%]", 1.0, [one.pulls_percent for one in points]),
        ):
            for one, value in zip(points, values, strict=True):
                own = one.law.startswith("ring-damping")
                colour = style.BLUE if own else style.ORANGE
                panel.plot(one.settles_hard, value, linestyle="none", marker="o" if own else "D", color=colour)
                panel.annotate(
                    one.law.replace("ring-damping:", "").replace("damping_n_s_per_m=", "").replace("_", " "),
                    (one.settles_hard, value),
                    textcoords="offset points",
                    xytext=(4, 4),
                    fontsize=6.5,
                )
            panel.axhline(asked, color=style.GREY, linewidth=0.9)
            panel.axvline(1.4, color=style.GREY, linewidth=0.9)
            panel.set_xlabel("Settling over the best constant damper's, hard arrival")
            panel.set_ylabel(label)
        axes[0][0].set_yscale("log")
        return encoded(figure, ".png")
