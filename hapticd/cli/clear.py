"""`hapticd clear`."""

from __future__ import annotations

import typer

from hapticd.commander import command
from hapticd.telemetry.endpoint import DEFAULT_INSTANCE


def clear(
    instance: str = typer.Option(DEFAULT_INSTANCE, "--instance", "-i", help="Name of the daemon."),
) -> None:
    """Clear the fault that stopped a running daemon.

    The device stays disarmed until `hapticd arm`.

    Example: hapticd clear --instance left
    """
    command("clear", instance)
