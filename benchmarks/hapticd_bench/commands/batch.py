"""`hapticd bench batch`: the offline simulator next to the same computation in C."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Annotated

import typer

from hapticd.errors import HapticdError
from hapticd_bench.commands.tables import (
    make_console,
    show,
    titled_table,
)


def batch(
    points: Annotated[int, typer.Option(min=1, max=100_000, help="Loops of the grid.")] = 1000,
    seconds: Annotated[float, typer.Option(min=0.01, max=1000.0, help="Simulated time of each loop [s].")] = 3.0,
    repeats: Annotated[int, typer.Option(min=1, max=1000, help="Runs of each kind, in turns; the best counts.")] = 7,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure the offline simulator next to the same computation in C.

    Both end in the same states to the last bit, or this exits with 1. Needs a C compiler and the extra `study`.

    Example: hapticd bench batch --points 200 --json
    """
    try:
        from hapticd_bench.batch import measure
    except ModuleNotFoundError as missing:
        raise HapticdError(f"bench batch needs {missing.name}: pip install 'hapticd[study]'") from None
    figures = measure(points, seconds, repeats)
    if as_json:
        typer.echo(json.dumps(asdict(figures), indent=2))
    else:
        console = make_console()
        table = titled_table(
            console,
            f"{points} loops of {seconds:g} s, load {figures.load:.1f}",
            *("engine", "Mtick/s", "of C on one core"),
        )
        for name, rate, ratio in (
            ("C -O2, one core", figures.c_one_core, 1.0),
            ("compiled Python, one core", figures.one_core, figures.one_core_ratio),
            (f"compiled Python, {figures.threads} threads", figures.all_cores, figures.all_cores_ratio),
            ("interpreted Python", figures.interpreted, figures.interpreted_ratio),
        ):
            table.add_row(name, f"{rate:.2f}", f"{ratio:.3f}")
        show(console, table)
        console.print(f"same results to the last bit: {'yes' if figures.equal else 'NO'}")
    if not figures.equal:
        raise typer.Exit(1)
