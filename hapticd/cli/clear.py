"""`hapticd clear`."""

from __future__ import annotations

from hapticd.cli.destination import Connect, Instance, Keys
from hapticd.commander import command
from hapticd.telemetry.endpoint import DEFAULT_INSTANCE


def clear(
    instance: Instance = DEFAULT_INSTANCE,
    connect: Connect = None,
    keys: Keys = None,
) -> None:
    """Clear the fault that stopped a running daemon.

    The device stays disarmed until `hapticd arm`.

    Example: hapticd clear --instance left
    """
    command("clear", instance, connect=connect, keys=keys)
