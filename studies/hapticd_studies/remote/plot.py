"""The picture: what stiffness each rate gets, law by law."""

from __future__ import annotations

from hapticd.figures import style
from hapticd.figures.picture import encoded
from hapticd_studies.remote.report import RemoteReport
from hapticd_studies.remote.sweep import DELAYS_S, KINDS

_TITLES = {"tool": "Coupling to a tool on a table", "force": "Wall sent as a raw force"}
_DASHES = ("-", (0, (4, 2)))


def draw(report: RemoteReport) -> bytes:
    """The study as a PNG file: a panel a kind of client, a line a law and delay."""
    with style.applied():
        figure, axes = style.figure(8.0, 4.0, 1, 2, sharey=True)
        for axis, kind in zip(axes[0], KINDS, strict=True):
            found = [reach for reach in report.reaches if reach.kind in (kind, "tamed" if kind == "force" else kind)]
            names = list(dict.fromkeys((reach.kind, reach.law) for reach in found))
            for at, (of, law) in enumerate(names):
                for delay_s, dash in zip(DELAYS_S, _DASHES, strict=True):
                    line = [each for each in found if (each.kind, each.law, each.delay_s) == (of, law, delay_s)]
                    label = "tuned by hand" if of == "tamed" else law
                    axis.plot(
                        [each.rate_hz for each in line],
                        [max(each.shown_n_per_m, 10.0) for each in line],
                        color=style.SERIES[at % len(style.SERIES)],
                        linestyle=dash,
                        marker="o",
                        markersize=3.5,
                        label=label if delay_s == 0.0 else f"{label}, {2e3 * delay_s:g} ms late",
                    )
            axis.set_xscale("log")
            axis.set_yscale("log")
            axis.set_title(_TITLES[kind], loc="left")
            axis.set_xlabel("Rate of the client [Hz]")
        axes[0][0].set_ylabel("Stiffness that is felt [N/m]")
        figure.legend(*axes[0][1].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=7.0)
        return encoded(figure, ".png")
