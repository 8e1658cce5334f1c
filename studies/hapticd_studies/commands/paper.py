"""`hapticd study paper`: the paper again, with a report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from hapticd.progress import progress_bar
from hapticd_studies.grid.output import require_extra, require_folder

FILES = ("report.html", "claims.json", "readings.json", "tables.md")


def command(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the report, made if need be.")] = Path(
        "paper"
    ),
    quick: Annotated[bool, typer.Option("--quick", help="Few starts and readings: shows that it works.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the claims as one JSON array.")] = False,
) -> None:
    """Run every simulation and experiment of the paper, and say what reproduces.

    Writes report.html (self-contained), a PNG a figure, claims.json, readings.json, and each run as a configuration for
    `hapticd simulate`. A claim that does not come out is a result and no failure: the exit code stays 0.

    Example: hapticd study paper --output paper
    """
    require_extra("study", "numpy", "numba", "matplotlib")
    require_folder(output, FILES)
    require_folder(output / "scenarios", ())
    from hapticd_studies.paper import study

    extent = study.QUICK if quick else study.FULL
    repeat = "hapticd study paper" + (" --quick" if quick else "")
    with progress_bar(1.0, "starting", 30) as tell:

        def progress(what: str, done: float) -> None:
            tell(description=what, advance=done)

        claims = study.publish(study.gather(extent, progress), output, extent.dots_per_inch, repeat, progress)
    if as_json:
        import json

        typer.echo(json.dumps([claim.declared() for claim in claims], indent=2, ensure_ascii=False))
        return
    _show(claims)
    typer.echo(f"{sum(claim.holds for claim in claims)} of {len(claims)} claims hold; {output / 'report.html'}")


def _show(claims: list[Any]) -> None:
    console = Console(highlight=False)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for title in ("paper", "claim", "measured", "holds"):
        table.add_column(title, overflow="fold")
    for claim in claims:
        verdict = "[green]yes[/]" if claim.holds else "[red]no[/]"
        table.add_row(claim.source, claim.claim, claim.measured, verdict)
    console.print(table)
