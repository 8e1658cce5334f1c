"""Where a command may write its output, and a file that appears there when it is complete."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hapticd import replacing
from hapticd.errors import ConfigError, HapticdError
from hapticd.replacing import put


def place(path: Path, overwrite: bool) -> Path:
    """Where a file of this name goes: behind a link, what it leads to.

    Raises:
        ConfigError: something is there already, a recording is being written to it, or it is no place for a file.
    """
    there = replacing.place(path, overwrite)
    if there.exists() and not _free(there):
        raise being_recorded(path)
    return there


def being_recorded(path: Path) -> ConfigError:
    """The error for a file that another recorder is writing."""
    return ConfigError(f"{path}: is being recorded; end that recording first, or name another --output")


def hold(descriptor: int) -> bool:
    """Hold an open file for this process alone, as a recorder does, until it is closed; False where another does."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass  # a file system without locks: there is no telling
    return True


def _free(path: Path) -> bool:
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return True  # it cannot be looked at; writing it will say why
    try:
        return hold(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def part_of(path: Path, overwrite: bool) -> Iterator[Path]:
    """A file beside its place, to be written and closed; it is put there at the end, and gone after an error.

    Raises:
        ConfigError: as `place`.
        HapticdError: it cannot be written, for example on a full disk.
    """
    there = place(path, overwrite)
    part = there.with_name(f".{there.name}.{os.getpid()}.part")
    try:
        yield part
        put(part, there)
    except OSError as error:
        raise HapticdError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)
