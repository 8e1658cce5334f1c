"""`hapticd study scene`: what a configuration's scene needs, and the smallest configuration that has it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from hapticd.config.loading import load
from hapticd.errors import ConfigError
from hapticd.paths import directory
from hapticd.progress import progress_bar
from hapticd_studies.grid.output import require_extra, require_file, write

_LONGEST_S = 60.0
_MOST_LINES = 24  # of a configuration that is printed and not only saved


def command(
    config: Annotated[
        Path | None,
        typer.Option("--config", "-c", help="Configuration; the shipped one with every term when not given."),
    ] = None,
    tolerance: Annotated[float, typer.Option(help="Largest change of an answer, a share.")] = 0.05,
    duration: Annotated[float, typer.Option(help="Simulated time of each run [s].")] = 3.0,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File for the smallest configuration; printed when not given.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead.")] = False,
) -> None:
    """Find the smallest model that keeps every answer of a scene.

    Takes each term out (friction, hand, sensor steps and noise, delay, force limit, lag, filter, further walls,
    changes) and says what that does to verdict, settling time, force, energy and shown stiffness, and how many
    instructions a tick it saves. Then takes out all that can go together. Comments of the file stay.

    Example: hapticd study scene --config lab.toml --output minimal.toml
    """
    require_extra("study", "numpy", "scipy")
    if not 0.0 <= tolerance <= 10.0:
        raise ConfigError(f"--tolerance {tolerance:g}: must be a share, 0 to 10; 0.05 is 5 %")
    if not 0.5 <= duration <= _LONGEST_S:
        raise ConfigError(f"--duration {duration:g}: must be from 0.5 to {_LONGEST_S:g} s")
    if output is not None and not output.parent.is_dir():
        raise ConfigError(f"--output {output}: there is no directory {output.parent}")
    if output is not None:
        require_file(output)
    loaded = load(config or directory("config") / "every-term.toml")

    from hapticd_studies.scene import report
    from hapticd_studies.scene.study import steps, study
    from hapticd_studies.scene.ticks import scene_ticks

    with progress_bar(steps(loaded), "starting", 35) as tell:
        found = study(loaded, duration, tolerance, lambda what: tell(description=what, advance=1))
        ticks = scene_ticks()
    if output is not None:
        write(output, report.minimal_text(found).encode())
    if as_json:
        typer.echo(report.json(found, ticks, duration).decode(), nl=False)
        return
    console = Console(highlight=False)
    console.print(report.table(found))
    console.print()
    for sentence in report.sentences(found, ticks):
        console.print(sentence, markup=False)
    if output is not None:
        console.print(str(output), markup=False, soft_wrap=True)
        return
    lines = [line for line in report.minimal_text(found).splitlines() if line and line[0] != "#"]
    if found.left_out and len(lines) <= _MOST_LINES:
        console.print("\n" + "\n".join(lines), markup=False, soft_wrap=True)
    elif found.left_out:
        console.print("--output FILE saves it as a configuration.")
