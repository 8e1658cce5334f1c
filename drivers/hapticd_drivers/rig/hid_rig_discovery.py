"""Which HID rigs are there, and how one of them is opened.

Package `hidapi` has two modules: `hidraw`, which goes through the kernel's HID driver, and `hid`, which goes past it
with libusb. The first is meant to be used; the second is for a kernel without hidraw.
"""

from __future__ import annotations

import fcntl
import importlib
import os
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from hapticd.device import Diagnosis, FoundDevice
from hapticd.errors import (
    DeviceBusyError,
    DeviceDisconnectedError,
    DeviceNotFoundError,
    DevicePermissionError,
    DriverError,
)
from hapticd_drivers.rig.hid_rig_options import HidRigOptions

HIDRAW_CLASS = Path("/sys/class/hidraw")
"""Is there from the start, with no device at all, where the kernel knows hidraw."""

INSTALL_RULE = "sudo hapticd service install  # then replug"
"""Gives the user the device, as a line for a shell."""

SAY_WHICH = "# in the configuration, [device.options]: serial = ...; hapticd devices hid-rig lists them"
"""What to do where it is not clear which rig is meant."""

_MODULES = {"hidraw": "hidraw", "libusb": "hid"}

_RAW_INTERFACE = 0
"""Where a Teensy has its raw reports; libusb does not tell the usage page that would say so."""


@dataclass(frozen=True, slots=True)
class HidDevice:
    """A device that has what was looked for, except perhaps its serial number.

    Attributes:
        backend: `hidraw` or `libusb`.
        path: by which the backend knows it.
        product: what it calls itself.
        serial: its serial number; "" without one.
    """

    backend: str
    path: bytes
    product: str
    serial: str

    @property
    def where(self) -> str:
        """Where it is, for people."""
        return self.path.decode(errors="replace")


@dataclass(frozen=True, slots=True)
class OpenHid:
    """A device that is open.

    Attributes:
        device: hidapi's handle; reading never waits.
        found: which one it is.
        guard: descriptor that keeps other programs of hapticd away; None where the backend itself does.
    """

    device: Any
    found: HidDevice
    guard: int | None

    def close(self) -> None:
        """Give it back."""
        self.device.close()
        if self.guard is not None:
            os.close(self.guard)


def look(options: HidRigOptions) -> list[HidDevice]:
    """Every device that has the numbers looked for, whatever its serial number; none is opened.

    With `backend = "auto"` it depends on this computer and not on what it shows at the moment: a rig that was just
    plugged in is on USB before its hidraw node is there.
    """
    backend = _chosen(options)
    module = _module(backend)
    entries = () if module is None else module.enumerate(options.vendor_id, options.product_id)
    return [_device(backend, entry) for entry in entries if _fits(entry, options)]


def open_device(options: HidRigOptions) -> OpenHid:
    """Open the device with the serial number looked for, or the only one.

    Raises:
        DriverError: there is none, there are several, or it cannot be opened.
    """
    found = look(options)
    if not found:
        looked_for = f"{_numbers(options)} with usage page 0x{options.usage_page:04x}"
        raise DeviceNotFoundError(f"hid-rig: no HID device {looked_for} is plugged in (lsusb)")
    wanted, unclear = _meant(found, options)
    if wanted is None:
        raise DeviceNotFoundError(f"hid-rig: {unclear}")
    return _opened(wanted)


def find_devices(options: HidRigOptions) -> list[FoundDevice]:
    """Every rig that is there, whether it can be used or not; each is opened for a moment, and hears nothing."""
    devices = []
    for found in look(options):
        problem = ""
        mend: tuple[str, ...] = ()
        try:
            _opened(found).close()
        except DriverError as error:
            problem = str(error)
            mend = (INSTALL_RULE,) if isinstance(error, DevicePermissionError) else ()
        devices.append(FoundDevice(found.product or "HID rig", found.serial, found.where, problem, mend=mend))
    return devices


