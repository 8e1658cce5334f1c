"""The fake SDK's devices as a test sees and moves them, beside what the driver sees."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hapticd_drivers.forcedimension import discovery
from hapticd_drivers.forcedimension.driver import ForceDimension
from hapticd_drivers.forcedimension.options import ForceDimensionOptions

RIGHT, LEFT = 35, 37
RESET, IDLE, FORCE, BRAKE = range(4)
NONE, BUTTON, VELOCITY, WATCHDOG, SOFTWARE = range(5)


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
