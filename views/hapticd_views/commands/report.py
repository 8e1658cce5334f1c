"""`hapticd report`: one HTML page that says for people how a run was."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from hapticd.errors import ConfigError


def report(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A .mcap, .csv or .npz file.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE.html", help="The page; none when not given.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the verdict as one JSON object.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the output file if it exists.")] = False,
) -> None:
    """Say how a run was: was it stable, what did the law add, what did the machine do.

    The page holds its figures, what happened in order of time, and the receipt; no script, nothing from outside.

    Example: hapticd report press.mcap --output press.html
    """
    from hapticd_views.commands.needs import record_and_figures

    with record_and_figures():
        from hapticd.replacing import write
        from hapticd_views.recording.output import place
        from hapticd_views.report.page import page
        from hapticd_views.report.statement import statements
        from hapticd_views.source import open_source
    if output is not None:
        if output.suffix not in (".html", ".htm"):
            raise ConfigError(f"{output}: must end in .html")
        place(output, overwrite)
    source = open_source(file)
    told = statements(source)
    if output is not None:
        write(output, page(source, told))
    if as_json:
        typer.echo(json.dumps({"file": str(file), "statements": [asdict(one) for one in told]}))
    else:
        for one in told:
            typer.echo(f"{one.question} {one.text}")
        if output is not None:
            typer.echo(str(output))
