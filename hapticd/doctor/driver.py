"""What the configured driver itself says of this computer: it knows where it looks and what it needs."""

from __future__ import annotations

from hapticd.device import FoundDevice
from hapticd.discovery import Discovery
from hapticd.doctor.finding import Finding, ok, own_command, problem, unknown


def needs(looked: Discovery) -> list[Finding]:
    """What the driver needs on this computer, and what of it is missing.

    Args:
        looked: the driver's answer.
    """
    found = [Finding(one.mark, one.text, one.mend) for one in looked.diagnoses]
    if looked.problem:
        found.append(unknown(f"{looked.driver}: {looked.problem}"))
    return found or [ok(f"{looked.driver} needs nothing that is not there")]


def devices(looked: Discovery, daemon: int) -> list[Finding]:
    """Which devices the driver finds, and whether this user can use one.

    Args:
        looked: the driver's answer.
        daemon: process of the running daemon, which holds the device; 0 when there is none.
    """
    name = looked.driver
    if daemon:
        return [ok("not looked for: the running daemon has the device; see hapticd watch")]
    if looked.devices:
        usable = any(not device.problem for device in looked.devices)
        return [_state(device, name, usable) for device in looked.devices]
    if looked.problem:
        return [unknown(f"{name} did not look")]
    if not looked.looks:
        return [unknown(f"{name} cannot look for its devices")]
    return [problem(f"{name} finds no device", f"# {looked.absent}")]


def _state(device: FoundDevice, driver: str, usable: bool) -> Finding:
    """The finding for one device; an obstacle is mere advice while another device can be used."""
    what = " ".join(filter(None, (device.model, device.serial, device.where and f"({device.where})")))
    if not device.problem:
        return ok(f"{what}: {device.note}" if device.note else what)
    mend = device.mend or (f"{own_command('devices', driver)}  # says it again",)
    return Finding("advice" if usable else "problem", f"{what}: {device.problem}", mend)
