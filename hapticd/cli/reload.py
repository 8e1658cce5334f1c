"""`hapticd reload`."""

from __future__ import annotations

import typer

from hapticd.cli.destination import Connect, Instance, Keys
from hapticd.commander import command
from hapticd.telemetry.endpoint import DEFAULT_INSTANCE


def reload(
    instance: Instance = DEFAULT_INSTANCE,
    wait: bool = typer.Option(
        False, "--wait", help="Wait for the verdict; a refused file is printed and exits with 2."
    ),
    connect: Connect = None,
    keys: Keys = None,
) -> None:
    """Let a running daemon take its edited file over.

    Law, walls, limits and telemetry decimation change between two ticks, without a step in force; a file that cannot
    be used, or that changes what needs a restart, is refused and changes nothing.

    Example: hapticd reload --wait
    """
    command("reload", instance, connect=connect, keys=keys, wait=wait)
