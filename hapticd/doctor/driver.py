"""What the configured driver itself says of this computer: nobody knows better where it looks and what will do."""

from __future__ import annotations

import inspect

from hapticd import plugins
from hapticd.device import FoundDevice
from hapticd.discovery import Discovery
from hapticd.doctor.finding import Finding, ok, own_command, problem, unknown
from hapticd.driver import Driver


def needs(looked: Discovery) -> list[Finding]:
    """What it has and lacks.

    Args:
        looked: its answer.
    """
    found = [Finding(one.mark, one.text, one.mend) for one in looked.diagnoses]
    if looked.problem:
        found.append(unknown(f"{looked.driver}: {looked.problem}"))
    return found or [ok(f"{looked.driver} needs nothing that is not there")]


def devices(looked: Discovery, daemon: int) -> list[Finding]:
    """Which devices it finds, and whether this user can use one.

    Args:
        looked: its answer.
        daemon: process of the running daemon, beside which nothing was looked for; 0 when there is none.
    """
    name = looked.driver
    if daemon:
        return [ok("not looked for beside the running daemon, which has it: see hapticd watch")]
    if looked.devices:
        usable = any(not device.problem for device in looked.devices)
        return [_state(device, name, usable) for device in looked.devices]
    if looked.problem:
        return [unknown(f"{name} did not look")]
    if inspect.getattr_static(plugins.driver(name), "find") is vars(Driver)["find"]:
        return [unknown(f"{name} cannot look for its devices")]
    return [problem(f"{name} finds no device", f"# {looked.absent}")]


def _state(device: FoundDevice, driver: str, usable: bool) -> Finding:
    """One of them; what keeps this user from it matters less while there is another."""
    what = " ".join(filter(None, (device.model, device.serial, device.where and f"({device.where})")))
    if not device.problem:
        return ok(f"{what}: {device.note}" if device.note else what)
    mend = device.mend or (f"{own_command('devices', driver)}  # says it again",)
    return Finding("advice" if usable else "problem", f"{what}: {device.problem}", mend)
