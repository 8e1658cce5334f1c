"""The fake SDK, built from C as the two libraries that the vendor's SDK has."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

SOURCES = Path(__file__).parent / "fake"
_LIBDHD = ("bench.c", "device.c", "dhd.c")


def build(directory: Path, *flags: str) -> Path:
    """Compile the fake as libdhd.so.3 and libdrd.so.3, and the C caller beside them."""
    if shutil.which("cc") is None:
        pytest.skip("no C compiler: sudo apt install gcc")
    directory.mkdir(parents=True, exist_ok=True)
    near = ["-L" + str(directory), "-Wl,--no-as-needed", "-Wl,-rpath,$ORIGIN"]
    shared = ["-shared", "-fPIC"]
    _cc(directory, *flags, *shared, "-Wl,-soname,libdhd.so.3", *_LIBDHD, "-lm", out="libdhd.so.3")
    _cc(directory, *flags, *shared, "-Wl,-soname,libdrd.so.3", "drd.c", *near, "-l:libdhd.so.3", out="libdrd.so.3")
    if not flags:
        _cc(directory, "abi.c", *near, "-l:libdrd.so.3", "-l:libdhd.so.3", out="abi")
    return directory


def _cc(directory: Path, *arguments: str, out: str) -> None:
    command = ["cc", "-std=gnu17", "-O2", "-g", "-Wall", "-Wextra", "-Werror", *arguments, "-o", str(directory / out)]
    subprocess.run(command, cwd=SOURCES, check=True)
