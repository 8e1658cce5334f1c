"""A replay on paper: its columns in a file, and one figure of all laws."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from hapticd.errors import ConfigError, HapticdError
from hapticd_views.recording.output import part_of
from hapticd_views.replay.replay import Replay

TABLES = (".csv", ".npz")
FIGURES = (".png", ".svg", ".pdf")


def check(output: Path) -> None:
    """Refuse what no replay is written to, before the work.

    Raises:
        ConfigError: the suffix is not known.
    """
    if output.suffix not in (*FIGURES, *TABLES):
        raise ConfigError(f"{output}: must end in {', '.join((*TABLES, *FIGURES))}")


def write(replay: Replay, output: Path, overwrite: bool) -> None:
    """Write the columns (.csv, .npz) or the figure (.png, .svg, .pdf).

    Raises:
        ConfigError: it cannot be written there.
        HapticdError: matplotlib is not installed, or the disk is full.
    """
    check(output)
    with part_of(output, overwrite) as part:
        if output.suffix == ".npz":
            with part.open("xb") as file:
                np.savez(file, allow_pickle=False, **replay.columns)
        elif output.suffix == ".csv":
            columns = replay.columns
            with part.open("x", encoding="utf-8", newline="") as text:
                writer = csv.writer(text, lineterminator="\n")
                writer.writerow(columns)
                writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))
        else:
            try:
                from hapticd_views.replay.figure import picture
            except ModuleNotFoundError as error:
                raise HapticdError(
                    f"{output}: needs {error.name}: pip install 'hapticd[study]'; .csv does not"
                ) from None
            part.write_bytes(picture(replay, output.suffix))
