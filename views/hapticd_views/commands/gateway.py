"""`hapticd gateway`: programs that speak another device service's dialect, on a running daemon."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Annotated

import typer

from hapticd.cli.group import Overview
from hapticd.errors import ClientError
from hapticd.paths import DEFAULT_INSTANCE

if TYPE_CHECKING:
    from hapticd_views.gateway.follower import Device

app = typer.Typer(cls=Overview, rich_markup_mode=None)

HOST = "127.0.0.1"
PORT = 10001


@app.callback(epilog="Example: hapticd gateway haply --force field")
def gateway() -> None:
    """Let programs that are written for another device's service use a running daemon."""


@app.command("haply", epilog="Example: hapticd gateway haply --force field")
def haply(
    force: Annotated[
        str | None,
        typer.Option("--force", metavar="NAME", help="Hand clients' forces to this [[scene.forces]]; else read only."),
    ] = None,
    instance: Annotated[str, typer.Option("--instance", "-i", help="Name of the daemon.")] = DEFAULT_INSTANCE,
    port: Annotated[int, typer.Option("--port", min=1, max=65535, help="TCP port on this computer.")] = PORT,
    origin: Annotated[
        list[str] | None,
        typer.Option("--origin", metavar="URL", help="Let pages of this origin in, http://HOST:PORT; may be repeated."),
    ] = None,
) -> None:
    """Speak as Haply's Inverse service does: JSON over a WebSocket, one state for each message.

    A client's force goes through the limits that the configuration gives to NAME. One client pushes at a time. Only
    programs of this computer are let in. Ends with Ctrl-C, which lets the force go.
    """
    if importlib.util.find_spec("websockets") is None:
        raise ClientError("hapticd gateway needs its extra: pip install 'hapticd[gateway]'")
    import asyncio

    from hapticd_views.address import Address
    from hapticd_views.gateway.server import Gateway

    def tell(line: str) -> None:
        typer.echo(line, err=True)

    address = Address(HOST, port)

    def ready() -> None:
        pushes = f"forces enter {force}" if force else "read only: forces take --force NAME"
        typer.echo(f"{address.live[0]}: {instance}, {pushes}")

    with _device(instance, force) as device, suppress(KeyboardInterrupt):
        served = Gateway(address, device, instance, may_push=force is not None, origins=origin or [], tell=tell)
        asyncio.run(served.run(ready))


@contextmanager
def _device(instance: str, force: str | None) -> Iterator[Device]:
    """The device of a daemon, and its port for forces where one is named."""
    from hapticd.client import connect
    from hapticd_views.gateway.driven import Driven
    from hapticd_views.gateway.watched import TOPICS, Watched

    with connect(instance, topics=TOPICS) as daemon:
        if force is None:
            yield Watched(daemon)
        else:
            with daemon.remote(force) as port:
                yield Driven(port)
