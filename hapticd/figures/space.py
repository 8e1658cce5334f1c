"""A scene in space with the path of the device: three views, each with the solids cut where they are touched."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from hapticd.errors import HapticdError
from hapticd.figures import style
from hapticd.figures.sheets import PAGE_IN, printed
from hapticd.shapes.solid import Proxy
from hapticd.shapes.surface import distance

Points = npt.NDArray[np.float64]

_VIEWS = ((0, 1), (0, 2), (1, 2))
_NAMES = "xyz"
_CELLS = 120
_ROOM = 0.35  # around the path, as a share of its size
_LEAST_M = 0.01


def views(path_m: Any, solids: Sequence[Proxy], proxy_m: Any = None, title: str = "") -> Figure:
    """Three views of a path among solids: from above, from the front and from the side.

    Each shows the solids cut by the plane of the view through the surface where the device was deepest, or through
    the end of a path that touches nothing.

    Args:
        path_m: positions of the device, (N, 3) [m].
        solids: what stands there.
        proxy_m: where its proxy was, (N, 3), NaN while nothing was touched [m].
        title: above it.

    Raises:
        HapticdError: there is no position, or one that is not of three axes.
    """
    path = _points(path_m, "path_m")
    held = None if proxy_m is None else _points(proxy_m, "proxy_m")
    if held is not None and len(held) != len(path):
        raise HapticdError(f"proxy_m: has {len(held)} points, and path_m {len(path)}")
    depth = np.zeros(len(path)) if held is None else np.nan_to_num(np.linalg.norm(held - path, axis=1))
    at = path[-1] if held is None or not depth.any() else held[int(depth.argmax())]
    low, high = path.min(axis=0), path.max(axis=0)
    half = 0.5 * max(float((high - low).max()) * (1.0 + 2.0 * _ROOM), _LEAST_M)
    middle = 0.5 * (low + high)
    with printed():
        figure, axes = style.figure(PAGE_IN, 3.0, 1, 3)
        for panel, (across, up) in zip(axes[0], _VIEWS, strict=True):
            _cut(panel, solids, at, middle, half, across, up)
            _draw_path(panel, path, held, across, up)
            panel.set(
                xlabel=f"{_NAMES[across]} [mm]",
                ylabel=f"{_NAMES[up]} [mm]",
                xlim=1e3 * np.array((middle[across] - half, middle[across] + half)),
                ylim=1e3 * np.array((middle[up] - half, middle[up] + half)),
                aspect="equal",
            )
            other = 3 - across - up
            panel.set_title(f"cut at {_NAMES[other]} = {round(1e3 * at[other], 2) + 0.0:g} mm", fontweight="normal")
        figure.legend(handles=_legend(held), loc="outside lower center", ncols=4)
        if title:
            figure.suptitle(title, fontsize=8.5, fontweight="bold")
        return figure


def _points(values: Any, name: str) -> Points:
    points = np.asarray(values, np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise HapticdError(f"{name}: must be positions of three axes, and at least one")
    return points


def _cut(panel: Axes, solids: Sequence[Proxy], at: Points, middle: Points, half: float, across: int, up: int) -> None:
    along = np.linspace(middle[across] - half, middle[across] + half, _CELLS)
    upward = np.linspace(middle[up] - half, middle[up] + half, _CELLS)
    for solid in solids:
        values = np.empty((_CELLS, _CELLS))
        point = [float(each) for each in at]
        pose = solid.pose
        for row, second in enumerate(upward.tolist()):
            for column, first in enumerate(along.tolist()):
                point[across], point[up] = first, second
                values[row, column] = distance(solid, solid.others, solid.voxels, *pose.own(point))[0]
        if values.min() < 0.0:
            panel.contourf(1e3 * along, 1e3 * upward, values, levels=(-1e9, 0.0), colors=(style.WALL,), zorder=1)
        if values.min() < 0.0 < values.max():
            panel.contour(1e3 * along, 1e3 * upward, values, levels=(0.0,), colors=(style.SLATE,), linewidths=0.9)


def _draw_path(panel: Axes, path: Points, held: Points | None, across: int, up: int) -> None:
    panel.plot(1e3 * path[:, across], 1e3 * path[:, up], color=style.BLUE, lw=0.9, zorder=3)
    if held is not None:
        pressed = np.where(np.isfinite(held), path, np.nan)
        panel.plot(1e3 * pressed[:, across], 1e3 * pressed[:, up], color=style.RED, lw=1.3, zorder=4)
        panel.plot(1e3 * held[:, across], 1e3 * held[:, up], color=style.ORANGE, lw=1.1, zorder=5)
    panel.plot(1e3 * path[-1, across], 1e3 * path[-1, up], "o", color=style.INK, markersize=3.5, zorder=6)


def _legend(held: Points | None) -> list[Any]:
    found: list[Any] = [
        Patch(facecolor=style.WALL, edgecolor=style.SLATE, label="solid"),
        Line2D([], [], color=style.BLUE, lw=0.9, label="device, free"),
    ]
    if held is not None:
        found += [
            Line2D([], [], color=style.RED, lw=1.3, label="device, held"),
            Line2D([], [], color=style.ORANGE, lw=1.1, label="proxy"),
        ]
    return found
