"""`hapticd simulate`: a configuration offline, every tick into a file."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from hapticd.config.loading import load
from hapticd.errors import HapticdError
from hapticd.offline.run import OfflineRun, Row, Summary
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
    complete. The summary is of the last 0.5 s. Exits with 1 when the daemon would have stopped for a fault; the rows up
    to there are kept.

    Example: hapticd simulate --config config/fig6-set1.toml --duration 3 --output run.csv
    """
    loaded = load(config)
    run = OfflineRun(loaded, duration)
    with contextlib.ExitStack() as stack:
        take: Callable[[Row], object] = _drop
        if output is not None:
            take = stack.enter_context(open_trace(output, run.ticks, overwrite)).append
        tell = stack.enter_context(progress_bar(run.ticks, "simulating"))
        summary = run.run(take, lambda done: tell(completed=done))
    if as_json:
        given = {
            "config": str(config),
            "sha256": loaded.sha256,
            "law": loaded.config.controller.law,
            "rate_hz": loaded.config.loop.rate_hz,
            "output": None if output is None else str(output),
        }
        typer.echo(json.dumps({**given, **asdict(summary)}, indent=2))
    else:
        typer.echo(_in_words(summary, run.period_s, output))
    if summary.fault:
        raise HapticdError(f"{config}: stopped: {summary.fault}")


def _drop(_row: Row) -> None:
    """Nobody wants the rows."""


def _in_words(summary: Summary, period_s: float, output: Path | None) -> str:
    lines = [
        f"{summary.ticks} ticks, {summary.ticks * period_s:g} s" + (f", in {output}" if output else ""),
        f"last {summary.window_s:g} s: {summary.peak_to_peak_m * 1e3:.4g} mm peak to peak, "
        f"mean depth {summary.mean_depth_m * 1e3:.4g} mm",
    ]
    if summary.displayed_stiffness_n_per_m is not None and summary.commanded_stiffness_n_per_m is not None:
        lines.append(
            f"displayed stiffness {summary.displayed_stiffness_n_per_m:.5g} N/m "
            f"of {summary.commanded_stiffness_n_per_m:g} N/m"
        )
    lines.append(
        f"{summary.cycles} cycles, damping {summary.damping_n_s_per_m:.4g} N s/m, "
        f"peak force {summary.peak_force_n:.4g} N, energy made by the wall {summary.generated_j * 1e3:.4g} mJ"
    )
    return "\n".join(lines)
