"""One of the random devices again: what it is, what becomes of it under each reading, and its run over time."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from hapticd.errors import ConfigError
from hapticd.offline.outcome import Criterion
from hapticd.offline.presses import balance_m
from hapticd.simulation.batch import TRACE_COLUMNS, Batch
from hapticd_studies.grid.output import as_csv, write
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.robustness.devices import DURATION_S, Device, draw
from hapticd_studies.robustness.plot import draw_one
from hapticd_studies.robustness.readings import PAPER, params_on
from hapticd_studies.robustness.report import reason
from hapticd_studies.robustness.sweep import COLUMNS, pressed


def device_of(text: str) -> Device:
    """The device of `SEED:INDEX`.

    Raises:
        ConfigError: it is none.
    """
    found = re.fullmatch(r"(\d{1,18}):(\d{1,9})", text)
    if found is None:
        raise ConfigError(f"--only {text}: must be SEED:INDEX, as 1:57")
    return draw(int(found[1]), int(found[2]))


def outcomes(device: Device, readings: Sequence[LawSpec], criterion: Criterion) -> Table:
    """What becomes of a device under each reading."""
    shown = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    shown.add_column("law, reading", overflow="fold")
    shown.add_column("outcome")
    shown.add_column("damping", justify="right")
    for reading in readings:
        (row,) = pressed([device], reading, criterion)
        damping = f"{row[COLUMNS.index('damping_n_s_per_m')]:.1f} N s/m"
        shown.add_row(escape(reading.label), reason(device, row).partition(";")[0], damping)
    return shown


def write_files(device: Device, readings: Sequence[LawSpec], criterion: Criterion, folder: Path) -> list[Path]:
    """Write the device as a configuration, and its run under each reading as CSV and picture."""
    stem = f"device-{device.seed}-{device.index}"
    runs = []
    columns: list[str] = ["t_s"]
    found: list[np.ndarray[Any, Any]] = []
    time_s: np.ndarray[Any, Any] = np.empty(0)
    target_m = 0.0
    for reading in readings:
        point = device.point(params_on(reading, device), criterion)
        target_m = balance_m(point)
        trace = Batch(reading.law, [point], DURATION_S, criterion.window_s, trace_every=1).run().trace[0]
        time_s = (np.arange(len(trace)) + 1) * point.period_s
        found = found or [time_s]
        columns += [f"{reading.label}:{name}" for name in TRACE_COLUMNS]
        found += list(trace.T)
        runs.append((reading.label, trace[:, 0], trace[:, TRACE_COLUMNS.index("damping_n_s_per_m")]))
    title = (
        f"{device.name}: {device.mass_kg:.2f} kg, {device.stiffness_n_per_m / 1e3:.1f} kN/m, {device.rate_hz:.0f} Hz, "
        f"{device.hand_n:.1f} N" + (", one sample late" if device.delayed else "")
    )
    contents = {
        f"{stem}.toml": device.config(PAPER, {}).encode(),
        f"{stem}.csv": as_csv(columns, np.array(found).T.tolist()),
        f"{stem}.png": draw_one(title, time_s, runs, target_m),
    }
    for name, content in contents.items():
        write(folder / name, content)
    return [folder / name for name in contents]
