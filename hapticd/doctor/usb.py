"""Haptic devices on the bus, read from /sys: what is there, may this user open it, and who is in the way.

Nothing is opened: a serial port that is opened resets many a board.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from hapticd.doctor.finding import Finding, advice, ok, own_command, problem
from hapticd.doctor.rights import user_name
from hapticd.doctor.tree import ROOT, listed, read_if_there

_DEVICES = "sys/bus/usb/devices"
_HUB = "09"
_GREEDY = {"01": "audio", "0e": "video", "e0": "a radio", "08": "a disk"}
"""Interface classes that reserve time on a controller or keep it busy."""


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of haptic device.

    Attributes:
        name: what it is.
        vendor, product: USB identifiers, "" for every product of a vendor.
        drivers: names of the drivers that know it.
        hidraw: it is reached through a hidraw node, which only exists while usbhid is bound.
    """

    name: str
    vendor: str
    product: str
    drivers: tuple[str, ...] = ()
    hidraw: bool = False

    @property
    def identifiers(self) -> str:
        """As lsusb wants them."""
        return f"{self.vendor}:{self.product}"


KINDS = (
    Kind("a Force Dimension device", "1451", "", ("omega7",)),
    Kind("a Novint Falcon", "0403", "cb48", ("falcon", "novint-falcon")),
    Kind("a RawHID rig", "16c0", "0486", ("hid-rig",), hidraw=True),
    Kind("a 3D Systems Touch", "2988", "0302"),
)
_SERIAL_DRIVERS = ("serial-rig",)
_SERIAL_PORT = re.compile(r"tty(ACM|USB)\d+")
_LIBUSB_DRIVERS = ("omega7", "falcon", "novint-falcon")
_LIBRARIES = ("lib", "lib64", "usr/lib", "usr/lib64", "usr/local/lib", "usr/lib/x86_64-linux-gnu")


@dataclass(frozen=True, slots=True)
class Device:
    """A haptic device on the bus.

    Attributes:
        kind: which.
        path: its directory in /sys.
        product: what it calls itself.
        node: what is opened to reach it, below the root; None when there is no such node.
        bound: kernel drivers of its interfaces.
    """

    kind: Kind
    path: Path
    product: str
    node: Path | None
    bound: tuple[str, ...]

    @property
    def port(self) -> str:
        """Where it is plugged in, such as `1-2`."""
        return self.path.name


def devices(driver: str, root: Path = ROOT) -> list[Finding]:
    """Whether the configured device is there and may be opened, and which others are.

    Args:
        driver: name of the configured driver.
        root: the file system.
    """
    if driver in _SERIAL_DRIVERS:
        return _serial_ports(root)
    attached = list(_attached(root))
    found = [_seen(device, driver, root) for device in attached]
    wanted = [kind for kind in KINDS if driver in kind.drivers]
    for kind in wanted:
        if not any(device.kind is kind for device in attached):
            found.append(
                problem(
                    f"{kind.name} is configured, but none is on the bus",
                    f"lsusb -d {kind.identifiers}  # plug it in and switch it on until it is listed",
                )
            )
    if not found:
        there = "no haptic device that hapticd knows" if (root / _DEVICES).is_dir() else "no USB on this computer"
        return [ok(f"{there}; {driver} needs none of them")]
    return found


def kernel_drivers(driver: str, root: Path = ROOT) -> list[Finding]:
    """Whether a kernel driver or another program stands between the configured device and its driver.

    Args:
        driver: name of the configured driver.
        root: the file system.
    """
    return [_bound(device) for device in _configured(driver, root)] or [_no_device(driver)]


def controller(driver: str, root: Path = ROOT) -> list[Finding]:
    """Whether the configured device has to share its USB controller with something greedy.

    Args:
        driver: name of the configured driver.
        root: the file system.
    """
    return [_sharing(device, root) for device in _configured(driver, root)] or [_no_device(driver)]


def library(driver: str, root: Path = ROOT) -> Finding:
    """Whether libusb is there for a driver that needs it.

    Args:
        driver: name of the configured driver.
        root: the file system.
    """
    if driver not in _LIBUSB_DRIVERS:
        return ok("not needed for the configured driver")
    for place in _LIBRARIES:
        if any(file.name.startswith("libusb-1.0.so") for file in listed(root / place)):
            return ok(f"libusb-1.0 in /{place}")
    return problem(f"libusb-1.0 is not there, and {driver} needs it", "sudo apt install libusb-1.0-0")


def _configured(driver: str, root: Path) -> list[Device]:
    return [device for device in _attached(root) if driver in device.kind.drivers]


def _no_device(driver: str) -> Finding:
    """Of what is not on the bus nothing can be said."""
    known = any(driver in kind.drivers for kind in KINDS)
    return ok("nothing to look at: the device is not there" if known else "not needed for the configured driver")


def _attached(root: Path) -> Iterator[Device]:
    for path in listed(root / _DEVICES):
        vendor, product = read_if_there(path / "idVendor").lower(), read_if_there(path / "idProduct").lower()
        for kind in KINDS:
            if vendor == kind.vendor and kind.product in ("", product):
                node = _hidraw(path, root) if kind.hidraw else _usb_node(path, root)
                yield Device(kind, path, read_if_there(path / "product"), node, _drivers(path))


