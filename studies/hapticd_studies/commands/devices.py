"""`hapticd study devices`: limits that others have published, against the device model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from hapticd.errors import ConfigError
from hapticd.progress import progress_bar
from hapticd_studies.grid.output import require_extra, require_file, write


def command(
    output: Annotated[Path | None, typer.Option("--output", "-o", help="JSON file to write as well.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead.")] = False,
) -> None:
    """Hold the device model against limits and orders that others have published.

    Each row says what its source says, what the model says, and whether they agree. Rows that need a flexible handle
    or a hand with a mass of its own are not here; docs/studies.md names them.

    Example: hapticd study devices --output devices.json
    """
    require_extra("study", "numpy", "numba")
    if output is not None:
        if not output.parent.is_dir():
            raise ConfigError(f"--output {output}: there is no directory {output.parent}")
        require_file(output)

    from hapticd_studies.published import report
    from hapticd_studies.published.rows import ROWS

    findings = []
    with progress_bar(len(ROWS), "starting", 25) as tell:
        for row in ROWS:
            tell(description=row.__name__.replace("_", " "))
            findings.append(row())
            tell(advance=1)
    if output is not None:
        write(output, report.json(findings))
    if as_json:
        typer.echo(report.json(findings).decode(), nl=False)
        return
    console = Console(highlight=False)
    console.print(report.page(findings))
    if output is not None:
        console.print(str(output), markup=False, soft_wrap=True)
