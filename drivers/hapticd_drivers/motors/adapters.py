"""Adapters and CAN interfaces as `hapticd devices` and `hapticd doctor` list them; none is opened."""

from __future__ import annotations

import os

from hapticd.device import FoundDevice
from hapticd_drivers.motors.link import carries_fd, is_up

_BEHIND = "which controllers are behind it shows when it is opened"


def found_port(model: str, path: str, serial: str = "") -> FoundDevice:
    """An adapter on a serial port, and whether this user may open it.

    Args:
        model: what it is.
        path: of the port.
        serial: its serial number.
    """
    if os.access(path, os.R_OK | os.W_OK):
        return FoundDevice(model, serial, path, note=_BEHIND)
    join = "sudo usermod -aG dialout $USER  # then log in again"
    return FoundDevice(model, serial, path, problem="this user may not open it", mend=(join,))


def found_interface(name: str, up: str, fd: bool) -> FoundDevice:
    """A CAN interface of the kernel, and whether it can be used as it is.

    Args:
        name: as `ip link` calls it.
        up: the line for a shell that brings it up.
        fd: it has to carry CAN-FD.
    """
    if not is_up(name):
        return FoundDevice("CAN interface", "", name, problem="it is down", mend=(up,))
    if fd and not carries_fd(name):
        down = f"sudo ip link set {name} down"
        problem = "it is up without CAN-FD, which these controllers speak"
        return FoundDevice("CAN interface", "", name, problem=problem, mend=(down, up))
    return FoundDevice("CAN interface", "", name, note=_BEHIND)
