"""Serial adapters that are on USB and have no port, and what has taken it from them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from pathlib import Path

from hapticd.device import Diagnosis

USB = Path("/sys/bus/usb/devices")

RULES = (Path("/usr/lib/udev/rules.d"), Path("/lib/udev/rules.d"), Path("/etc/udev/rules.d"))

ADAPTERS = {
    "0403:6001": ("FT232R", "ftdi_sio"),
    "0403:6014": ("FT232H", "ftdi_sio"),
    "0403:6015": ("FT231X", "ftdi_sio"),
    "067b:2303": ("PL2303", "pl2303"),
    "10c4:ea60": ("CP2102", "cp210x"),
    "1a86:5523": ("CH341", "ch341"),
    "1a86:7523": ("CH340", "ch341"),
    "1a86:55d4": ("CH9102", "cdc_acm"),
}
"""Chips of rigs' adapters and boards by vendor and product: what they are called, and their kernel driver."""


def without_port(with_port: Iterable[str]) -> list[Diagnosis]:
    """What is wrong with each adapter that is on USB and has no port.

    Args:
        with_port: vendor and product of each port that there is, `1a86:7523`.
    """
    lacking = sorted(_on_usb() & ADAPTERS.keys() - set(with_port))
    return [_taken(number) if _has_brltty() else _driverless(number) for number in lacking]


def _on_usb() -> set[str]:
    numbers = set()
    with contextlib.suppress(OSError):
        for device in USB.iterdir():
            with contextlib.suppress(OSError):  # an interface, or just going away
                vendor, product = ((device / name).read_text().strip() for name in ("idVendor", "idProduct"))
                numbers.add(f"{vendor}:{product}")
    return numbers


def _has_brltty() -> bool:
    return any(True for place in RULES for _ in place.glob("*brltty*.rules"))


def _taken(number: str) -> Diagnosis:
    text = f"a {ADAPTERS[number][0]} is on USB ({number}) and has no port: brltty takes it for a braille display"
    return Diagnosis("problem", text, ("sudo apt remove brltty  # then replug the rig",))


def _driverless(number: str) -> Diagnosis:
    name, driver = ADAPTERS[number]
    text = f"a {name} is on USB ({number}) and has no port: its kernel driver has not taken it"
    return Diagnosis("problem", text, (f"sudo modprobe {driver}  # then replug the rig; dmesg tells more",))
