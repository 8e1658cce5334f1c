"""One of the random devices again: what it is, its figures under each law, and its run over time."""

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
from hapticd.simulation.batch import TRACE_COLUMNS
from hapticd_studies.grid.output import as_csv, write
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.transparency.devices import Held, draw, draw_out_of_sample
from hapticd_studies.transparency.plot import draw_one
from hapticd_studies.transparency.references import COLUMNS, references
from hapticd_studies.transparency.report import figures_of
from hapticd_studies.transparency.runs import columns_of, moving_runs, rows, times_of

_PICTURED_S = 3.0


def device_of(text: str, out_of_sample: bool = False) -> Held:
    """The device of `SEED:INDEX`.

    Args:
        text: which one.
        out_of_sample: of those that have what no law was made for.

    Raises:
        ConfigError: it is none.
    """
    found = re.fullmatch(r"(\d{1,18}):(\d{1,9})", text)
    if found is None:
        raise ConfigError(f"--replay {text}: must be SEED:INDEX, as 1:57")
    one = draw_out_of_sample if out_of_sample else draw
    return one(int(found[1]), int(found[2]))


def figures(device: Held, laws: Sequence[LawSpec], duration_s: float, criterion: Criterion) -> Table:
    """The figures of a device under each law, and what constant dampers do there."""
    shown = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    shown.add_column("", overflow="fold")
    for law in laws:
        shown.add_column(escape(law.label), justify="right", overflow="fold")
    each = [figures_of(rows([device], law, duration_s, criterion)[0]) for law in laws]
    for name in each[0]:
        shown.add_row(name, *(one[name] for one in each))
    (dampers,) = references([device], criterion)
    for name, value in zip(COLUMNS, dampers, strict=True):
        shown.add_row(f"constant damper: {name}", f"{value:.4g}")
    return shown


def write_files(
    device: Held, laws: Sequence[LawSpec], duration_s: float, criterion: Criterion, folder: Path
) -> list[Path]:
    """Write the device as a configuration, and its run under each law as CSV and picture."""
    stem = f"device-{device.seed}-{device.index}"
    ticks = round(duration_s / device.period_s)
    time_s = times_of(device, ticks)
    names, found, runs = ["t_s"], [time_s], []
    for law in laws:
        columns: list[Any] = columns_of(moving_runs([device], law, duration_s, criterion), 0)
        names += [f"{law.label}:{name}" for name in TRACE_COLUMNS]
        found += [np.pad(column, (0, ticks - len(column)), constant_values=np.nan) for column in columns]
        runs.append((law.label, found[-6], found[-3]))
    pictured = round(min(_PICTURED_S, duration_s) / device.period_s)
    title = (
        f"{device.name}: {device.kind}, {device.mass_kg:.2g} kg, {device.stiffness_n_per_m / 1e3:.2g} kN/m "
        f"({device.own_share:.2g} of its own limit), {device.rate_hz:.0f} Hz"
    )
    contents = {
        f"{stem}.toml": device.config(laws[-1].name, duration_s).encode(),
        f"{stem}.csv": as_csv(names, np.array(found).T.tolist()),
        f"{stem}.png": draw_one(title, time_s[:pictured], [(name, x[:pictured], f[:pictured]) for name, x, f in runs]),
    }
    for name, content in contents.items():
        write(folder / name, content)
    return [folder / name for name in contents]
