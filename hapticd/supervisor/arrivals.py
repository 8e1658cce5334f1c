"""Sees that something was plugged in, from the kernel's lists of devices: no driver and no device is asked."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

PLACES = (Path("/sys/bus/usb/devices"), Path("/sys/class/hidraw"), Path("/sys/class/tty"))
"""Directories with an entry a device."""

EVERY_S = 0.25
"""How often the lists are looked at [s]; a look takes some 50 us."""


class Arrivals:
    """What was plugged in since the last look."""

    def __init__(self) -> None:
        self._seen = _listed()
        self._due_s = 0.0

    def news(self) -> bool:
        """Whether a device has come since this was asked last."""
        now_s = time.monotonic()
        if now_s < self._due_s:
            return False
        self._due_s = now_s + EVERY_S
        before, self._seen = self._seen, _listed()
        return not self._seen <= before


def _listed() -> set[Path]:
    seen: set[Path] = set()
    for place in PLACES:
        with contextlib.suppress(OSError):  # a computer without such devices has no list of them
            seen.update(place.iterdir())
    return seen
