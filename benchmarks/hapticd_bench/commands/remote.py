"""`hapticd bench remote`: how soon what a client sends is felt, and how soon it hears of a tick."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Annotated

import typer

from hapticd_bench.commands.tables import make_console, measuring, print_verdicts, quantile_cells, show, titled_table


def remote(
    messages: Annotated[int, typer.Option(min=10, max=1_000_000, help="How many are sent.")] = 1000,
    realtime: Annotated[
        bool,
        typer.Option("--realtime", help="Client and echo at the lowest real-time priority: beside ordinary programs."),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure how soon a client's message is felt and a tick is heard of, next to a bare ZeroMQ echo.

    A client of a coupling, at 1 kHz. Asked is that a message is felt within a period and three ways of the echo, and
    that a tick is heard of within three, at p50 and p99.

    Example: hapticd bench remote --messages 5000
    """
    from hapticd_bench.remote import STEP_S, measure

    with measuring(messages * STEP_S) as progress:
        report = measure(messages, progress, realtime)
    if as_json:
        typer.echo(json.dumps(asdict(report), indent=2))
        return
    console = make_console()
    table = titled_table(
        console, f"{messages} messages of one client at 1 kHz [us]", *("", "p50", "p99", "p99.9", "max")
    )
    table.add_row("one way to or from a bare echo", *quantile_cells(report.echo_us))
    table.add_row("from sending to the tick that goes by it", *quantile_cells(report.to_tick_us))
    table.add_row("from the end of a tick to a client", *quantile_cells(report.to_client_us))
    show(console, table)
    print_verdicts(console, report.bars, report.conditions)
