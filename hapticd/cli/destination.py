"""Which daemon a command talks to: one of this computer by its name, or another computer's by its endpoint."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Instance = Annotated[str, typer.Option("--instance", "-i", help="Name of the daemon.")]
Connect = Annotated[
    str | None,
    typer.Option("--connect", metavar="ENDPOINT", help="The daemon's control.tcp, tcp://HOST:PORT, instead of a name."),
]
Keys = Annotated[
    Path | None,
    typer.Option("--keys", metavar="FILE", help="Your key file for an endpoint; $HAPTICD_KEYS when not given."),
]
