"""An edited configuration file, put in the place of the one that a running daemon has in force."""

from __future__ import annotations

from pathlib import Path

from hapticd.client.commands import RefusedConfigError, command
from hapticd.config.file import read, replace


def put_into_force(path: Path, before: str, after: str, instance: str) -> None:
    """Replace the file and have the daemon take it over; a file that it refuses is as it was before.

    Args:
        path: the file that the daemon runs.
        before: its text.
        after: the text that it gets.
        instance: which daemon on this computer.

    Raises:
        ConfigError: this user may not replace the file.
        InstanceError: no daemon answers; the file has its new text.
        RefusedConfigError: the daemon refuses it; the message names every problem.
    """
    if after != before:
        replace(path, after)
    try:
        command("reload", instance, wait=True)
    except RefusedConfigError:
        if after != before and read(path) == after:  # it was not edited again since
            replace(path, before)
        raise
