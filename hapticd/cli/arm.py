"""`hapticd arm`."""

from __future__ import annotations

from hapticd.cli.destination import Connect, Instance, Keys
from hapticd.commander import command
from hapticd.telemetry.endpoint import DEFAULT_INSTANCE


def arm(
    instance: Instance = DEFAULT_INSTANCE,
    connect: Connect = None,
    keys: Keys = None,
) -> None:
    """Let a running daemon apply forces.

    The device is enabled, and a wall that is already pressed comes in by a ramp.

    Example: hapticd arm --instance left
    """
    command("arm", instance, connect=connect, keys=keys)
