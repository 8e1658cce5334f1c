"""Where the fault records of an instance lie: the daemon and everyone who reads them ask here."""

from __future__ import annotations

import os
from pathlib import Path

from hapticd.telemetry.endpoint import named_directory

_SYSTEM = Path("/var/lib/hapticd")
_FAULTS = "faults"


def fault_directory(instance: str) -> Path:
    """Directory in which a daemon of this user keeps the fault records of an instance.

    Below $HAPTICD_STATE_DIR/<instance>, else systemd's $STATE_DIRECTORY, else /var/lib/hapticd/<instance> for root,
    else $XDG_STATE_HOME/hapticd/<instance>, which is ~/.local/state/hapticd/<instance> where that is not set.

    Raises:
        ConfigError: the instance's name is none that a directory could have.
    """
    given = named_directory("STATE", instance)
    if given is not None:
        return given / _FAULTS
    return (_SYSTEM / instance if os.geteuid() == 0 else _user(instance)) / _FAULTS


def fault_directories(instance: str) -> list[Path]:
    """Where to look for the fault records of an instance: the system's daemon, and this user's own.

    Raises:
        ConfigError: the instance's name is none that a directory could have.
    """
    given = named_directory("STATE", instance)
    if given is not None:
        return [given / _FAULTS]
    return [_SYSTEM / instance / _FAULTS, _user(instance) / _FAULTS]


def _user(instance: str) -> Path:
    home = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local/state"
    return Path(home) / "hapticd" / instance
