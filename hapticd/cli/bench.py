"""`hapticd bench`: what parts of the service cost on this machine, next to a reference measured in the same run."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from hapticd.cli.bench_switch import switch
from hapticd.cli.output import make_console, measuring, print_bars, print_verdicts, quantile_cells, show, titled_table
from hapticd.cli.rig import rig
from hapticd.cli.soak import soak
from hapticd.contracts.errors import HapticdError
from hapticd.telemetry.status import LATE_EDGES_US

app = typer.Typer(
    help="Measure what the service costs on this machine, next to a reference measured in the same run.",
    epilog="Example: hapticd bench tick    What the figures mean: docs/benchmarks.md",
    rich_markup_mode=None,
)

_JSON = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]

app.command()(rig)
app.command()(soak)
app.command()(switch)


@app.callback(invoke_without_command=True)
def overview(context: typer.Context) -> None:
    """List the benchmarks."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@app.command()
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
    as_json: _JSON = False,
) -> None:
    """Measure what a tick costs, and how many of them a daemon runs.

    For every installed law, every kind of shipped configuration, scenes of 0 to 8 walls and the pieces of the tick.
    Runs under SCHED_FIFO with memory locked when it may. Target: p99 of a tick body at most 3 % of the period at 1 kHz.

    Example: hapticd bench tick --duration 60
    """
    from hapticd.bench import tick as measured

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


@app.command()
def lateness(
    blocks: Annotated[int, typer.Option(min=1, help="Blocks of each cell, in random order.")] = 4,
    block: Annotated[float, typer.Option(min=0.5, help="Length of a block [s].")] = 5.0,
    cpu: Annotated[
        int | None, typer.Option(min=0, help="Processor to measure on; the last one when not given.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Of the order of the blocks.")] = None,
    control: Annotated[bool, typer.Option(help="Measure the thread layout too, which has to fail.")] = True,
    quick: Annotated[bool, typer.Option("--quick", help="One block of 2 s a cell: too short to judge p99.9.")] = False,
    as_json: _JSON = False,
) -> None:
    """Measure how late the loop wakes beyond what the machine does to any loop.

    A witness in C sleeps to the same deadlines on the same processor at a higher priority; what the loop is later than
    its witness is its own. Judged against the same C program in the place of the loop, idle and beside two programs
    that compute. Needs SCHED_FIFO, locked memory and a C compiler.

    Example: hapticd bench lateness --blocks 8
    """
    from hapticd.bench import lateness as measured

    if quick:
        blocks, block = 1, 2.0
    with measuring(len(measured.plan(blocks, control)) * block) as progress:
        report = measured.measure(blocks, block, control, cpu, seed, progress)
    if as_json:
        typer.echo(json.dumps(asdict(report), indent=2))
        return
    console = make_console()
    table = titled_table(
        console,
        f"Excess over the witness at 1 kHz [us], processor {report.cpu}, {report.blocks} x {report.block_s:g} s a cell",
        *("loop", "load", "joined", "skipped", "p50", "p99", "p99.9", "max", "> 200 us"),
        *("witness p99.9", "> 200 us", "skipped", "others"),
    )
    for cell in report.cells:
        table.add_row(
            cell.loop,
            cell.load,
            *(str(cell.joined), str(cell.loop_skipped)),
            *quantile_cells(cell.excess_us),
            f"{cell.excess_late:.2%}",
            f"{cell.witness_us.p999:.1f}",
            f"{cell.witness_late:.2%}",
            str(cell.witness_skipped),
            f"{cell.others:.2f}",
        )
    show(console, table)
    table = titled_table(
        console,
        "Lateness itself, and bodies of the loop's ticks [us]",
        *("loop", "load", "p50", "p99", "p99.9", "max", "> 1 ms", "body p50", "body p99", "body p99.9"),
    )
    for cell in report.cells:
        body = [f"{value:.1f}" for value in (cell.busy_us.p50, cell.busy_us.p99, cell.busy_us.p999)]
        table.add_row(
            *(cell.loop, cell.load),
            *quantile_cells(cell.late_us),
            str(cell.loop_over_1ms),
            *(body if cell.busy_us.count else ()),
        )
    show(console, table)
    if report.thread_bars:
        console.print("The thread layout, which has to miss some of these:")
        print_bars(console, report.thread_bars)
        console.print()
    print_verdicts(console, report.bars, report.conditions)


@app.command()
def telemetry(
    seconds: Annotated[float, typer.Option(min=0.1, max=600.0, help="Length of each measurement [s].")] = 5.0,
    quick: Annotated[bool, typer.Option("--quick", help="A quarter of a second each: shows that it works.")] = False,
    as_json: _JSON = False,
) -> None:
    """Measure what publishing costs, with 0, 1 and 16 subscribers.

    Example: hapticd bench telemetry --seconds 10 --json
    """
    from hapticd.bench.telemetry import measure

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


@app.command()
def batch(
    points: Annotated[int, typer.Option(min=1, max=100_000, help="Loops of the grid.")] = 1000,
    seconds: Annotated[float, typer.Option(min=0.01, max=1000.0, help="Simulated time of each loop [s].")] = 3.0,
    repeats: Annotated[int, typer.Option(min=1, max=1000, help="Runs of each kind, in turns; the best counts.")] = 7,
    as_json: _JSON = False,
) -> None:
    """Measure the offline simulator next to the same computation in C.

    Both end in the same states to the last bit, or this exits with 1. Needs a C compiler and the extra `study`.

    Example: hapticd bench batch --points 200 --json
    """
    try:
        from hapticd.bench.batch import measure
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
