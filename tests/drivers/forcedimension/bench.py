"""The fake SDK: built once from C, and its devices as a test sees and moves them, beside what the driver sees."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from hapticd_drivers.forcedimension import discovery
from hapticd_drivers.forcedimension.driver import ForceDimension
from hapticd_drivers.forcedimension.options import ForceDimensionOptions

SOURCES = Path(__file__).parent / "fake"
RIGHT, LEFT = 35, 37
IDLE, FORCE, BRAKE = 1, 2, 3
NONE, BUTTON, VELOCITY, WATCHDOG, SOFTWARE = range(5)
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


class Bench:
    """The devices behind the fake SDK.

    Args:
        directory: where it was built.
        file: devices that other processes share; None for some of this process's own, fresh from the box.
    """

    def __init__(self, directory: Path, file: Path | None = None) -> None:
        self.directory = directory
        self.library = ctypes.CDLL(str(directory / "libdrd.so.3"))
        self.library.fake_set.argtypes = [ctypes.c_int, ctypes.c_char_p, ctypes.c_int, ctypes.c_double]
        self.library.fake_get.argtypes = [ctypes.c_int, ctypes.c_char_p, ctypes.c_int]
        self.library.fake_get.restype = ctypes.c_double
        self.library.fake_advance.argtypes = [ctypes.c_double]
        self.attach(file)

    def attach(self, file: Path | None) -> None:
        """Turn to the devices in a file, or with None to new ones; a process sees one bench at a time."""
        assert self.library.fake_attach(None if file is None else str(file).encode()) == 0

    def die(self) -> None:
        """The program that drove the devices is gone, without a word to them."""
        self.library.fake_die()
        discovery._in_use.clear()

    def set(self, device: int = 0, **values: float | Sequence[float]) -> None:
        """Set numbers of a device, or of the bench for device -1."""
        for name, value in values.items():
            for index, number in enumerate(value if isinstance(value, Sequence) else [value]):
                self.library.fake_set(device, name.encode(), index, float(number))

    def get(self, name: str, device: int = 0, index: int = 0) -> float:
        """A number of a device now, or of the bench for device -1."""
        value: float = self.library.fake_get(device, name.encode(), index)
        return value

    def vector(self, name: str, device: int = 0) -> list[float]:
        return [self.get(name, device, index) for index in range(3)]

    def advance(self, us: float) -> None:
        """Let time pass in which nobody calls."""
        self.library.fake_advance(us)

    def press_force_button(self, device: int = 0) -> None:
        self.library.fake_press_force_button(device)

    def clear_log(self) -> None:
        self.library.fake_clear_log()

    def log(self) -> list[str]:
        """The SDK's functions that were called since the log was cleared, in order."""
        text = ctypes.create_string_buffer(65536)
        self.library.fake_log(text, len(text))
        return text.value.decode().split()

    def expert(self) -> bool:
        return bool(self.library.fake_expert())

    def driver(self, period_s: float = 1e-3, **options: Any) -> ForceDimension:
        """A closed driver for the devices of this bench."""
        keys = {"library": str(self.directory), **options}
        return ForceDimension(ForceDimensionOptions.model_validate(keys), period_s)
