"""`hapticd arm`."""

from __future__ import annotations

import typer

from hapticd.commander import command
from hapticd.telemetry.endpoint import DEFAULT_INSTANCE


def arm(
    instance: str = typer.Option(DEFAULT_INSTANCE, "--instance", "-i", help="Name of the daemon."),
) -> None:
    """Let a running daemon apply forces.

    The device is enabled, and a wall that is already pressed comes in by a ramp.

    Example: hapticd arm --instance left
    """
    command("arm", instance)
