"""A recording as a table for other programs: CSV, Parquet, npz. Every float comes back with the same bits."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pyarrow.parquet

from hapticd.errors import ConfigError
from hapticd_views.recording.columns import Values
from hapticd_views.recording.output import part_of
from hapticd_views.recording.recording import Recording

TICKS = "ticks"
"""The table of all topics that have a message every tick."""

Table = dict[str, Values]


def export(recording: Recording, output: Path, topic: str = TICKS, overwrite: bool = False) -> int:
    """Write one table of a recording; a key with an element an axis or a wall is a column each, `position_m[0]`.

    Args:
        recording: the recording.
        output: where; .csv, .parquet or .npz, in which such keys stay tables. It appears when it is complete.
        topic: "ticks", or a topic of the recording such as "cycle".
        overwrite: whether a file of this name may be replaced.

    Returns:
        Its rows.

    Raises:
        ConfigError: no such topic, or the output cannot be written there.
        HapticdError: the disk is full.
    """
    write = _WRITERS.get(output.suffix)
    if write is None:
        raise ConfigError(f"{output}: must end in {', '.join(_WRITERS)}")
    table = recording.ticks if topic == TICKS else recording.topics.get(topic)
    if not table:
        raise ConfigError(f"{recording.path}: has no {topic!r}; there is {', '.join([TICKS, *recording.topics])}")
    with part_of(output, overwrite) as part:
        write(table, part)
    return len(table["run"])


def single_columns(table: Table) -> Table:
    """The table with one column for each element of those keys that have several."""
    found: Table = {}
    for name, values in table.items():
        if isinstance(values, np.ndarray) and values.ndim == 2:
            found |= {f"{name}[{at}]": values[:, at] for at in range(values.shape[1])}
        else:
            found[name] = values
    return found


def _write_csv(table: Table, path: Path) -> None:
    columns = single_columns(table)
    plain = [_plain(values) for values in columns.values()]
    with path.open("x", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*plain, strict=True))  # a float is written as repr has it: the shortest that comes back


def _plain(values: Values) -> list[Any]:
    """The values of a column, true and false as 1 and 0: a table of numbers is one for every program."""
    listed = values.tolist() if isinstance(values, np.ndarray) else values
    return [int(one) if isinstance(one, bool) else one for one in listed]


def _write_parquet(table: Table, path: Path) -> None:
    columns = {name: _parquet_column(values) for name, values in single_columns(table).items()}
    with path.open("xb") as file:  # of its own, pyarrow opens only names that are UTF-8
        pyarrow.parquet.write_table(pyarrow.table(columns), file)


def _parquet_column(values: Values) -> Any:
    if isinstance(values, list):
        return pyarrow.array([one if one is None or isinstance(one, str) else str(one) for one in values])
    return pyarrow.array(np.ascontiguousarray(values))


def _write_npz(table: Table, path: Path) -> None:
    columns: Any = {name: _npz_column(values) for name, values in table.items()}
    with path.open("xb") as file:
        np.savez(file, **columns)


def _npz_column(values: Values) -> Any:
    return values if isinstance(values, np.ndarray) else np.array([str(one) for one in values])


_WRITERS: dict[str, Callable[[Table, Path], None]] = {
    ".csv": _write_csv,
    ".parquet": _write_parquet,
    ".npz": _write_npz,
}
