"""`hapticd calibrate`."""

from __future__ import annotations

import time
from typing import Annotated

import typer

from hapticd.cli.destination import Connect, Instance, Keys
from hapticd.commander import command
from hapticd.telemetry.endpoint import DEFAULT_INSTANCE

TIMEOUT_S = 120.0
"""How long the device may take [s]."""


def calibrate(
    instance: Instance = DEFAULT_INSTANCE,
    countdown_s: Annotated[int, typer.Option("--countdown", min=0, max=60, help="Seconds to clear the workspace.")] = 5,
    connect: Connect = None,
    keys: Keys = None,
) -> None:
    """Calibrate a running daemon's device, which moves its arm.

    Let go of the arm and clear its workspace. Ctrl-C calls it off, during the countdown and afterwards, and so does
    `hapticd disarm`. The daemon must be disarmed, and goes on streaming positions.

    Example: hapticd calibrate --countdown 10
    """
    command("status", instance, connect=connect, keys=keys)  # nobody clears a workspace for a daemon that is not there
    for left_s in range(countdown_s, 0, -1):
        typer.echo(f"the arm will move by itself in {left_s} s; Ctrl-C to call it off", err=True)
        time.sleep(1.0)
    typer.echo("calibrating", err=True)
    try:
        command("calibrate", instance, TIMEOUT_S, connect, keys)
    except KeyboardInterrupt:
        command("disarm", instance, connect=connect, keys=keys)
        typer.echo("called off", err=True)
        raise
