"""`hapticd bench tick`: what a tick costs, and how many of them a daemon runs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from hapticd.telemetry.records import LATE_EDGES_US
from hapticd_bench.commands.tables import (
    make_console,
    measuring,
    print_verdicts,
    quantile_cells,
    show,
    titled_table,
)


def tick(
    ticks: Annotated[int, typer.Option(min=100, help="Ticks of each case, paced at 1 kHz and as many hot.")] = 4000,
    duration: Annotated[
        float, typer.Option(min=0.0, help="How long each real daemon runs [s]; 0 leaves them out.")
    ] = 5.0,
    rate: Annotated[
        list[float] | None,
        typer.Option(help="Rate of a real daemon [Hz], repeatable; 1000, 4000 and 8000 when not given."),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="100 ticks a case and no daemons: shows that it works.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure what a tick costs, and how many of them a daemon runs.

    For every installed law, every kind of shipped configuration, scenes of 0 to 8 walls and the pieces of the tick.
    Runs under SCHED_FIFO with memory locked when it may. Target: p99 of a tick body at most 3 % of the period at 1 kHz.

    Example: hapticd bench tick --duration 60
    """
    from hapticd_bench import tick as measured

    rounds = measured.ROUNDS
    rates_hz = tuple(rate or (1000.0, 4000.0, 8000.0))
    if quick:
        ticks, rounds, duration = 100, 1, 0.0
    with measuring(measured.duration_s(ticks, len(rates_hz), duration)) as progress:
        report = measured.measure(ticks, rounds, rates_hz, duration, progress)
    if as_json:
        typer.echo(json.dumps(asdict(report), indent=2))
        return
    console = make_console()
    for warning in report.warnings:
        console.print(f"[yellow]{escape(warning)}[/]")
    table = titled_table(
        console,
        "Body of a tick at 1 kHz [us]; ratios to the arithmetic in the same run",
        *(
            "case",
            "p50",
            "p99",
            "p99.9",
            "max",
            "> 3 %",
            "p50 ratio",
            "p99 ratio",
            "hot p50",
            "hot p99",
            "hot ratio",
        ),
    )
    for body in report.bodies:
        name = escape(f"{body.group} {body.name}")
        if body.problem:
            table.add_row(name, f"[red]{escape(body.problem)}[/]")
            continue
        table.add_row(
            name,
            *quantile_cells(body.paced_us),
            f"{body.over:.2%}",
            *(f"{value:.2f}" for value in (body.p50_ratio, body.p99_ratio)),
            *(f"{value:.1f}" for value in (body.hot_us.p50, body.hot_us.p99)),
            f"{body.hot_ratio:.2f}",
        )
    show(console, table)
    table = titled_table(
        console,
        "Pieces of it, energy-cycle on one wall, each with the cost of timing it [us]",
        *("piece", "p50", "p99", "p99.9", "max", "p50 without timing", "ratio"),
    )
    for piece in report.pieces:
        table.add_row(piece.name, *quantile_cells(piece.us), f"{piece.p50_net_us:.1f}", f"{piece.p50_ratio:.2f}")
    show(console, table)
    if report.rates:
        _rates(console, report.rates)
    for ran in report.rates:
        if ran.fault:
            console.print(f"[red]{ran.rate_hz:g} Hz: the loop stopped: {escape(ran.fault)}[/]")
        console.print(f"{ran.rate_hz:g} Hz, ticks by lateness: {_histogram(ran.late_histogram)}")
    print_verdicts(console, report.bars, report.conditions)


def _rates(console: Console, rates: Sequence[Any]) -> None:
    table = titled_table(
        console,
        "Real daemons: lateness and bodies of their ticks [us]",
        *("rate", "sustained", "ticks", "skipped", "not fetched", "late p50", "p99", "p99.9", "max", "body p50", "p99"),
    )
    for ran in rates:
        table.add_row(
            f"{ran.rate_hz:g} Hz",
            f"{ran.sustained_hz:.1f} Hz",
            *(str(count) for count in (ran.ticks, ran.skipped, ran.dropped)),
            *quantile_cells(ran.late_us),
            *(f"{value:.1f}" for value in (ran.busy_us.p50, ran.busy_us.p99)),
        )
    show(console, table)


def _histogram(counts: Sequence[int]) -> str:
    edges = [f"< {edge}" for edge in LATE_EDGES_US] + [f">= {LATE_EDGES_US[-1]}"]
    return ", ".join(f"{edge} us: {count}" for edge, count in zip(edges, counts, strict=True) if count)
