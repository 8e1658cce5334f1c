"""`hapticd bench viewers`: everybody looks at one daemon."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from hapticd.errors import HapticdError
from hapticd.measure import MachineWatch, doubtful
from hapticd.paths import default_config
from hapticd_bench.commands.tables import make_console, measuring, print_verdicts, quantile_cells, show, titled_table


def viewers(
    duration: Annotated[float, typer.Option(min=1.0, max=1e6, help="How long, half of it without them [s].")] = 120.0,
    config: Annotated[
        Path | None, typer.Option("--config", "-c", help="Configuration; the default one when not given.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure what two recorders, a dashboard with a page and 14 subscribers cost.

    One daemon, in turns with and without them; and whether any of them misses a tick.

    Example: hapticd bench viewers --duration 1200
    """
    try:
        from hapticd_bench.viewers import measure
    except ModuleNotFoundError as error:
        raise HapticdError(f"viewers need {error.name}: pip install 'hapticd[record,dashboard]'") from None

    watch = MachineWatch()
    with measuring(duration) as progress:
        found = measure(config or default_config(), duration, progress)
    conditions = watch.end()
    # A rival makes ticks late; none makes a reader miss one that was sent.
    bars = [found.bars[0], *doubtful(found.bars[1:], conditions)]
    if as_json:
        told = {**asdict(found), "bars": [asdict(bar) for bar in bars], "conditions": asdict(conditions)}
        typer.echo(json.dumps(told, indent=2))
        return
    console = make_console()
    head = ("", "ticks", "skipped", "late p50 us", "p99", "p99.9", "max")
    table = titled_table(console, f"The loop, {found.seconds:.0f} s each", *head)
    for name, late, skipped in (
        ("without viewers", found.alone, found.skipped_alone),
        ("with viewers", found.watched, found.skipped_watched),
    ):
        table.add_row(name, str(late.count), str(skipped), *quantile_cells(late))
    show(console, table)
    table = titled_table(console, "Ticks of the readers", "", "got", "did not get")
    for name, ticks in found.ticks.items():
        table.add_row(name, str(ticks), str(found.missing[name]))
    show(console, table)
    table = titled_table(console, "Processor time, % of one processor", "", "without viewers", "with viewers")
    for share in found.shares:
        table.add_row(share.program, *(f"{100.0 * each:.1f}" for each in (share.alone, share.watched)))
    show(console, table)
    print_verdicts(console, bars, conditions)
