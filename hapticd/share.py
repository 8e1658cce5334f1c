"""Where the files are that hapticd ships besides its code: in a source checkout or in an installed wheel."""

from __future__ import annotations

from pathlib import Path

SYSTEM_CONFIG = Path("/etc/hapticd/hapticd.toml")

_PACKAGE = Path(__file__).parent


def directory(name: str) -> Path:
    """A directory of shipped files, such as `config`."""
    installed = _PACKAGE / "share" / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


def default_config() -> Path:
    """The configuration of a command that was given none: the machine's own, else the shipped example."""
    try:
        SYSTEM_CONFIG.stat()
    except (FileNotFoundError, NotADirectoryError):
        return directory("config") / "hapticd.toml"
    except OSError:
        pass  # it is there; reading it will say what is wrong with it
    return SYSTEM_CONFIG
