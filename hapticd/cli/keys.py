"""`hapticd keys`: who may reach this computer's daemons from another one."""

from __future__ import annotations

import json
import os
import shlex
from pathlib import Path
from typing import Annotated

import typer

from hapticd.cli.group import Overview
from hapticd.errors import ConfigError
from hapticd.keys.file import Key, is_key, new_pair, read, write, written
from hapticd.keys.store import NAME, SECRET, KeyDirectory, key_directory

app = typer.Typer(
    cls=Overview,
    help="Say who may reach this computer's daemons from another one.",
    epilog="Example: hapticd keys",
    rich_markup_mode=None,
)

Name = Annotated[str, typer.Argument(metavar="NAME", help="What to call the client.")]
WatchOnly = Annotated[bool, typer.Option("--watch-only", help="It may subscribe, and not command.")]
Force = Annotated[bool, typer.Option("--force", help="Put it in the place of one that is there already.")]


@app.callback(invoke_without_command=True)
def keys(
    context: typer.Context, as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False
) -> None:
    """Say who may reach this computer's daemons from another one.

    Without a command: shows the keys that are there, and what to do next.
    """
    if context.invoked_subcommand is not None:
        return
    directory = KeyDirectory(key_directory())
    pair, clients = directory.pair(), directory.clients()
    if as_json:
        listed = [{"name": name, "key": key.public, "watch_only": key.watch_only} for name, key in clients.items()]
        server_key = pair.public if pair is not None else None
        told = {"directory": str(directory.path), "server_key": server_key, "clients": listed}
        typer.echo(json.dumps(told, indent=2))
        return
    typer.echo(f"{directory.path}")
    if pair is not None:
        typer.echo(f"  daemon  {pair.public}")
    for name, key in clients.items():
        typer.echo(f"  client  {key.public}  {name}{', may only watch' if key.watch_only else ''}")
    typer.echo("")
    for line in _next(pair, clients):
        typer.echo(line)


@app.command()
def make(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Of a client; the daemons' own pair when not given.")
    ] = None,
    server_key: Annotated[
        str | None,
        typer.Option(
            "--server-key",
            metavar="KEY",
            help="On the client's own computer: the daemon's key, as `hapticd keys` shows it there.",
        ),
    ] = None,
    watch_only: WatchOnly = False,
    force: Force = False,
) -> None:
    """Make the key pair of this computer's daemons, or of a client.

    A client's pair is a file NAME.key_secret in the present directory, which names the daemon as well: all that a
    client needs. Made on the daemon's computer, it is listed there at once, and must be brought to the client in a safe
    way; made with --server-key on the client's own, the secret stays there, and the public key is listed with
    `hapticd keys add`.

    Example: hapticd keys make laptop
    """
    if name is None:
        if server_key is not None or watch_only:
            raise typer.BadParameter("--server-key and --watch-only are for a client: give it a NAME")
        _make_daemons_own(force)
    elif server_key is not None:
        if watch_only:
            raise typer.BadParameter("--watch-only is for `hapticd keys add`, on the daemon's computer")
        _make_on_the_clients_computer(name, server_key, force)
    else:
        _make_for_a_client(name, watch_only, force)


@app.command()
def add(
    name: Name,
    key: Annotated[str, typer.Argument(metavar="KEY", help="Its public key, or a file that holds it.")],
    watch_only: WatchOnly = False,
    force: Force = False,
) -> None:
    """List a client's public key.

    Example: hapticd keys add laptop laptop.key --watch-only
    """
    KeyDirectory(key_directory()).add(name, Key(_given(key).public, watch_only=watch_only), force)
    typer.echo(f"listed {name}; {_reminder()}")


@app.command()
def remove(name: Name) -> None:
    """Take a client from the list; a daemon disconnects it when it reloads.

    Example: hapticd keys remove laptop
    """
    KeyDirectory(key_directory()).remove(name)
    typer.echo(f"removed {name}; {_reminder()}")


def _make_daemons_own(force: bool) -> None:
    directory = KeyDirectory(key_directory())
    clients = directory.clients()
    pair = directory.make(force)
    typer.echo(f"made the daemon's pair in {directory.path}; its public key is {pair.public}")
    if clients:
        typer.echo(f"every listed client needs that key in its file; {_reminder()}")
    else:
        typer.echo("what comes next: hapticd keys")


def _make_on_the_clients_computer(name: str, server_key: str, force: bool) -> None:
    pair = new_pair(_given(server_key).public)
    file = _file_of(name)
    write(file, pair, replace=force)
    typer.echo(f"made {file}; now, on the daemon's computer:")
    typer.echo(f"  sudo hapticd keys add {shlex.quote(name)} {shlex.quote(pair.public)}")


def _make_for_a_client(name: str, watch_only: bool, force: bool) -> None:
    directory = KeyDirectory(key_directory())
    server = directory.pair()
    if server is None:
        raise ConfigError(
            f"{directory.path}: the daemon has no keys there yet: `hapticd keys make` first; "
            "on the client's own computer give its --server-key"
        )
    pair = new_pair(server.public)
    file = _file_of(name)
    with written(file, pair, replace=force):  # an older secret stays in its place until the new one is of use
        directory.add(name, Key(pair.public, watch_only=watch_only), force)
    typer.echo(f"made {file} and listed {name}; bring that file to the client in a safe way, then remove it here")
    typer.echo(_reminder())


def _given(text: str) -> Key:
    """A key, or what a file says."""
    if os.path.lexists(text):
        return read(Path(text))
    if not is_key(text):
        raise ConfigError(f"{text}: neither a key, which has 40 characters of Z85, nor a file")
    return Key(text)


def _file_of(name: str) -> Path:
    if NAME.fullmatch(name) is None:
        raise ConfigError(f"{name!r}: a client's name has letters, digits and _ . - only, at most 64, and is no path")
    return Path(f"{name}{SECRET}")


def _reminder() -> str:
    service = " or `sudo systemctl reload hapticd`" if os.geteuid() == 0 else ""
    return f"a running daemon takes it over at `hapticd reload`{service}"


def _next(pair: Key | None, clients: dict[str, Key]) -> list[str]:
    """What to do with what is there."""
    if pair is None:
        lines = ["No other computer reaches the daemon. To allow it, make its keys:", "  hapticd keys make"]
        if os.geteuid() != 0:
            lines[1:] = [
                "  sudo hapticd keys make     # for the system's service",
                "  hapticd keys make          # for a daemon of your own",
            ]
        return lines
    client = [
        "  hapticd keys make NAME     # and bring NAME.key_secret there; or, on the client's own computer:",
        f"  hapticd keys make NAME --server-key {shlex.quote(pair.public)}",
    ]
    if not clients:
        return ["No client is listed, so none comes in. To let one in:", *client]
    return [
        "To let another one in:",
        *client,
        "Endpoints for them, in the configuration (docs/telemetry.md), then restart the daemon:",
        '  [telemetry] tcp = "tcp://0.0.0.0:9872"    [control] tcp = "tcp://0.0.0.0:9873"',
        "From there:",
        "  hapticd watch --connect tcp://HOST:9872 --keys NAME.key_secret",
        "  hapticd arm --connect tcp://HOST:9873 --keys NAME.key_secret",
    ]
