"""A driver of somebody's own, installed for a test as an entry point that child processes see."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest


def write_module(directory: Path, monkeypatch: pytest.MonkeyPatch, *methods: str) -> None:
    """Write `mylab.rig`, which no package installs, and let child processes import it."""
    (directory / "mylab").mkdir()
    (directory / "mylab" / "rig.py").write_text(_source(methods))
    monkeypatch.setenv("PYTHONPATH", str(directory))


def install(directory: Path, monkeypatch: pytest.MonkeyPatch, *methods: str, name: str = "odd") -> None:
    """Install a driver with these class methods, each in one line: `find(cls, options=None): return []`."""
    module = f"{name}_driver"
    information = directory / f"{name}-1.dist-info"
    information.mkdir(parents=True)
    (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1\n")
    (information / "entry_points.txt").write_text(f"[hapticd.drivers]\n{name} = {module}:Driver\n")
    (directory / f"{module}.py").write_text(_source(methods))
    monkeypatch.setenv("PYTHONPATH", str(directory))


def _source(methods: Sequence[str]) -> str:
    lines = [
        "import ctypes, os, time",
        "from hapticd.device import Diagnosis",
        "from hapticd.device import FoundDevice",
        "from hapticd.errors import DriverError",
        "from hapticd_drivers.loopback import Loopback",
        "class Driver(Loopback):",
        "    '''Somebody's own.'''",
        *(line for method in methods for line in ("    @classmethod", f"    def {method}")),
    ]
    return "\n".join(lines) + "\n"
