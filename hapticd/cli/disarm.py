"""`hapticd disarm`."""

from __future__ import annotations

from hapticd.cli.destination import Connect, Instance, Keys
from hapticd.commander import command
from hapticd.telemetry.endpoint import DEFAULT_INSTANCE


def disarm(
    instance: Instance = DEFAULT_INSTANCE,
    connect: Connect = None,
    keys: Keys = None,
) -> None:
    """Ramp the force of a running daemon to zero.

    Positions go on streaming.

    Example: hapticd disarm --instance left
    """
    command("disarm", instance, connect=connect, keys=keys)
