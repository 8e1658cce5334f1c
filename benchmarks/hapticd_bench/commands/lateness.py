"""`hapticd bench lateness`: how late the loop wakes beyond what the machine does to any loop."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from typing import Annotated

import typer

from hapticd.errors import ConfigError
from hapticd_bench.commands.tables import (
    make_console,
    measuring,
    print_bars,
    print_verdicts,
    quantile_cells,
    show,
    titled_table,
)


def lateness(
    blocks: Annotated[int, typer.Option(min=1, help="Blocks of each cell, in random order.")] = 4,
    block: Annotated[float, typer.Option(min=0.5, help="Length of a block [s].")] = 5.0,
    cpu: Annotated[
        int | None, typer.Option(min=0, help="Processor to measure on; the last one when not given.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Of the order of the blocks.")] = None,
    control: Annotated[bool, typer.Option(help="Measure the thread layout too, which has to fail.")] = True,
    quick: Annotated[bool, typer.Option("--quick", help="One block of 2 s a cell: too short to judge p99.9.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure how late the loop wakes beyond what the machine does to any loop.

    A witness in C sleeps to the same deadlines on the same processor at a higher priority; what the loop is later than
    its witness is its own. Judged against the same C program in the place of the loop, idle and beside two programs
    that compute. Needs SCHED_FIFO, locked memory and a C compiler.

    Example: hapticd bench lateness --blocks 8
    """
    from hapticd_bench import lateness as measured

    there = sorted(os.sched_getaffinity(0))
    if cpu is not None and cpu not in there:
        raise ConfigError(f"--cpu {cpu}: must be one that this process may use: {', '.join(map(str, there))}")
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
