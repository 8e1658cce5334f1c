"""`hapticd config`: what a configuration file may say, and what one says once its defaults are filled in."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from hapticd.cli.group import Overview
from hapticd.config.effective import effective_toml
from hapticd.config.loading import load
from hapticd.config.schema import json_schema

app = typer.Typer(
    cls=Overview,
    help="Describe the configuration file, or show one in full.",
    epilog="Example: hapticd config show /etc/hapticd/hapticd.toml",
    rich_markup_mode=None,
)


@app.command()
def schema() -> None:
    """Print the JSON Schema of the configuration file.

    Includes the options of every installed driver and the parameters of every installed law, so that an editor can
    complete and check a file while it is written.

    Example: hapticd config schema > hapticd.schema.json
    """
    typer.echo(json.dumps(json_schema(), indent=2))


@app.command()
def show(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Configuration file.")],
) -> None:
    """Print a configuration with every default filled in.

    Prints TOML with the meaning of each key, which can be loaded again.

    Example: hapticd config show lab.toml
    """
    typer.echo(effective_toml(load(file)), nl=False)
