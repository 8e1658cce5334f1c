"""Who but root and this user may put another key in the place of one, as sshd asks (StrictModes)."""

from __future__ import annotations

import grp
import os
import pwd
import shlex
import stat
from pathlib import Path

from hapticd.errors import ConfigError


def require_ours(path: Path) -> None:
    """Refuse a key file that others may change: it, or a directory above it, up to the root.

    A directory with the sticky bit, such as /tmp, lets each user change only what is theirs. A group in which its
    owner is alone is its owner.

    Args:
        path: of the file, which is there.

    Raises:
        ConfigError: others may; the message names what they may change, and the command that mends it.
    """
    found = path.resolve()
    for place in (found, *found.parents):
        who, remedy = _intruder(place)
        if who:
            raise ConfigError(
                f"{place}: {who} may change it, and so let anyone in: {remedy} {shlex.quote(str(place))}, "
                "and look who is listed (`hapticd keys`)"
            )


def _intruder(place: Path) -> tuple[str, str]:
    """Who else may change a file or directory, and the command against it; "" when no one may."""
    status = place.stat()
    # In a container that does not know root's number, the root directory still belongs to root.
    if status.st_uid not in (0, os.geteuid(), Path("/").stat().st_uid):
        return f"user {_user(status.st_uid)}", "sudo chown root"
    if stat.S_ISDIR(status.st_mode) and status.st_mode & stat.S_ISVTX:
        return "", ""
    group = status.st_mode & stat.S_IWGRP and not _alone(status.st_uid, status.st_gid)
    if status.st_mode & stat.S_IWOTH:
        return "everybody", "chmod go-w" if group else "chmod o-w"
    return (f"group {_group(status.st_gid)}", "chmod g-w") if group else ("", "")


def _alone(user: int, group: int) -> bool:
    """Whether a group is a user's private one, as most systems make one for each."""
    try:
        found = grp.getgrgid(group)
    except KeyError:
        return False
    return found.gr_name == _user(user) and set(found.gr_mem) <= {found.gr_name}


def _user(number: int) -> str:
    try:
        return pwd.getpwuid(number).pw_name
    except KeyError:
        return str(number)


def _group(number: int) -> str:
    try:
        return grp.getgrgid(number).gr_name
    except KeyError:
        return str(number)
