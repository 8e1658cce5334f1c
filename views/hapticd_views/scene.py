"""A run in space as a picture of its scene: the path of the device, and where the surfaces held it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from hapticd.config.loading import load
from hapticd.config.models import Config
from hapticd.errors import ConfigError
from hapticd.figures.space import views
from hapticd.shapes.proxy import follow, place
from hapticd.shapes.solid import Proxy
from hapticd.tick.space.solid import at_once, compile_objects
from hapticd_views.recording import Recording
from hapticd_views.source import Source, table

Points = npt.NDArray[np.float64]

_COLUMNS = ("position_x_m", "position_y_m", "position_z_m")


def scene(source: Source, file: Path, config: Path | None, from_s: float, to_s: float, title: str) -> Figure:
    """Three views of a run among the objects of its scene.

    The surfaces are followed along the path anew, so that a file without contacts shows them too.

    Args:
        source: the run.
        file: it is in.
        config: that was run; a recording has its own, and is drawn in the objects of one of them.
        from_s: the first moment that is drawn, since the first tick [s].
        to_s: the last one [s].
        title: above it.

    Raises:
        ConfigError: the run is not one of three axes, its scene is not known, or a reload changed it between the two
            moments.
        HapticdError: a recording holds no configuration.
    """
    time_s, path = _path(source, file)
    shown = (time_s >= from_s) & (time_s <= to_s)
    if not shown.any():
        raise ConfigError(f"{source.name}: no tick from {from_s:g} s to {to_s:g} s")
    if config is not None:
        keys = load(config).config
    elif source.recording is not None:
        keys, first = _in_force(source.recording, shown, time_s)
        path, shown = path[first:], shown[first:]
    else:
        raise ConfigError(f"{source.name}: which scene? give the configuration that was run: --config FILE")
    solids = [solid.proxy for solid in at_once(compile_objects(keys.scene.objects, keys.loop.period_s))]
    held = _held(solids, path)
    return views(path[shown], solids, None if held is None else held[shown], title)


def _in_force(recording: Recording, shown: npt.NDArray[np.bool_], time_s: Points) -> tuple[Config, int]:
    """The configuration of the ticks that are shown, and the first tick that had its objects."""
    in_force = recording.in_force
    rows = np.flatnonzero(shown)
    keys = recording.keys_of(recording.receipts[in_force[rows[0]]])
    for row in rows[np.flatnonzero(np.diff(in_force[rows]))].tolist():
        other = recording.keys_of(recording.receipts[in_force[row + 1]])
        if other.scene.objects != keys.scene.objects:
            at_s = 0.5 * (time_s[row] + time_s[row + 1])
            file = recording.path.name
            raise ConfigError(f"{file}: its objects changed at {at_s:.5f} s: draw it with --to or --from then")
    others = np.flatnonzero(in_force[: rows[0]] != in_force[rows[0]])
    return keys, int(others[-1]) + 1 if len(others) else 0


def _path(source: Source, file: Path) -> tuple[Points, Points]:
    """Time since the first tick, and the positions."""
    if source.recording is not None:
        ticks = source.recording.ticks
        path: Any = ticks["position_m"]
        if path.shape[1] != 3:
            raise ConfigError(f"{source.name}: a scene is drawn in three axes, and this device has {path.shape[1]}")
        return ticks["timestamp"] - ticks["timestamp"][0], path
    columns = table(file)
    if any(name not in columns for name in _COLUMNS):
        raise ConfigError(f"{source.name}: no columns {', '.join(_COLUMNS)}: a scene is drawn in three axes")
    return columns["t_s"], np.column_stack([columns[name] for name in _COLUMNS])


def _held(solids: list[Proxy], path: Points) -> Points | None:
    """Where the deepest surface held the device; NaN while none did; None where it is not known of any."""
    if not solids:
        return None
    held = np.full(path.shape, np.nan)
    for at, (x, y, z) in enumerate(path.tolist()):
        deepest = 0.0
        for proxy in solids:
            (follow if at else place)(proxy, proxy.others, proxy.voxels, x, y, z)
            if proxy.touching and proxy.depth_m > deepest:
                deepest = proxy.depth_m
                held[at] = (
                    x + deepest * proxy.normal_x + proxy.stretch_x,
                    y + deepest * proxy.normal_y + proxy.stretch_y,
                    z + deepest * proxy.normal_z + proxy.stretch_z,
                )
    return held
