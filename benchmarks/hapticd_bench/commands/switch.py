"""`hapticd bench switch`: what a switch to a law that was never loaded costs the loop."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Annotated

import typer

from hapticd.measure import MachineWatch
from hapticd_bench.commands.tables import make_console, measuring, print_verdicts, quantile_cells, show, titled_table


def switch(
    switches: Annotated[int, typer.Option(min=1, max=10_000, help="How many, each in a fresh daemon.")] = 8,
    burners: Annotated[int, typer.Option(min=0, max=100, help="Programs that spin on the loop's processor.")] = 4,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure how long a switch to a law never loaded holds the loop up, at 1 kHz.

    The processor that it runs on is kept busy; the time before the switch is the reference.

    Example: hapticd bench switch --burners 0
    """
    from hapticd_bench.switch import START_S, WATCHED_S, measure

    watch = MachineWatch()
    with measuring(switches * (START_S + WATCHED_S)) as progress:
        found = measure(switches, burners, progress)
    conditions = watch.end()
    if as_json:
        typer.echo(json.dumps({**asdict(found), "conditions": asdict(conditions)}, indent=2))
        return
    console = make_console()
    table = titled_table(
        console,
        f"Longest time between two ticks at 1 kHz, {switches} switches beside {burners} spinning programs [ms]",
        *("", "p50", "p99", "p99.9", "max"),
    )
    table.add_row("before the switch", *quantile_cells(found.before_ms))
    table.add_row("during the switch", *quantile_cells(found.during_ms))
    show(console, table)
    print_verdicts(console, (), conditions)