def diagnose(options: HidRigOptions) -> list[Diagnosis]:
    """Whether hidapi and the kernel have what the driver needs, and whether it is clear which rig is meant."""
    backend = _chosen(options)
    module = _module(backend)
    if module is None:
        text = f"the installed hidapi has no module {_MODULES[backend]}, which device.options.backend needs"
        return [Diagnosis("problem", text, ("pip install --force-reinstall hidapi",))]
    if backend == "libusb" and options.backend == "auto":
        told = Diagnosis("advice", "no hidraw here: the rig is reached through libusb, which is slower")
    else:
        told = Diagnosis("ok", f"hidapi {module.version_str()} reaches the rig through {backend}")
    _, unclear = _meant(look(options), options)
    return [told, Diagnosis("problem", unclear, (SAY_WHICH,))] if unclear else [told]


def _chosen(options: HidRigOptions) -> str:
    if options.backend != "auto":
        return options.backend
    return "hidraw" if _module("hidraw") is not None and HIDRAW_CLASS.exists() else "libusb"


def _module(backend: str) -> ModuleType | None:
    try:
        return importlib.import_module(_MODULES[backend])
    except ImportError:  # a hidapi that was built without it, or libusb is not there
        return None


def _numbers(options: HidRigOptions) -> str:
    return f"{options.vendor_id:04x}:{options.product_id:04x}"


def _meant(found: list[HidDevice], options: HidRigOptions) -> tuple[HidDevice | None, str]:
    """Which of these is meant, or why that is not clear; of none, none, and nothing is unclear."""
    wanted = [device for device in found if options.serial in (None, device.serial)]
    if len(wanted) == 1 or not found:
        return (wanted[0] if wanted else None), ""
    there = ", ".join(f"{device.serial or 'one without serial number'} ({device.where})" for device in found)
    if not wanted:
        return None, f'no {_numbers(options)} has serial number "{options.serial}"; there is {there}'
    return None, f"several {_numbers(options)} are plugged in: set device.options.serial; there is {there}"


def _fits(entry: dict[str, Any], options: HidRigOptions) -> bool:
    page, usage = entry["usage_page"], entry["usage"]
    unsaid = page == 0 and entry["interface_number"] == _RAW_INTERFACE
    return unsaid or (page, usage) == (options.usage_page, options.usage)


def _device(backend: str, entry: dict[str, Any]) -> HidDevice:
    return HidDevice(backend, entry["path"], entry["product_string"] or "", entry["serial_number"] or "")


def _opened(found: HidDevice) -> OpenHid:
    guard = _guarded(found) if found.backend == "hidraw" else None
    module = _module(found.backend)
    assert module is not None
    device = module.device()
    try:
        device.open_path(found.path)
        device.set_nonblocking(1)
    except OSError as error:
        if guard is not None:
            os.close(guard)
        if found.backend == "libusb":
            raise DevicePermissionError(
                f"hid-rig: {found.product} cannot be opened through libusb: {_rule()}, or another program has it open"
            ) from error
        raise DeviceDisconnectedError(f"hid-rig: {found.where} was there and cannot be opened any more") from error
    return OpenHid(device, found, guard)


def _guarded(found: HidDevice) -> int:
    """Open the node for ourselves alone: hidraw gives it to everybody, and a second HELLO would take the force away."""
    try:
        descriptor = os.open(found.path, os.O_RDWR | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    except PermissionError as error:
        raise DevicePermissionError(f"hid-rig: this user may not open {found.where}: {_rule()}") from error
    except OSError as error:
        raise DeviceDisconnectedError(f"hid-rig: {found.where} was there and is gone ({error.strerror})") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        raise DeviceBusyError(f"hid-rig: another program has {found.where} open; end it first") from error
    return descriptor


def _rule() -> str:
    return f"install the udev rule: {INSTALL_RULE.replace('  # ', ', ')}"
