"""`hapticd dashboard`: a running daemon in the browser."""

from __future__ import annotations

import importlib.util
import secrets
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from hapticd.errors import ClientError
from hapticd.paths import DEFAULT_INSTANCE

PORT = 9877
"""Where the page is unless another port is named."""


def dashboard(
    instance: Annotated[str, typer.Option("--instance", "-i", help="Name of the daemon.")] = DEFAULT_INSTANCE,
    port: Annotated[int, typer.Option("--port", min=1, max=65535, help="TCP port of the page.")] = PORT,
    host: Annotated[
        str,
        typer.Option(
            "--host",
            metavar="ADDRESS",
            help="Address of this computer that the page is to have. Off loopback nothing is encrypted, and watching "
            "takes the token too.",
        ),
    ] = "127.0.0.1",
    connect: Annotated[
        str | None,
        typer.Option("--connect", metavar="ENDPOINT", help="The telemetry.tcp of a daemon elsewhere, tcp://HOST:PORT."),
    ] = None,
    control: Annotated[
        str | None, typer.Option("--control", metavar="ENDPOINT", help="Its control.tcp; without it, watch only.")
    ] = None,
    keys: Annotated[
        Path | None,
        typer.Option("--keys", metavar="FILE", help="Your key file for an endpoint; $HAPTICD_KEYS when not given."),
    ] = None,
) -> None:
    """Show a running daemon in the browser, with arm, disarm and its settings.

    Prints the page's address, with a token behind the # that lets it command; the address without it only watches.
    Waits for a daemon, and finds it again after a restart. Ends with Ctrl-C, which changes nothing at the device.

    Example: hapticd dashboard --instance left --port 9878
    """
    if importlib.util.find_spec("websockets") is None:
        raise ClientError("hapticd dashboard needs its extra: pip install 'hapticd[dashboard]'")
    if control is not None and connect is None:
        raise ClientError(f"--control {control}: name the same daemon's telemetry with --connect as well")
    import asyncio

    from hapticd_views.address import Address
    from hapticd_views.dashboard.server import Dashboard
    from hapticd_views.dashboard.target import Target

    address = Address(host, port)
    token = secrets.token_urlsafe(24)

    def ready() -> None:
        typer.echo(f"watch:    {address.url}")
        typer.echo(f"command:  {address.url}#token={token}")
        if not address.is_loopback:
            typer.echo("not encrypted: for a network of which you trust every user", err=True)

    with suppress(KeyboardInterrupt):
        asyncio.run(Dashboard(Target(instance, connect, control, keys), address, token).run(ready))
