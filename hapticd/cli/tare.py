"""`hapticd tare`."""

from __future__ import annotations

from hapticd.cli.destination import Connect, Instance, Keys
from hapticd.commander import command
from hapticd.telemetry.endpoint import DEFAULT_INSTANCE


def tare(
    instance: Instance = DEFAULT_INSTANCE,
    connect: Connect = None,
    keys: Keys = None,
) -> None:
    """Take the present position as the scene's origin.

    Positions count from here on every axis, and the walls stand relative to it, until the device is calibrated, lost
    or opened anew. The daemon must be disarmed: no wall moves under a hand that it pushes.

    Example: hapticd tare
    """
    command("tare", instance, connect=connect, keys=keys)
