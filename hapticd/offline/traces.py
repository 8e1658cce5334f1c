"""Files that keep every tick of an offline run: CSV streams to the disk, NPZ is collected in memory.

A file appears under its name only when it is complete; until then the old one stays, or none.
"""

from __future__ import annotations

import os
import shutil
from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from hapticd.errors import ConfigError, HapticdError
from hapticd.offline.run import Row
from hapticd.offline.space_row import SpaceRow
from hapticd.replacing import place, put

CSV_ROW_BYTES = 132
"""About what a row of a CSV file takes: eleven numbers, most with all their digits."""

NPZ_ROW_BYTES = 74
"""Eight floats, a count and two bytes."""

_SUFFIXES = {".csv": CSV_ROW_BYTES, ".npz": NPZ_ROW_BYTES}


class TraceFile(ABC):
    """A file that is being written; leaving the `with` block without an error gives it its name.

    Args:
        path: its name in the end.
        names: of the columns.
    """

    def __init__(self, path: Path, names: Sequence[str]) -> None:
        self.path = path
        self.names = names
        self._part = path.with_name(f".{path.name}.{os.getpid()}.part")
        self._file: IO[Any] = self._create()

    @abstractmethod
    def append(self, row: Row | SpaceRow) -> None:
        """Take a row in."""

    def __enter__(self) -> TraceFile:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        try:
            if kind is None:
                self._finish()
                self._file.close()
                put(self._part, self.path)
        except OSError as failed:
            raise HapticdError(f"{self.path}: cannot be written: {failed.strerror}") from failed
        finally:
            self._file.close()
            self._part.unlink(missing_ok=True)

    def _create(self) -> IO[Any]:
        return self._part.open("xb")

    @abstractmethod
    def _finish(self) -> None:
        """Write what is left."""


class CsvTrace(TraceFile):
    """A header line, then a line a tick; every number with the digits that give the same float again."""

    def append(self, row: Row | SpaceRow) -> None:
        """Write a row."""
        try:
            self._file.write(",".join(map(repr, row)) + "\n")
        except OSError as failed:
            raise HapticdError(f"{self.path}: cannot be written: {failed.strerror}") from failed

    def _finish(self) -> None:
        self._file.flush()

    def _create(self) -> IO[Any]:
        file = self._part.open("x", encoding="ascii", newline="")
        file.write(",".join(self.names) + "\n")
        return file


class NpzTrace(TraceFile):
    """One array a column, named as in the CSV.

    Args:
        path: its name in the end.
        names: of the columns.
        rows: how many there will be at most.
    """

    def __init__(self, path: Path, names: Sequence[str], rows: int) -> None:
        import numpy as np

        self._np = np
        kinds: dict[str, Any] = {"cycle": np.int64, "in_contact": np.bool_, "armed": np.bool_, "touched": np.int64}
        self._columns = {name: np.empty(rows, kinds.get(name, np.float64)) for name in names}
        self._arrays = tuple(self._columns.values())
        self._count = 0
        super().__init__(path, names)

    def append(self, row: Row | SpaceRow) -> None:
        """Keep a row."""
        at = self._count
        for array, value in zip(self._arrays, row, strict=True):
            array[at] = value
        self._count = at + 1

    def _finish(self) -> None:
        columns: dict[str, Any] = {name: column[: self._count] for name, column in self._columns.items()}
        self._np.savez(self._file, **columns)


def open_trace(path: Path, rows: int, overwrite: bool, names: Sequence[str] = Row._fields) -> TraceFile:
    """Begin a file, after everything has been checked that could fail once the work is done.

    Args:
        path: where; its suffix says in which format.
        rows: how many there will be at most.
        overwrite: whether a file of this name may be replaced.
        names: of the columns.

    Raises:
        ConfigError: the name, the place or the size makes it impossible.
        HapticdError: numpy is missing and the format needs it.
    """
    if path.suffix not in _SUFFIXES:
        raise ConfigError(f"{path}: must end in {' or '.join(_SUFFIXES)}")
    path = place(path, overwrite)  # a link stays a link
    _check_room(path, rows, len(names))
    try:
        if path.suffix == ".csv":
            return CsvTrace(path, names)
        return NpzTrace(path, names, rows)
    except ModuleNotFoundError as error:
        raise HapticdError(f"{path}: needs {error.name}: pip install 'hapticd[study]'; a .csv does not") from None
    except MemoryError:
        raise ConfigError(f"{path}: {rows} ticks do not fit into memory; a .csv is written tick by tick") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror}") from None


def _check_room(path: Path, rows: int, columns: int) -> None:
    """Refuse what disk or memory cannot hold.

    Raises:
        ConfigError: with the numbers.
    """
    bytes_needed = rows * _SUFFIXES[path.suffix] * columns // len(Row._fields)
    if path.suffix == ".npz" and bytes_needed > (free := _free_memory()):
        raise ConfigError(
            f"{path}: {rows} ticks take {_size(bytes_needed)} of memory and {_size(free)} are free; "
            "a .csv is written tick by tick"
        )
    if bytes_needed > (free := shutil.disk_usage(path.parent).free):
        raise ConfigError(
            f"{path}: {rows} ticks take about {_size(bytes_needed)} and {_size(free)} of the disk are free"
        )


def _free_memory() -> int:
    """Memory that can be had without swapping [bytes]."""
    for line in Path("/proc/meminfo").read_text().splitlines():
        if line.startswith("MemAvailable:"):
            return int(line.split()[1]) * 1024
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_AVPHYS_PAGES")


def _size(count: float) -> str:
    """Bytes for people."""
    for unit in ("bytes", "kB", "MB", "GB"):
        if count < 1000.0:
            return f"{count:.3g} {unit}"
        count /= 1000.0
    return f"{count:.3g} TB"
