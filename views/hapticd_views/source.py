"""What a plot or a report is made of: a recording, a file of `hapticd simulate`, or a daemon that is listened to."""

from __future__ import annotations

import math
import os
import tempfile
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hapticd.client import DaemonClient
from hapticd.errors import ConfigError, HapticdError
from hapticd.figures.curves import Curves
from hapticd.offline.outcome import balance
from hapticd.offline.rehearsal import simulation_options
from hapticd.offline.run import Row
from hapticd_views.recording import Recording, read
from hapticd_views.recording.recorder import Limits, Recorder

SUFFIXES = (".mcap", ".csv", ".npz")
"""What a file may end in."""

# What numpy and zipfile raise for one that is damaged, locked, packed otherwise, or none but in name.
_NO_NPZ = (
    ValueError, EOFError, zipfile.BadZipFile, zlib.error, AttributeError, TypeError, NotImplementedError, RuntimeError,
)  # fmt: skip

_WANTED = "name a table that `hapticd simulate` wrote, or the .mcap of a recording"

Columns = dict[str, npt.NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Source:
    """One run, wherever it comes from.

    Attributes:
        name: of the file, or "live".
        curves: at the first wall; without a wall, one along each axis.
        recording: what it was recorded in; None for a file of `hapticd simulate`.
    """

    name: str
    curves: tuple[Curves, ...]
    recording: Recording | None


def open_source(path: Path) -> Source:
    """The run in a file.

    Raises:
        ConfigError: nothing is known to be in a file of this name.
        HapticdError: it cannot be read, or holds no run.
    """
    if path.suffix not in SUFFIXES:
        raise ConfigError(f"{path}: must end in .mcap (hapticd record), or in .csv or .npz (hapticd simulate)")
    if path.suffix == ".mcap":
        return recorded(written(path), read(path))
    found = table(path)
    if "t_s" not in found and "timestamp" in found:
        raise HapticdError(f"{path}: is a table of `hapticd record export`; {_WANTED}")
    columns = {name: column for name, column in found.items() if name in Row._fields}
    whole = Curves(written(path), columns)
    stop = _stop(whole)
    if stop is None:
        return Source(whole.name, (whole,), None)
    armed = np.arange(len(whole["t_s"])) < stop
    stopped = replace(whole, columns={**columns, "armed": armed}, faults_s=(float(whole["t_s"][stop]),))
    return Source(whole.name, (stopped,), None)


def written(path: Path) -> str:
    """The name of a file as it can be drawn and written, whatever bytes it is of."""
    return os.fsencode(path.name).decode(errors="replace")


def table(path: Path) -> Columns:
    """Every column of a .csv or .npz of `hapticd simulate`.

    Raises:
        HapticdError: it cannot be read, or is none.
    """
    columns = _csv(path) if path.suffix == ".csv" else _npz(path)
    for name, column in columns.items():
        if np.ndim(column) != 1:
            raise HapticdError(f"{path}: is no table of numbers: {name} is no column")
    return columns


def recorded(name: str, recording: Recording) -> Source:
    """The run in a recording.

    Args:
        name: what it is called.
        recording: that was read.

    Raises:
        HapticdError: it has no tick, or its configuration is needed and not in it.
    """
    ticks = recording.ticks
    if "position_m" not in ticks or not len(ticks["timestamp"]):
        raise HapticdError(f"{name}: holds no tick with a position")
    receipts = [recording.receipts[number] for number in np.unique(recording.in_force).tolist()]
    stiffness = {receipt["wall_stiffness_n_per_m"][0] for receipt in receipts if receipt["wall_axis"]}
    if stiffness and "wall_stiffness_n_per_m" in (status := recording.topics.get("status", {})):
        told = status["wall_stiffness_n_per_m"][:, :1]
        stiffness |= set(told[np.isfinite(told)].tolist())  # of a wall that changes over time too
    if not stiffness:
        return Source(name, _axes(name, recording), recording)
    columns = recording.wall(0)
    ended = sorted(cycle.timestamp for cycle in recording.cycles if cycle.contact == 0)
    if "energy_j" in columns:
        columns["cycle"] = np.searchsorted(ended, ticks["timestamp"], side="right")
    if "damping_n_s_per_m" in columns:
        columns["damping_n_s_per_m"] = np.nan_to_num(columns["damping_n_s_per_m"])  # of a wall that a reload took away
    columns["armed"] = recording.armed
    there = np.isfinite(columns["x_m"])  # the wall, which may have come or gone with a reload
    columns = {key: column[there] for key, column in columns.items()}
    commanded = stiffness.pop() if len(stiffness) == 1 else math.nan
    rest_m = _rest_m(recording, receipts[0]) if len(receipts) == 1 else math.nan
    faults_s = tuple(fault.timestamp - float(ticks["timestamp"][0]) for fault in recording.faults)
    return Source(name, (Curves(name, columns, commanded, rest_m, faults_s),), recording)


def listen(daemon: DaemonClient, duration_s: float, stopped: Callable[[], bool]) -> Source:
    """What a daemon does for a while.

    Args:
        daemon: with the topics of every tick.
        duration_s: how long [s].
        stopped: asked whether to end before that.
    """
    with tempfile.TemporaryDirectory(prefix="hapticd-") as folder:
        path = Path(folder) / "live.mcap"
        Recorder(daemon, path, Limits()).run(stopped, duration_s)
        return recorded("live", replace(read(path), path=Path("live")))  # the file is gone with the folder


def _axes(name: str, recording: Recording) -> tuple[Curves, ...]:
    """Free space: positions and forces as the device has them."""
    ticks = recording.ticks
    time_s = ticks["timestamp"] - ticks["timestamp"][0]
    shared: Columns = {key: ticks[key] for key in ("energy_j", "late_us") if key in ticks}
    outside = np.zeros(len(time_s), np.bool_)
    return tuple(
        Curves(
            f"{name} {axis}",
            {
                **shared,
                "t_s": time_s,
                "x_m": ticks["position_m"][:, at],
                "force_n": ticks["force_n"][:, at],
                "force_requested_n": ticks["force_requested_n"][:, at],
                "in_contact": outside,
            },
        )
        for at, axis in enumerate(recording.receipt["axes"])
    )


def _stop(run: Curves) -> int | None:
    """The first tick of a simulated run without any force, where a fault stopped it; None where none is seen to have.

    Nothing else disarms such a run, and once it is, walls ask for a force and none comes.
    """
    if "force_requested_n" not in run:
        return None
    stop = int(np.max(np.flatnonzero(run["force_n"]), initial=-1)) + 1
    return stop if run["force_requested_n"][stop:].any() else None


def _rest_m(recording: Recording, receipt: dict[str, Any]) -> float:
    """Where hand and walls balance, which is known of a simulated hand only [m]."""
    try:
        config = recording.config_of(receipt)
        return balance(simulation_options(config), config.config.scene.walls).x_m
    except HapticdError:
        return math.nan


def _csv(path: Path) -> Columns:
    try:
        with path.open(encoding="utf-8") as file:
            names = file.readline().strip().split(",")
            rows = file.read()
        numbers = np.loadtxt(rows.splitlines(), delimiter=",", ndmin=2) if rows.strip() else np.empty((0, len(names)))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError:
        raise HapticdError(f"{path}: is no table of numbers; {_WANTED}") from None
    if numbers.shape[1] != len(names):
        raise HapticdError(f"{path}: has {len(names)} names for {numbers.shape[1]} columns")
    return dict(zip(names, numbers.T, strict=False))


def _npz(path: Path) -> Columns:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as found:
            return {name: found[name] for name in found.files}
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from None
    except _NO_NPZ as error:
        raise HapticdError(f"{path}: is no .npz file of numbers: {error}") from None
