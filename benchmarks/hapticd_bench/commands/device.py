"""`hapticd bench device`: what a device's driver costs."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from hapticd.config.loading import load
from hapticd.paths import default_config
from hapticd_bench.commands.tables import make_console, measuring, print_verdicts, quantile_cells, show, titled_table


def device(
    config: Annotated[
        Path | None, typer.Option("--config", "-c", help="Configuration; the default one when not given.")
    ] = None,
    ticks: Annotated[int, typer.Option(min=100, max=1_000_000, help="Ticks of each, at the loop's rate.")] = 4000,
    quick: Annotated[bool, typer.Option("--quick", help="200 ticks: shows that it works.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure what a tick costs on the configured device, next to the simulated one.

    The loop is the daemon's, at the configuration's rate and under its law, in one wall in the place of its scene, and
    with a force of at most 1 mN. The device is opened and armed some ten times, so that an arm that carries itself
    sinks in between: hold it. End a daemon that has the device first.

    Example: hapticd bench device --config lab.toml
    """
    from hapticd_bench.device import duration_s, measure

    loaded = load(config or default_config())
    ticks = 200 if quick else ticks
    with measuring(duration_s(loaded, ticks)) as progress:
        report = measure(loaded, ticks, progress)
    if as_json:
        typer.echo(json.dumps(asdict(report), indent=2))
        return
    console = make_console()
    for warning in report.warnings:
        console.print(f"[yellow]{escape(warning)}[/]")
    table = titled_table(
        console,
        f"Body of a tick at {report.rate_hz:g} Hz [us]; ratios to the simulated device in the same run",
        *("", "p50", "p99", "p99.9", "max", "p50 ratio", "p99 ratio"),
    )
    ratios = f"{report.p50_ratio:.2f}", f"{report.p99_ratio:.2f}"
    table.add_row(escape(report.driver), *quantile_cells(report.device_us), *ratios)
    table.add_row("  of that its read", *quantile_cells(report.read_us))
    if not report.disarmed:
        table.add_row("  of that its write", *quantile_cells(report.write_us))
    table.add_row("loopback", *quantile_cells(report.simulated_us))
    show(console, table)
    if report.disarmed:
        console.print(f"[yellow]nothing was written: {escape(report.disarmed)}[/]", soft_wrap=True)
    console.print(f"p99 on {escape(report.driver)}: {report.of_period:.1%} of the period")
    print_verdicts(console, (), report.conditions)
