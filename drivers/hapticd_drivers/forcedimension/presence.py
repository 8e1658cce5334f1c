"""What USB shows of Force Dimension's devices, for when the SDK finds none and does not say why."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import usb.core

from hapticd.contracts.errors import (
    DeviceBusyError,
    DeviceNotFoundError,
    DevicePermissionError,
    DriverError,
)

VENDOR = 0x1451
"""Matched by the vendor alone: the product number follows the controller's generation, not the model."""

RULE = 'SUBSYSTEM=="usb", ATTR{idVendor}=="1451", MODE="0660", GROUP="plugdev", TAG+="uaccess"'
"""The one line of a udev rule that lets a user open the device; hapticd's own rules do the same."""

_FALCON = (0x0403, 0xCB48)


@dataclass(frozen=True, slots=True)
class UsbDevice:
    """A device of Force Dimension as USB shows it.

    Attributes:
        product: USB product number.
        where: bus and address, `001:005`.
        problem: what keeps this user from it; None when nothing on USB does.
    """

    product: int
    where: str
    problem: DriverError | None


def present(backend: Any = None) -> bool:
    """Whether a Force Dimension device is plugged in, or USB cannot be asked.

    It is cheap and leaves the device alone, where each attempt to open one has the SDK scan all of USB.
    """
    try:
        return any(device.idVendor == VENDOR for device in _on_bus(backend))
    except usb.core.NoBackendError:
        return True


def look(backend: Any = None, nodes: Path = Path("/dev/bus/usb"), processes: Path = Path("/proc")) -> list[UsbDevice]:
    """Every Force Dimension device on USB, and what is wrong with each.

    Args:
        backend: pyusb backend; None takes libusb.
        nodes: where the device nodes are.
        processes: where the processes are.
    """
    found = []
    for device in _on_bus(backend):
        if device.idVendor == VENDOR:
            where = f"{device.bus or 0:03d}:{device.address or 0:03d}"
            node = nodes / where[:3] / where[4:]
            found.append(UsbDevice(device.idProduct, where, _problem(device, node, processes)))
    return found


def explain(backend: Any = None, nodes: Path = Path("/dev/bus/usb"), processes: Path = Path("/proc")) -> DriverError:
    """Why the SDK finds no device.

    Args:
        backend: pyusb backend; None takes libusb.
        nodes: where the device nodes are.
        processes: where the processes are.
    """
    try:
        seen = look(backend, nodes, processes)
        others = {(device.idVendor, device.idProduct) for device in _on_bus(backend)}
    except usb.core.NoBackendError:
        return DeviceNotFoundError(
            "omega7: no device found; libusb-1.0 is not installed, which the SDK needs as well: "
            "sudo apt install libusb-1.0-0"
        )
    for device in seen:
        if device.problem is not None:
            return device.problem
    if seen:
        name = f"{VENDOR:04x}:{seen[0].product:04x}, {seen[0].where}"
        return DeviceNotFoundError(
            f"omega7: a Force Dimension device is on USB ({name}) and may be opened, yet the SDK does not find it: "
            "switch it off and on again; if that does not help, the SDK may be older than the device"
        )
    if _FALCON in others:
        return DeviceNotFoundError(
            "omega7: only a Novint Falcon is plugged in, which is not driven through the Force Dimension SDK"
        )
    return DeviceNotFoundError(
        "omega7: no Force Dimension device is on USB: plug it in, and switch its power supply on (lsusb shows 1451:...)"
    )


def _on_bus(backend: Any) -> Iterator[Any]:
    found: Iterator[Any] = usb.core.find(find_all=True, backend=backend)
    return found


def _problem(device: Any, node: Path, processes: Path) -> DriverError | None:
    name = f"a Force Dimension device is on USB ({VENDOR:04x}:{device.idProduct:04x})"
    # By the effective user: that is whom the kernel will ask.
    if node.exists() and not os.access(node, os.R_OK | os.W_OK, effective_ids=True):
        return DevicePermissionError(
            f"omega7: {name} but this user may not open {node}; install the rule: sudo hapticd service install, then "
            f"replug; or write it yourself to /etc/udev/rules.d/70-force-dimension.rules: {RULE}"
        )
    holder = _holder(node, processes)
    if holder:
        return DeviceBusyError(f"omega7: {name} but {holder} has it open; end that program first")
    with contextlib.suppress(usb.core.USBError, NotImplementedError):
        if device.is_kernel_driver_active(0):
            return DeviceBusyError(
                f"omega7: {name} but a kernel driver has taken its interface; `lsusb -t` names the driver, and "
                "`sudo modprobe -r DRIVER` frees the device"
            )
    return None


def _holder(node: Path, processes: Path) -> str:
    """The process that has a node open, `process 1234 (omega)`; "" when none is seen."""
    own = str(os.getpid())
    for process in processes.glob("[0-9]*"):
        if process.name == own:
            continue
        with contextlib.suppress(OSError):  # it ended, or belongs to somebody else
            if any(link.readlink() == node for link in (process / "fd").iterdir()):
                return f"process {process.name} ({(process / 'comm').read_text().strip()})"
    return ""