def _usb_node(path: Path, root: Path) -> Path | None:
    bus, number = read_if_there(path / "busnum"), read_if_there(path / "devnum")
    if not (bus.isdecimal() and number.isdecimal()):
        return None
    node = root / f"dev/bus/usb/{int(bus):03}/{int(number):03}"
    return node if node.exists() else None


def _hidraw(path: Path, root: Path) -> Path | None:
    for entry in sorted(path.glob("*/*/hidraw/hidraw*")):
        node = root / "dev" / entry.name
        if node.exists():
            return node
    return None


def _interfaces(path: Path) -> list[Path]:
    return [entry for entry in listed(path) if entry.name.startswith(f"{path.name}:")]


def _drivers(path: Path) -> tuple[str, ...]:
    links = [entry / "driver" for entry in _interfaces(path)]
    return tuple(sorted({link.resolve().name for link in links if link.is_symlink()}))


def _seen(device: Device, driver: str, root: Path) -> Finding:
    what = f"{device.product or device.kind.name} on port {device.port}"
    if driver not in device.kind.drivers:
        mine = f"driver = {device.kind.drivers[0]!r}" if device.kind.drivers else "hapticd has no driver for it"
        return ok(f"{what}, not the configured one ({mine})")
    if device.node is None:
        kind = "hidraw node" if device.kind.hidraw else "node in /dev/bus/usb"
        return problem(
            f"{what}, but without a {kind}",
            f"echo {device.port}:1.0 | sudo tee /sys/bus/usb/drivers/usbhid/bind"
            if device.kind.hidraw
            else "# in a container: pass it, --device=/dev/bus/usb or --bind=/dev/bus/usb",
        )
    shown = f"/{device.node.relative_to(root)}"
    if os.access(device.node, os.R_OK | os.W_OK):
        return ok(f"{what}: {user_name()} may open {shown}")
    return problem(
        f"{what}, but {user_name()} may not open {shown}",
        f"sudo {own_command('service', 'install')}",
        f"sudo usermod -aG hapticd {user_name()}  # then log in again and replug it",
    )


def _bound(device: Device) -> Finding:
    port = f"port {device.port}"
    if "usbfs" in device.bound and not device.kind.hidraw:
        node = f"/{'/'.join(device.node.parts[-5:])}" if device.node else ""
        return advice(f"{port}: a program has it open already", f"sudo fuser -v {node}".rstrip())
    if device.kind.hidraw and "usbhid" not in device.bound:
        there = ", ".join(device.bound) or "none"
        remedy = f"echo {device.port}:1.0 | sudo tee /sys/bus/usb/drivers/usbhid/bind"
        return problem(f"{port}: usbhid is not bound ({there}), so it cannot be reached", remedy)
    if "ftdi_sio" in device.bound:
        return ok(f"{port}: ftdi_sio, which the driver detaches")
    return ok(f"{port}: {', '.join(device.bound) or 'none'}")


def _sharing(device: Device, root: Path) -> Finding:
    own = _controller_of(device.path)
    others: dict[str, str] = {}
    for path in listed(root / _DEVICES):
        if path == device.path or not read_if_there(path / "idVendor") or _controller_of(path) != own:
            continue
        classes = {read_if_there(entry / "bInterfaceClass") for entry in _interfaces(path)} - {_HUB}
        for found in sorted(classes & _GREEDY.keys()):
            others[f"{read_if_there(path / 'product') or path.name} ({_GREEDY[found]})"] = path.name
    if not others:
        return ok(f"port {device.port}: nothing greedy on {own}")
    return advice(
        f"port {device.port} shares {own} with {', '.join(others)}: they disturb each other",
        "lsusb -t  # plug one of them where it is on another controller, a PCIe card if need be",
    )


def _controller_of(path: Path) -> str:
    """Name of the controller: what the root hub `usb1` hangs on."""
    real = path.resolve()
    for part in (real, *real.parents):
        if re.fullmatch(r"usb\d+", part.name):
            return part.parent.name
    return real.parent.name


def _serial_ports(root: Path) -> list[Finding]:
    ports = [entry.name for entry in listed(root / "sys/class/tty") if _SERIAL_PORT.fullmatch(entry.name)]
    if not ports:
        return [problem("no serial port on USB", "ls -l /dev/serial/by-id  # plug the rig in until it is listed")]
    found = []
    for port in ports:
        interface = (root / "sys/class/tty" / port / "device").resolve()
        name = _nearest(interface, "product")
        what = f"/dev/{port}" + (f" ({name})" if name else "")
        if not os.access(root / "dev" / port, os.R_OK | os.W_OK):
            remedy = f"sudo usermod -aG dialout {user_name()}  # then log in again"
            found.append(problem(f"{what}: {user_name()} may not open it", remedy))
            continue
        latency_ms = read_if_there(root / f"sys/bus/usb-serial/devices/{port}/latency_timer")
        if latency_ms not in ("", "1"):
            remedy = f"echo 1 | sudo tee /sys/bus/usb-serial/devices/{port}/latency_timer"
            found.append(advice(f"{what}: the adapter keeps bytes back for {latency_ms} ms", remedy))
        else:
            found.append(ok(f"{what}: {user_name()} may open it"))
    return found


def _nearest(path: Path, attribute: str) -> str:
    """An attribute of a directory in /sys or of the nearest one above that has it."""
    for directory in (path, *list(path.parents)[:3]):
        said = read_if_there(directory / attribute)
        if said:
            return said
    return ""
