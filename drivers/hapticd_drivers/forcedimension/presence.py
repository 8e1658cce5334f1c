"""What USB shows of the devices that the SDK drives, for when the SDK finds none and does not say why."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import usb.core

from hapticd.errors import (
    DeviceBusyError,
    DeviceNotFoundError,
    DevicePermissionError,
    DriverError,
)

VENDOR = 0x1451
"""Matched by the vendor alone: the product number follows the controller's generation, not the model."""

RULE = 'SUBSYSTEM=="usb", ATTR{idVendor}=="1451", MODE="0660", GROUP="plugdev", TAG+="uaccess"'
"""The one line of a udev rule that lets a user open the device; hapticd's own rules do the same."""

FALCON = (0x0403, 0xCB48)
"""The Novint Falcon, by vendor and product: the vendor is that of its USB chip."""

FALCON_RULE = RULE.replace(
    'ATTR{idVendor}=="1451"', f'ATTR{{idVendor}}=="{FALCON[0]:04x}", ATTR{{idProduct}}=="{FALCON[1]:04x}"'
)

PLUG_IT_IN = "plug it in, and switch its power supply on: lsusb shows 1451:..., or 0403:cb48"


@dataclass(frozen=True, slots=True)
class Obstacle:
    """What keeps this user from a device.

    Attributes:
        kind: the error that it is.
        text: what is so.
        mend: lines for a shell that mend it, or comments.
    """

    kind: type[DriverError]
    text: str
    mend: tuple[str, ...]

    def error(self, cause: str = "") -> DriverError:
        """The same to raise; `cause` is what the SDK said."""
        said = f" ({cause.removeprefix('omega7: ')})" if cause else ""
        return self.kind(f"omega7: {self.text}{said}: {'; '.join(line.removeprefix('# ') for line in self.mend)}")


@dataclass(frozen=True, slots=True)
class UsbDevice:
    """A device that the SDK drives, as USB shows it.

    Attributes:
        name: what it is, for people, with its article.
        number: vendor and product, `1451:0402`.
        where: bus and address, `001:005`.
        obstacle: what keeps this user from it; None when nothing on USB does.
    """

    name: str
    number: str
    where: str
    obstacle: Obstacle | None


def look(backend: Any = None, nodes: Path = Path("/dev/bus/usb"), processes: Path = Path("/proc")) -> list[UsbDevice]:
    """Every device on USB that the SDK drives, and what is wrong with each; none when USB cannot be asked.

    Args:
        backend: pyusb backend; None takes libusb.
        nodes: where the device nodes are.
        processes: where the processes are.
    """
    found = []
    with contextlib.suppress(usb.core.NoBackendError):
        for device in _on_bus(backend):
            name = _name(device)
            if name:
                number = f"{device.idVendor:04x}:{device.idProduct:04x}"
                where = f"{device.bus or 0:03d}:{device.address or 0:03d}"
                node = nodes / where[:3] / where[4:]
                found.append(
                    UsbDevice(name, number, where, _obstacle(device, f"{name} is on USB ({number})", node, processes))
                )
    return found


def explain(backend: Any = None, nodes: Path = Path("/dev/bus/usb"), processes: Path = Path("/proc")) -> Obstacle:
    """Why the SDK finds no device.

    Args:
        backend: pyusb backend; None takes libusb.
        nodes: where the device nodes are.
        processes: where the processes are.
    """
    try:
        _on_bus(backend)
    except usb.core.NoBackendError:
        return Obstacle(
            DeviceNotFoundError,
            "no device found; libusb-1.0 is not installed, which the SDK needs as well",
            ("sudo apt install libusb-1.0-0",),
        )
    seen = look(backend, nodes, processes)
    if seen:
        return next((device.obstacle for device in seen if device.obstacle is not None), None) or unseen(seen[0])
    return Obstacle(DeviceNotFoundError, "no Force Dimension device is on USB, and no Falcon", (f"# {PLUG_IT_IN}",))


def unseen(device: UsbDevice) -> Obstacle:
    """That the SDK does not find a device which nothing on USB keeps from it."""
    return Obstacle(
        DeviceNotFoundError,
        f"{device.name} is on USB ({device.number}, {device.where}) and may be opened, yet the SDK does not find it",
        ("# switch it off and on again; if that does not help, the SDK may be older than the device",),
    )


def _on_bus(backend: Any) -> Iterator[Any]:
    found: Iterator[Any] = usb.core.find(find_all=True, backend=backend)
    return found


def _name(device: Any) -> str:
    """What a device on USB is; "" when it is none that the SDK drives."""
    if device.idVendor == VENDOR:
        return "a Force Dimension device"
    return "a Novint Falcon" if (device.idVendor, device.idProduct) == FALCON else ""


def _obstacle(device: Any, name: str, node: Path, processes: Path) -> Obstacle | None:
    if not _may_open(node):
        rule = RULE if device.idVendor == VENDOR else FALCON_RULE
        return Obstacle(
            DevicePermissionError,
            f"{name} but this user may not open {node}",
            (
                "sudo hapticd service install",
                "# then replug it; or only the rule, without the service:",
                f"echo '{rule}' | sudo tee /etc/udev/rules.d/70-force-dimension.rules && sudo udevadm control --reload",
            ),
        )
    holder = _holder(node, processes)
    if holder:
        return Obstacle(DeviceBusyError, f"{name} but {holder} has it open", ("# end that program first",))
    with contextlib.suppress(usb.core.USBError, NotImplementedError):
        if device.is_kernel_driver_active(0):
            return Obstacle(
                DeviceBusyError,
                f"{name} but a kernel driver has taken its interface",
                ("lsusb -t  # names the driver", "sudo modprobe -r DRIVER"),
            )
    return None


def _may_open(node: Path) -> bool:
    """Whether the kernel lets this user open a node, which it alone knows: there are ACLs, and rules of containers."""
    try:
        os.close(os.open(node, os.O_RDWR | os.O_CLOEXEC))
    except PermissionError:
        return False
    except OSError:  # there is no node, or the device is just going away
        pass
    return True


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
