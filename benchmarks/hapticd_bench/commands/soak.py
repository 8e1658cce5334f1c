"""`hapticd bench soak`: a daemon left running for as long as one likes."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from hapticd.measure import MachineWatch
from hapticd.paths import default_config
from hapticd_bench.commands.tables import make_console, measuring, print_verdicts, quantile_cells, show, titled_table

MOST_ROWS = 15


def soak(
    duration: Annotated[float, typer.Option(min=1.0, max=1e7, help="How long [s].")] = 600.0,
    config: Annotated[
        Path | None, typer.Option("--config", "-c", help="Configuration; the default one when not given.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Leave a daemon running and see whether anything grows, drifts or gets lost.

    Memory and file handles of both processes, the period, and every tick, seen by a subscriber.

    Example: hapticd bench soak --duration 3600
    """
    from hapticd_bench.soak import measure

    watch = MachineWatch()
    with measuring(duration) as progress:
        found = measure(config or default_config(), duration, duration / MOST_ROWS, progress)
    conditions = watch.end()
    if as_json:
        typer.echo(json.dumps({**asdict(found), "conditions": asdict(conditions)}, indent=2))
        return
    console = make_console()
    table = titled_table(
        console,
        f"A daemon at {found.rate_hz:g} Hz: ticks, lateness [us], memory of its own [kB] and file handles",
        *("until", "ticks", "lost", "skipped", "late p50", "p99", "p99.9", "max"),
        *("supervisor", "handles", "control", "handles"),
    )
    for look in found.looks:
        table.add_row(
            f"{look.end_s:.0f} s",
            *(str(count) for count in (look.ticks, look.lost, look.skipped)),
            *quantile_cells(look.late_us),
            *(str(number) for each in (look.supervisor, look.control) for number in (each.memory_kb, each.handles)),
        )
    show(console, table)
    for fault in found.faults:
        console.print(fault, style="red", markup=False)
    print_verdicts(console, found.bars, conditions)
