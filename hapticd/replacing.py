"""Putting a finished file in its place: the one way in which hapticd gives a file a name that was taken.

A rename puts a file over anything: as root, over /dev/null, and then nothing on the computer works as it should.
"""

from __future__ import annotations

import contextlib
import errno
import stat
from pathlib import Path

from hapticd.errors import ConfigError, HapticdError

_KINDS = {
    stat.S_IFDIR: "a directory",
    stat.S_IFLNK: "a link",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def obstacle(path: Path) -> str:
    """What is in the way of a file of this name, such as `is a device, not a file`; empty where a file may go.

    Raises:
        OSError: this user may not look.
    """
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return ""
    return "" if stat.S_ISREG(mode) else f"is {_KINDS.get(stat.S_IFMT(mode), 'something else')}, not a file"


def place(path: Path, overwrite: bool) -> Path:
    """Where the output of a command goes: behind a link, what it leads to.

    Args:
        path: as the user names it.
        overwrite: whether a file of this name may be replaced.

    Raises:
        ConfigError: something is there already, or it is no place for a file.
    """
    there = path.resolve() if path.is_symlink() else path
    reason = obstacle(there)
    if reason:
        raise ConfigError(f"{there}: {reason}")
    if there.exists() and not overwrite:
        raise ConfigError(f"{path}: exists; add --overwrite to replace it")
    if not there.parent.is_dir():
        raise ConfigError(f"{path}: there is no directory {there.parent}")
    return there


def put(finished: Path, path: Path) -> None:
    """Give a finished file its name at once, in the place of an older file or of none.

    Args:
        finished: the file, in the directory of `path`.
        path: its name.

    Raises:
        OSError: the name belongs to something that is no regular file, or this user may not.
    """
    reason = obstacle(path)
    if reason:
        raise OSError(errno.EINVAL, reason, str(path))
    finished.rename(path)


def write(path: Path, content: bytes) -> None:
    """Put a file in its place at once, so that an interruption leaves no half of it. A link stays a link.

    Raises:
        HapticdError: it cannot be written.
    """
    path = path.resolve()
    part = path.with_name(f".{path.name}.part")
    try:
        part.unlink(missing_ok=True)  # of one that was interrupted; through a link, another file would be written
        with part.open("xb") as file:
            file.write(content)
        put(part, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        raise HapticdError(f"{path}: cannot be written: {error.strerror}") from None
