"""`hapticd disarm`."""

from __future__ import annotations

import typer

from hapticd.commander import command
from hapticd.telemetry.endpoint import DEFAULT_INSTANCE


def disarm(
    instance: str = typer.Option(DEFAULT_INSTANCE, "--instance", "-i", help="Name of the daemon."),
) -> None:
    """Ramp the force of a running daemon to zero.

    Positions go on streaming.

    Example: hapticd disarm --instance left
    """
    command("disarm", instance)
