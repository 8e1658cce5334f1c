"""`hapticd simulate`: a configuration offline, every tick into a file."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from hapticd.config.loading import load
from hapticd.errors import HapticdError
from hapticd.offline.rehearsal import ticks_in
from hapticd.offline.run import Row
from hapticd.offline.simulate import simulate as simulated
from hapticd.offline.traces import open_trace
from hapticd.progress import progress_bar


def simulate(
    config: Annotated[Path, typer.Option("--config", "-c", help="Configuration file, of a simulated device.")],
    duration: Annotated[float, typer.Option("--duration", "-d", help="Simulated time [s].")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="A .csv or .npz file; only the summary when not given.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the output file if it exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as one JSON object.")] = False,
) -> None:
    """Run a configuration offline on the simulated device.

    The numbers are the daemon's to the last bit: same driver, law, guard and tick, without the waiting. Writes a row a
    tick, the first at t = 0:

    t_s, x_m, v_m_per_s (both true), x_measured_m, force_n (applied), force_requested_n, energy_j (into the walls),
    cycle, damping_n_s_per_m, in_contact

    x is relative to the first wall and negative inside it; a positive force pushes out. The file appears when it is
    complete. The summary says what became of the run, by its last 0.5 s. Exits with 1 when the daemon would have
    stopped for a fault; the rows up to there are kept.

    Example: hapticd simulate --config config/fig6-set1.toml --duration 3 --output run.csv
    """
    loaded = load(config)
    ticks = ticks_in(loaded, duration)
    with contextlib.ExitStack() as stack:
        take: Callable[[Row], object] = _drop
        if output is not None:
            take = stack.enter_context(open_trace(output, ticks, overwrite)).append
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


def _drop(_row: Row) -> None:
    """The rows are not wanted, and an hour of them would fill the memory."""
