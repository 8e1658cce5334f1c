"""`hapticd bench telemetry`: what publishing costs."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Annotated

import typer

from hapticd_bench.commands.tables import (
    make_console,
    measuring,
    show,
    titled_table,
)


def telemetry(
    seconds: Annotated[float, typer.Option(min=0.1, max=600.0, help="Length of each measurement [s].")] = 5.0,
    quick: Annotated[bool, typer.Option("--quick", help="A quarter of a second each: shows that it works.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure what publishing costs, with 0, 1 and 16 subscribers.

    Example: hapticd bench telemetry --seconds 10 --json
    """
    from hapticd_bench.telemetry import measure

    costs = []
    seconds = 0.25 if quick else seconds
    with measuring(3 * seconds) as progress:
        for subscribers in (0, 1, 16):
            costs.append(measure(subscribers, seconds))
            progress(seconds)
    if as_json:
        typer.echo(json.dumps([{**asdict(cost), "ratio": cost.ratio} for cost in costs], indent=2))
        return
    console = make_console()
    table = titled_table(
        console,
        f"Publishing at 1 kHz; the reference, msgpack packing 16 floats, takes {costs[0].reference_us:.2f} us",
        *("subscribers", "call us/tick", "worst call us", "cpu us/tick", "x reference", "bytes/tick", "missing"),
    )
    for cost in costs:
        table.add_row(
            str(cost.subscribers),
            *(f"{value:.1f}" for value in (cost.call_us, cost.worst_call_us, cost.cpu_us, cost.ratio)),
            *(f"{cost.bytes_per_tick:.0f}", str(cost.missing)),
        )
    show(console, table)
