"""`hapticd simulate`: a configuration offline, every tick into a file."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path
from typing import Annotated, Any

import typer

from hapticd.config.loading import load
from hapticd.errors import ConfigError, HapticdError
from hapticd.offline.rehearsal import columns_of, ticks_in
from hapticd.offline.run import Row
from hapticd.offline.simulate import simulate as simulated
from hapticd.offline.space_row import SpaceRow
from hapticd.offline.traces import open_trace
from hapticd.progress import progress_bar

RECORDINGS = "hapticd.recordings"
"""Entry points by the suffix of the recordings that they replay."""


def simulate(
    config: Annotated[
        Path | None,
        typer.Option(
            "--config", "-c", help="Configuration file, of a simulated device; for a replay the recorded one."
        ),
    ] = None,
    duration: Annotated[
        float | None, typer.Option("--duration", "-d", help="Simulated time [s]; for a replay all of it.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="A .csv or .npz file; only the summary when not given.")
    ] = None,
    replay: Annotated[
        Path | None, typer.Option("--replay", metavar="FILE.mcap", help="Put the hand of a recording under laws.")
    ] = None,
    law: Annotated[
        list[str] | None,
        typer.Option(
            "--law", metavar="NAME", help="For a replay: a law, may be repeated; every installed one if not given."
        ),
    ] = None,
    hand: Annotated[
        str, typer.Option("--hand", help="For a replay: force, identified with the device model, or motion.")
    ] = "force",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the output file if it exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as one JSON object.")] = False,
) -> None:
    """Run a configuration offline on the simulated device.

    The numbers are the daemon's to the last bit: same driver, law, guard and tick, without the waiting. Writes a row a
    tick, the first at t = 0:

    t_s, x_m, v_m_per_s (both true), x_measured_m, force_n (applied), force_requested_n, energy_j (into the walls),
    cycle, damping_n_s_per_m, in_contact, armed (0 from a fault on, which ramps the force out)

    x is relative to the first wall and negative inside it; a positive force pushes out. A device with several axes has
    more columns: position, velocity, measured position and force along each, the object that is touched, and its depth;
    without a wall x is less that depth. The file appears when it is
    complete. The summary says what became of the run, by its last 0.5 s. Exits with 1 when the daemon would have
    stopped for a fault; the rows up to there are kept.

    With --replay the hand of a recording is put under one law after the other, and they are compared in one table. Its
    force is identified with the device model and closes the loop anew; its motion shows what a law answers to it, and
    not what would have come of it. The output then has a column for each law, or as .png, .svg or .pdf is one figure.

    Example: hapticd simulate -c config/fig6-set1.toml -d 3 -o run.csv
    """
    if replay is not None:
        _replay(replay, config, duration, law or [], hand, output, overwrite, as_json)
        return
    if config is None or duration is None:
        needed = {"--config": config, "--duration": duration}
        missing = [option for option, given in needed.items() if given is None]
        raise typer.BadParameter(f"needs {missing[0] if len(missing) == 1 else '--config and --duration, or --replay'}")
    if law:
        raise typer.BadParameter("--law goes with --replay; without it the configuration names the law")
    loaded = load(config)
    ticks = ticks_in(loaded, duration)
    with contextlib.ExitStack() as stack:
        take: Callable[[Any], object] = _drop
        if output is not None:
            take = stack.enter_context(open_trace(output, ticks, overwrite, columns_of(loaded))).append
        tell = stack.enter_context(progress_bar(ticks, "simulating"))
        run = simulated(loaded, duration, take=take, progress=lambda done: tell(completed=done))
    if as_json:
        given = {
            "config": str(config),
            "sha256": loaded.sha256,
            "law": loaded.config.controller.law,
            "rate_hz": loaded.config.loop.rate_hz,
            "output": None if output is None else str(output),
        }
        typer.echo(json.dumps({**given, **run.summary}, indent=2))
    else:
        typer.echo(f"{run.ticks} ticks, {run.ticks * run.period_s:g} s" + (f", in {output}" if output else ""))
        typer.echo("\n".join(run.words))
    if run.fault:
        raise HapticdError(f"{config}: stopped: {run.fault}")


def _replay(
    file: Path,
    config: Path | None,
    duration_s: float | None,
    laws: list[str],
    hand: str,
    output: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    points = {point.name: point for point in entry_points(group=RECORDINGS)}
    if file.suffix not in points:
        raise ConfigError(
            f"{file}: a recording ends in {' or '.join(sorted(points)) or 'what no installed reader knows'}"
        )
    try:
        replayed = points[file.suffix].load()
    except ModuleNotFoundError as error:
        raise HapticdError(f"{file}: recordings need {error.name}: pip install 'hapticd[record]'") from None
    summary, lines = replayed(file, config, laws, hand, duration_s, output, overwrite)
    typer.echo(json.dumps(summary, indent=2) if as_json else "\n".join(lines))


def _drop(_row: Row | SpaceRow) -> None:
    """The rows are not wanted, and an hour of them would fill the memory."""
