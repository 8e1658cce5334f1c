"""The configuration as a file: read whole, and replaced whole, so that no reader gets half of it."""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from hapticd.errors import ConfigError
from hapticd.replacing import obstacle, put

_LARGEST = 1 << 20


def table_of(text: str) -> dict[str, Any]:
    """What the text of a configuration says, as far as TOML goes; Windows' editors begin one with a mark.

    Raises:
        ValueError: it is no TOML.
        RecursionError: its tables lie too deep in each other.
    """
    return tomllib.loads(text.removeprefix("\ufeff") + "\n")


def read(path: Path | str, *, files_only: bool = False) -> str:
    """Text of a configuration file, line ends as they are.

    Args:
        path: the file.
        files_only: refuse a pipe or a device, whose reader waits for a writer.

    Raises:
        ConfigError: it cannot be read, or is no text.
    """
    try:
        if files_only:
            mode = Path(path).stat().st_mode
            if stat.S_ISFIFO(mode) or stat.S_ISCHR(mode):
                raise ConfigError(f"{path}: is a pipe or a device, not a file; a running daemon reads files only")
        with Path(path).open("rb") as file:
            raw = file.read(_LARGEST + 1)
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise ConfigError(f"{path}: is a directory, not a file") from None
    except PermissionError:
        raise ConfigError(f"{path}: this user may not read it") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise ConfigError(f"{path}: cannot be read: {reason}") from None
    if len(raw) > _LARGEST:
        raise ConfigError(f"{path}: is larger than 1 MiB, so it is no configuration")
    try:
        return raw.decode()
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise ConfigError(f"{path}: line {line}: not UTF-8 text, save the file as UTF-8") from None


def replace(path: Path, text: str) -> None:
    """Put another text in the place of an existing file, at once; mode, owner and attributes stay.

    A link stays a link: the file that it leads to is replaced.

    Raises:
        ConfigError: this user may not; the file is as it was.
    """
    target = path.resolve()
    try:
        if not os.access(target, os.W_OK):
            raise PermissionError
        reason = obstacle(target)
        if reason:
            raise ConfigError(f"{path}: {reason}")
        descriptor, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(text.encode())
                file.flush()
                status = target.stat()
                os.chown(descriptor, status.st_uid, status.st_gid)
                shutil.copystat(target, name)
                os.utime(name)
                os.fsync(descriptor)
            put(Path(name), target)
        except BaseException:
            with contextlib.suppress(OSError):
                Path(name).unlink()
            raise
        folder = os.open(target.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    except PermissionError:
        raise ConfigError(f"{path}: this user may not replace it and keep its owner: use sudo") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror}; it is as it was") from None
