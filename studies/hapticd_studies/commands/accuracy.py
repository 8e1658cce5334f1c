"""`hapticd study accuracy`: what speed costs in accuracy, for a configuration of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from hapticd.config.loading import load
from hapticd.errors import ConfigError
from hapticd.paths import directory
from hapticd.progress import progress_bar
from hapticd_studies.grid.output import require_extra, require_folder, write

_FILES = ("accuracy.csv", "accuracy.json", "accuracy.png")
_LONGEST_S = 60.0


def command(
    config: Annotated[
        Path | None, typer.Option("--config", "-c", help="Configuration; the shipped wall of 12 kN/m when not given.")
    ] = None,
    below: Annotated[float, typer.Option(help="Largest error of the position that will do [m].")] = 1e-6,
    duration: Annotated[float, typer.Option(help="Simulated time of each run [s].")] = 2.0,
    everything: Annotated[bool, typer.Option("--all", help="Print every table, the control side too.")] = False,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("accuracy"),
    as_json: Annotated[bool, typer.Option("--json", help="Print the JSON file instead.")] = False,
) -> None:
    """Measure what every shortcut costs in accuracy, and what every bit of accuracy costs in time.

    Runs the configuration offline under every integrator with its sub-steps, in single precision, without each term of
    the device; at every loop rate, with every velocity estimator, cycle window and telemetry batch. Errors are against
    the exact step of the full model. Writes a work-precision diagram, CSV and JSON.

    Example: hapticd study accuracy --config lab.toml --below 1e-5
    """
    require_extra("study", "numpy", "numba", "scipy", "matplotlib")
    if not 0.0 <= below < 1e3:
        raise ConfigError(f"--below {below:g}: must be 0 m or more")
    if not 0.0 < duration <= _LONGEST_S:
        raise ConfigError(f"--duration {duration:g}: must be more than 0 s and at most {_LONGEST_S:g} s")
    loaded = load(config or directory("config") / "wall-12-energy-cycle.toml")
    from hapticd.offline.rehearsal import simulation_options

    options = simulation_options(loaded)
    if options.axes > 1:
        raise ConfigError(f"device.options.axes = {options.axes}: only a device of one axis is measured here")
    for key in ("force_delay_s", "flexible"):
        if getattr(options, key):
            raise ConfigError(f"device.options.{key}: is stepped exactly only; take it out to compare integrators")
    require_folder(output, _FILES)
    from hapticd_studies.accuracy.plot import draw
    from hapticd_studies.accuracy.study import steps, study

    with progress_bar(steps(loaded), "starting", 30) as tell:
        found = study(loaded, duration, below, lambda what: tell(description=what, advance=1))
        for file, content in zip(_FILES, (found.csv(), found.json(), draw(found)), strict=True):
            write(output / file, content)
    if as_json:
        typer.echo((output / "accuracy.json").read_text(), nl=False)
        return
    console = Console(highlight=False)
    console.print(found.model_table(console.width >= 100))
    console.print(found.legend, style="dim", markup=False)
    if everything:
        for table in (*found.model_tables(), *found.control_tables()):
            console.print()
            console.print(table)
    console.print()
    for sentence in found.sentences():
        console.print(sentence, markup=False)
    console.print(f"{output}: {', '.join(_FILES)}", soft_wrap=True, markup=False)
