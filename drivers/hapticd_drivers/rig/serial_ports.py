"""Serial ports: which there are, and which one is meant. None of it opens a port, since that resets many a board."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from serial.tools import list_ports

from hapticd.errors import DeviceNotFoundError

AUTO = "auto"
PATTERN = r"auto|/.+|usb:[0-9a-fA-F]{4}:[0-9a-fA-F]{4}(:.+)?"
"""What device.options.port may be."""

SYSFS = Path("/sys/bus/usb-serial/devices")


@dataclass(frozen=True, slots=True)
class Port:
    """A serial port.

    Attributes:
        path: its device file.
        name: what is plugged in, for people.
        usb: vendor and product, `2341:0043`; "" when it is not on USB.
        serial: serial number of what is plugged in; "" when it has none.
    """

    path: str
    name: str = "serial port"
    usb: str = ""
    serial: str = ""

    def __str__(self) -> str:
        identity = ":".join(filter(None, ("usb", self.usb, self.serial)))
        return f"{self.path} ({self.name}, {identity})" if self.usb else self.path


def usb_ports() -> list[Port]:
    """Every serial port that is on USB."""
    return [
        Port(
            found.device,
            found.product or found.description,
            f"{found.vid:04x}:{found.pid:04x}",
            found.serial_number or "",
        )
        for found in sorted(list_ports.comports())
        if found.vid is not None
    ]


def choose(wanted: str) -> Port:
    """The port that a configuration means.

    Args:
        wanted: device.options.port, which fits `PATTERN`.

    Raises:
        DeviceNotFoundError: there is none, or there are several.
    """
    if wanted.startswith("/"):
        return Port(wanted)
    there = usb_ports()
    fitting = [port for port in there if fits(port, wanted)]
    if len(fitting) == 1:
        return fitting[0]
    shown = ", ".join(map(str, there)) or "no serial port on USB at all"
    if not fitting:
        what = "a rig" if wanted == AUTO else wanted
        raise DeviceNotFoundError(f"serial-rig: {what} is not plugged in; there is {shown}")
    raise DeviceNotFoundError(
        f"serial-rig: device.options.port = {wanted!r} fits several ports, say which one is the rig: {shown}"
    )


def latency_timer(path: str) -> Path:
    """Where an FTDI adapter's latency timer is set; other adapters have none, and the file is not there."""
    return SYSFS / Path(path).resolve().name / "latency_timer"


def fits(port: Port, wanted: str) -> bool:
    """Whether a port on USB is one that device.options.port may mean."""
    if wanted == AUTO:
        return True
    found = re.fullmatch(r"usb:([0-9a-f]{4}:[0-9a-f]{4})(?::(.+))?", wanted, re.IGNORECASE)
    return found is not None and found[1].lower() == port.usb and found[2] in (None, port.serial)
