"""All laws of a replay in one figure: a row a law, what was recorded behind each. Needs the extra `study`."""

from __future__ import annotations

from hapticd.figures import style
from hapticd.figures.curves import Curves
from hapticd.figures.picture import encoded
from hapticd.figures.sheets import PAGE_IN, printed
from hapticd_views.replay.replay import Replay
from hapticd_views.replay.scores import Trace
from hapticd_views.source import written

_ROW_IN, _FRAME_IN = 0.85, 0.9

_COLUMNS = (("x_m", "position [mm]", 1e3), ("force_n", "force [N]", 1.0), ("energy_j", "energy [mJ]", 1e3))


def picture(replay: Replay, suffix: str) -> bytes:
    """Position, force and energy over time, all rows to the same scale, as the content of a file."""
    recorded, *laws = [_curves(trace, replay.period_s) for trace in replay.traces]
    with printed():
        figure, grid = style.figure(
            PAGE_IN, _FRAME_IN + _ROW_IN * len(laws), len(laws), len(_COLUMNS), sharex=True, sharey="col"
        )
        for row, law in zip(grid, laws, strict=True):
            for axes, (name, label, factor) in zip(row, _COLUMNS, strict=True):
                axes.plot(*recorded.line(name, factor), color=style.GREY, linewidth=0.6)
                axes.plot(*law.line(name, factor), color=style.BLUE, linewidth=0.8)
                axes.margins(x=0.0)
                if law is laws[0]:
                    axes.set_title(label)
                if law is laws[-1]:
                    axes.set_xlabel("time [s]")
            row[0].set_ylabel(law.name, rotation=0.0, horizontalalignment="right", verticalalignment="center")
        figure.suptitle(f"{written(replay.file)}: the hand's {replay.hand} replayed; grey: recorded", fontsize=8.5)
        return encoded(figure, suffix)


def _curves(trace: Trace, period_s: float) -> Curves:
    columns = trace.columns()
    return Curves(trace.law, {"t_s": [at * period_s for at in range(len(columns["x_m"]))], **columns})
