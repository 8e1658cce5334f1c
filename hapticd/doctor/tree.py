"""Small files of /proc and /sys below a root, any of which may be missing."""

from __future__ import annotations

import gzip
from pathlib import Path

ROOT = Path("/")


def read(path: Path) -> str:
    """What a file says, without the line end.

    Raises:
        OSError: it cannot be read.
    """
    return path.read_text(errors="replace").strip()


def read_if_there(path: Path) -> str:
    """What a file says; empty when it is not there or not for this user."""
    try:
        return read(path)
    except OSError:
        return ""


def listed(directory: Path) -> list[Path]:
    """What is in a directory, in order; nothing when it is not there."""
    try:
        return sorted(directory.iterdir())
    except (FileNotFoundError, NotADirectoryError):
        return []


def under(root: Path, path: Path | str) -> Path:
    """Where an absolute path lies below a root."""
    return root / str(path).lstrip("/")


def numbers(text: str) -> set[int]:
    """The processors of a list such as `0-3,6`."""
    found: set[int] = set()
    for part in filter(None, text.split(",")):
        first, _, last = part.partition("-")
        found.update(range(int(first), int(last or first) + 1))
    return found


def kernel_options(root: Path) -> dict[str, str]:
    """How the kernel was built, such as `CONFIG_HZ` to `250`; empty where nothing tells."""
    try:
        text = gzip.decompress((root / "proc/config.gz").read_bytes()).decode(errors="replace")
    except (OSError, EOFError):
        release = read_if_there(root / "proc/sys/kernel/osrelease")
        text = read_if_there(root / f"boot/config-{release}")
    return dict(line.split("=", 1) for line in text.splitlines() if line.startswith("CONFIG_") and "=" in line)


def boot_arguments(root: Path) -> dict[str, str]:
    """What the kernel was started with."""
    arguments = read_if_there(root / "proc/cmdline").split(" -- ")[0].split()
    return {name: value for name, _, value in (argument.partition("=") for argument in arguments)}
