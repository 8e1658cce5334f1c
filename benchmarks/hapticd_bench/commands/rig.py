"""`hapticd bench rig`: what a rig's driver costs over a serial line."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Annotated

import typer
from rich.markup import escape

from hapticd_bench.commands.tables import make_console, measuring, print_verdicts, quantile_cells, show, titled_table


def rig(
    ticks: Annotated[int, typer.Option(min=100, max=1_000_000, help="Ticks at 1 kHz, and as many round trips.")] = 4000,
    quick: Annotated[bool, typer.Option("--quick", help="200 ticks: shows that it works.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure what the serial rig's driver costs over a pseudo-terminal, next to a bare os.write and os.read.

    At the far end is the protocol core of the firmware. No adapter and no USB is between them: what those add is
    `round_trip_us` and `echo_us` in the status of a daemon on a real rig. Needs a C compiler.

    Example: hapticd bench rig --ticks 10000
    """
    from hapticd_bench.rig import RATE_HZ, measure

    ticks = 200 if quick else ticks
    with measuring(ticks / RATE_HZ) as progress:
        report = measure(ticks, progress)
    if as_json:
        typer.echo(json.dumps(asdict(report), indent=2))
        return
    console = make_console()
    for warning in report.warnings:
        console.print(f"[yellow]{escape(warning)}[/]")
    table = titled_table(
        console,
        f"serial-rig over a pty, {report.driver_us.count} ticks at 1 kHz [us]; ratios to bare system calls in the "
        "same run",
        *("", "p50", "p99", "p99.9", "max", "p50 ratio", "p99 ratio"),
    )
    ratios = f"{report.share_p50_ratio:.2f}", f"{report.share_p99_ratio:.2f}"
    table.add_row("share of a tick: driver", *quantile_cells(report.driver_us), *ratios)
    table.add_row("share of a tick: bare", *quantile_cells(report.raw_us))
    ratios = f"{report.trip_p50_ratio:.2f}", f"{report.trip_p99_ratio:.2f}"
    table.add_row("there and back: driver", *quantile_cells(report.driver_trip_us), *ratios)
    table.add_row("there and back: bare", *quantile_cells(report.raw_trip_us))
    show(console, table)
    console.print(
        f"{report.trips_per_s:.0f} commands answered in a second, back to back; {report.ticks_without_state} ticks "
        f"without a state in time; {report.trouble} frames lost, damaged, late or repeated"
    )
    print_verdicts(console, (), report.conditions)
