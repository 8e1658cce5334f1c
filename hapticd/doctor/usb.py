"""Who shares a USB controller with the device, read from /sys; nothing is opened."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from hapticd.doctor.finding import Finding, advice, ok
from hapticd.doctor.tree import ROOT, listed, read_if_there, under

_DEVICES = "sys/bus/usb/devices"
_HUB = "09"
_GREEDY = {"01": "audio", "0e": "video", "e0": "a radio", "08": "a disk"}
"""Interface classes that reserve time on a controller or keep it busy."""


def controller(places: Sequence[str], root: Path = ROOT) -> list[Finding]:
    """Whether devices have to share their USB controllers with something greedy.

    Args:
        places: where they are, as their driver says: a node in /dev, `bus:address`, or a port.
        root: the file system.
    """
    found = [path for path in (_on_usb(place, root) for place in places) if path is not None]
    return [_sharing(path, root) for path in found] or [ok("no device on USB whose place is known")]


def _on_usb(place: str, root: Path) -> Path | None:
    """Directory in /sys of a device; None when it is not on USB, or that is unknown."""
    if place.startswith("/"):
        name = under(root, place).resolve().name
        links = [root / "sys/class" / kind / name / "device" for kind in ("hidraw", "tty")]
        above = (parent for link in links if link.exists() for parent in (link.resolve(), *link.resolve().parents))
        return next((path for path in above if (path / "idVendor").exists()), None)
    for path in listed(root / _DEVICES):
        address = [read_if_there(path / number).zfill(3) for number in ("busnum", "devnum")]
        if place == ":".join(address) or place.partition(":")[0] == path.name:
            return path.resolve()
    return None


def _sharing(device: Path, root: Path) -> Finding:
    own = _controller_of(device)
    others = []
    for path in listed(root / _DEVICES):
        if path.resolve() == device or not read_if_there(path / "idVendor") or _controller_of(path) != own:
            continue
        classes = {read_if_there(entry / "bInterfaceClass") for entry in _interfaces(path)} - {_HUB}
        name = read_if_there(path / "product") or path.name
        others += [f"{name} ({_GREEDY[found]})" for found in sorted(classes & _GREEDY.keys())]
    if not others:
        return ok(f"port {device.name}: nothing greedy on {own}")
    return advice(
        f"port {device.name} shares {own} with {', '.join(others)}: they disturb each other",
        "lsusb -t  # plug one of them where it is on another controller, a PCIe card if need be",
    )


def _interfaces(path: Path) -> list[Path]:
    return [entry for entry in listed(path) if entry.name.startswith(f"{path.name}:")]


def _controller_of(path: Path) -> str:
    """Name of the controller: what the root hub `usb1` hangs on."""
    real = path.resolve()
    for part in (real, *real.parents):
        if re.fullmatch(r"usb\d+", part.name):
            return part.parent.name
    return real.parent.name
