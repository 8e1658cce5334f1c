"""`hapticd bench start`: the way from the command line to the first tick."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Annotated

import typer

from hapticd.measure import MachineWatch
from hapticd_bench.commands.tables import make_console, measuring, print_verdicts, quantile_cells, show, titled_table


def start(
    starts: Annotated[int, typer.Option(min=1, max=1000, help="How many daemons to start.")] = 10,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure how long `hapticd run` takes to its first tick, and what of it.

    The start of an interpreter that does nothing is the reference.

    Example: hapticd bench start --starts 20
    """
    from hapticd_bench.start import START_S, measure

    watch = MachineWatch()
    with measuring(starts * START_S) as progress:
        found = measure(starts, progress)
    conditions = watch.end()
    if as_json:
        typer.echo(json.dumps({**asdict(found), "conditions": asdict(conditions)}, indent=2))
        return
    console = make_console()
    bare = f"{found.bare_ms.p50:.1f} ms"
    table = titled_table(
        console,
        f"From the command line, {starts} starts [starts of a bare interpreter, {bare}]",
        *("", "p50", "p99", "p99.9", "max"),
    )
    for what, quantiles in (
        ("to the helper that takes the force away", found.helper),
        ("to the process of the loop", found.loop),
        ("to the first tick", found.tick),
    ):
        table.add_row(what, *quantile_cells(quantiles))
    show(console, table)
    table = titled_table(console, "On a processor until then [the same]", "", "p50", "imports alone")
    for name, quantiles in found.processor.items():
        shares = ", ".join(f"{package} {share:.1f}" for package, share in found.imports[name].items())
        table.add_row(name, f"{quantiles.p50:.1f}", shares)
    show(console, table)
    print_verdicts(console, (), conditions)
