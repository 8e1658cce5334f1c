"""`hapticd study extremes`: numerical stability at the edges."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from hapticd.errors import ConfigError
from hapticd.progress import progress_bar
from hapticd_studies.grid.output import require_cluster, require_extra, require_folder, require_memory, write

_FILES = ("extremes.html", "extremes.json", "extremes.png")
_MOST_PLACES = 100_000_000
_MOST_TICKS = 10**11
_LISTED = 8


def command(
    places: Annotated[int, typer.Option(help="How many places.")] = 110_000,
    seed: Annotated[int, typer.Option(help="Of the places; the same seed gives the same ones anywhere.")] = 1,
    ticks: Annotated[int, typer.Option(help="Of the long runs, a day at 1 kHz; 0: none.")] = 86_400_000,
    point: Annotated[
        str | None, typer.Option(help="One place alone: SEED:INDEX, or NAME=VALUE,... as mass_kg=1e-6,rate_hz=3.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("extremes"),
    cluster: Annotated[str | None, typer.Option(help="Scheduler of dask whose workers do it, tcp://HOST:PORT.")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget what an interrupted run has done.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the JSON file too.")] = False,
) -> None:
    """Hold the model's arithmetic against exact answers, over many decades of every parameter.

    The linear loop against exact eigenvalues, the energy books against independent sums, laws against published
    ceilings, refusals against their limits, and the sums of a day. Writes a report, a picture and JSON. Exit code 1:
    something disagrees, and the command that repeats it alone is listed. Interrupted, the same command goes on where
    it was.

    Example: hapticd study extremes --output extremes

    Example: hapticd study extremes --point 1:57
    """
    require_extra("study", "numpy", "numba", "matplotlib")
    require_cluster(cluster)
    if point is not None:
        _one(point)
        return
    if not 1 <= places <= _MOST_PLACES:
        raise ConfigError(f"--places {places}: must be from 1 to {_MOST_PLACES}")
    if not 0 <= seed < 10**18:
        raise ConfigError(f"--seed {seed}: must be 0 or more and less than 1e18")
    if not 0 <= ticks <= _MOST_TICKS:
        raise ConfigError(f"--ticks {ticks}: must be from 0 to {_MOST_TICKS:g}")
    require_memory(3000.0 * places + 5e8, f"--places {places}")
    require_folder(output, _FILES)

    from hapticd_studies.extremes.long_run import run_days
    from hapticd_studies.extremes.page import page
    from hapticd_studies.extremes.plot import draw
    from hapticd_studies.extremes.report import report
    from hapticd_studies.extremes.sweep import ExtremesPlan
    from hapticd_studies.grid.run import kept, run

    plan = ExtremesPlan(seed, places)
    job = plan.job()
    with kept(job, output / "extremes.journal", fresh) as journal:
        table = plan.table(run(job, journal, "extremes", cluster))
        days = []
        if ticks:
            with progress_bar(ticks, "a day") as tell:
                days = run_days(ticks, lambda done: tell(completed=done))
        found = report(plan, table, days)
        picture = draw(found)
        repeat = f"hapticd study extremes --places {places} --seed {seed} --ticks {ticks}"
        for file, content in zip(_FILES, (page(found, picture, repeat), found.json(), picture), strict=True):
            write(output / file, content)
    if as_json:
        typer.echo((output / "extremes.json").read_text(), nl=False)
    else:
        _show(found, output)
    if not found.holds:
        raise typer.Exit(1)


def _show(found: Any, output: Path) -> None:
    console = Console(highlight=False)
    console.print(f"{found.plan.count} places, seed {found.plan.seed}\n")
    _lines(console, found.lines())
    wrong = found.disagreements
    for index, one in wrong[:_LISTED]:
        console.print(f"{one.kind}: {one.text}: {found.command(index)}", soft_wrap=True, markup=False)
    if len(wrong) > _LISTED:
        console.print(f"{len(wrong) - _LISTED} more: {output / _FILES[1]}, disagreements", markup=False)
    console.print(f"\n{output}: {', '.join(_FILES)}", soft_wrap=True, markup=False)


def _lines(console: Console, lines: Any) -> None:
    shown = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=False)
    for line in lines:
        shown.add_row("[green]PASS[/]" if line.holds else "[red]FAIL[/]", line.name, line.text)
    console.print(shown)


def _one(text: str) -> None:
    from hapticd_studies.extremes.case import place_of
    from hapticd_studies.extremes.replay import replay

    place = place_of(text)
    console = Console(highlight=False)
    console.print(place.words() or "every value at its default", soft_wrap=True, markup=False)
    lines = replay(place)
    _lines(console, lines)
    if not all(line.holds for line in lines):
        raise typer.Exit(1)
