"""What a study must know before it starts: the extra is installed, the folder can be written, memory suffices."""

from __future__ import annotations

import csv
import importlib.util
import io
import json
import math
import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from hapticd import replacing
from hapticd.errors import ConfigError, HapticdError
from hapticd.replacing import obstacle


def require_extra(extra: str, *modules: str) -> None:
    """Say which extra is missing, if one is.

    Args:
        extra: `study`.
        modules: what it brings.

    Raises:
        HapticdError: a module is not installed.
    """
    missing = [module for module in modules if importlib.util.find_spec(module) is None]
    if missing:
        raise HapticdError(f"this needs {', '.join(missing)}: pip install 'hapticd[{extra}]'")


def require_cluster(address: str | None) -> None:
    """Check what `--cluster` was given.

    Raises:
        ConfigError: it is no address.
        HapticdError: the extra is not installed.
    """
    if address is None:
        return
    require_extra("cluster", "distributed")
    if not re.fullmatch(r"[a-z]+://[^/\s]+:\d+", address):
        raise ConfigError(f"--cluster {address}: must be the address of a dask scheduler, as tcp://127.0.0.1:8786")


def require_memory(need_bytes: float, what: str) -> None:
    """Refuse what would not fit.

    Args:
        need_bytes: memory that the results take at most.
        what: named in the refusal.

    Raises:
        ConfigError: this machine has less free.
    """
    free_bytes = _free_bytes()
    if need_bytes > 0.8 * free_bytes:
        need, free = need_bytes / 2**30, free_bytes / 2**30
        raise ConfigError(f"{what}: would take {need:.3g} GiB of memory, and {free:.3g} GiB are free; ask for fewer")


def require_folder(folder: Path, names: Sequence[str]) -> None:
    """Make the output folder and try whether the files can be written.

    Raises:
        ConfigError: they cannot.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".{os.getpid()}.probe"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise ConfigError(f"--output {folder}: cannot be written: {error.strerror}") from None
    for name in names:
        require_file(folder / name)


def require_file(file: Path) -> None:
    """Refuse a name that belongs to something else than a file, such as /dev/null.

    Raises:
        ConfigError: it does, or this user may not look.
    """
    try:
        reason = obstacle(file.resolve())
    except OSError as error:
        reason = error.strerror or str(error)
    if reason:
        raise ConfigError(f"--output {file}: {reason}")


def write(file: Path, content: bytes) -> None:
    """Put a file in its place at once, so that an interruption leaves no half of it."""
    require_file(file)
    replacing.write(file, content)


def as_json(data: Any) -> bytes:
    """JSON that any program reads: what is not a finite number becomes null."""
    return json.dumps(_strict(data), indent=1, allow_nan=False).encode() + b"\n"


def as_csv(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> bytes:
    """A table with a header; a number that is not finite becomes an empty cell."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(columns)
    for row in rows:
        table.writerow(["" if isinstance(cell, float) and not math.isfinite(cell) else cell for cell in row])
    return text.getvalue().encode()


def _strict(data: Any) -> Any:
    if isinstance(data, dict):
        return {str(key): _strict(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_strict(value) for value in data]
    if isinstance(data, float) and not math.isfinite(data):
        return None
    return data


def _free_bytes() -> float:
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        return next(float(line.split()[1]) * 1024.0 for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration):
        return math.inf
