"""`hapticd service`: the daemon as a service of this computer."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from hapticd.cli.group import Overview
from hapticd.cli.manual import shared_files
from hapticd.service.install import METRICS_UNIT, PACKAGE, Installation, systemd_runs, unit_states

app = typer.Typer(
    cls=Overview,
    help="Install the daemon as a service, look at it, remove it.",
    epilog="Example: hapticd service install",
    rich_markup_mode=None,
)

Root = Annotated[Path, typer.Option("--root", help="File system to fill, for a package or an image.")]
Prefix = Annotated[
    Path | None,
    typer.Option("--prefix", help="What units, rules and manual lie below: /usr in a package, else /usr/local."),
]


@app.command()
def install(
    root: Root = Path("/"),
    prefix: Prefix = None,
    executable: Annotated[
        Path | None, typer.Option("--executable", help="The hapticd that the units run; this one when not given.")
    ] = None,
) -> None:
    """Install units, user, device rules and a first configuration.

    Needs root. Nothing is started. A configuration that is there already is kept.

    Example: hapticd service install
    """
    _installation(root, executable, prefix).install(typer.echo)


@app.command()
def uninstall(root: Root = Path("/"), prefix: Prefix = None) -> None:
    """Stop the service and remove it, as root; configurations and fault records stay.

    Example: hapticd service uninstall
    """
    _installation(root, prefix=prefix).uninstall(typer.echo)


@app.command()
def status(as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False) -> None:
    """Show what is installed and what runs.

    Exits with 1 unless everything is installed and a daemon runs.

    Example: hapticd service status
    """
    files = _installation().files()
    units = unit_states()
    if as_json:
        shown = {
            "files": {str(file.path): file.state for file in files},
            "systemd": systemd_runs(),
            "units": [asdict(unit) for unit in units],
        }
        typer.echo(json.dumps(shown, indent=2))
    else:
        for file in files:
            typer.echo(f"{file.state:9}  {file.path}")
        if any(file.state != "installed" for file in files):
            typer.echo("to put what is missing or changed in its place: sudo hapticd service install")
        if not systemd_runs():
            typer.echo("systemd does not run this computer")
        for unit in units:
            said = unit.text if unit.active == "active" else "" if unit.result == "success" else f"ended: {unit.result}"
            parts = [
                f"{unit.active:9}  {unit.name}",
                unit.enabled,
                said,
                f"{unit.restarts} restarts" * bool(unit.restarts),
            ]
            typer.echo("; ".join(filter(None, parts)))
    well = all(file.state == "installed" for file in files) and any(
        unit.active == "active" for unit in units if unit.name != METRICS_UNIT
    )
    raise typer.Exit(0 if well else 1)


def _installation(root: Path = Path("/"), executable: Path | None = None, prefix: Path | None = None) -> Installation:
    packaged = Installation(root, executable, prefix).prefix == PACKAGE
    zsh = "vendor-completions" if packaged else "site-functions"
    return Installation(root, executable, prefix, shared_files(zsh))
