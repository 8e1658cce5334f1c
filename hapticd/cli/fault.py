"""`hapticd fault`: the records that a daemon keeps of its faults."""

from __future__ import annotations

import io
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.text import Text

from hapticd import replacing
from hapticd.cli.group import Overview
from hapticd.cli.local_time import moment
from hapticd.cli.watch.plot import LABEL_WIDTH, SLICE_S, Trace, plot
from hapticd.errors import HapticdError
from hapticd.faults.export import write_csv
from hapticd.faults.record import FaultRecord, FaultSummary, read, read_header, summarise
from hapticd.faults.store import FaultStore
from hapticd.paths import DEFAULT_INSTANCE, fault_directories

app = typer.Typer(
    cls=Overview,
    help="List, show or export the records of faults.",
    epilog="Example: hapticd fault show",
    rich_markup_mode=None,
)

Instance = Annotated[str, typer.Option("--instance", "-i", help="Name of the daemon.")]
Directory = Annotated[
    Path | None, typer.Option("--directory", help="Where the records lie; the daemon's own place when not given.")
]
Name = Annotated[
    str | None, typer.Argument(metavar="NAME", help="Which record, or a part of its name; the newest when not given.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]

_PLOT_ROWS = 6


@app.command("list")
def list_records(instance: Instance = DEFAULT_INSTANCE, directory: Directory = None, as_json: AsJson = False) -> None:
    """List the fault records of a daemon, newest first.

    Example: hapticd fault list --instance left
    """
    headers, damaged = [], []
    for path in _paths(instance, directory):
        try:
            headers.append((path, read_header(path)))
        except HapticdError as error:  # one of them hides no other
            damaged.append(str(error))
    if as_json:
        listed = [{"name": path.stem, "path": str(path), **header} for path, header in headers]
        for entry in listed:
            entry.pop("trace", None)  # up to thousands of lines each; `show` has them
        typer.echo(json.dumps(listed))
    elif not headers and not damaged:
        typer.echo("no fault records in " + " or ".join(map(str, _places(instance, directory))), err=True)
    for path, header in [] if as_json else headers:
        event = header["event"]
        typer.echo(f"{path.stem}  {event['code']} {event['name']}  {event['text']}")
    if damaged:
        raise HapticdError("\n".join(damaged))


@app.command()
def show(
    name: Name = None,
    instance: Instance = DEFAULT_INSTANCE,
    directory: Directory = None,
    window: Annotated[float, typer.Option("--window", min=0.1, max=10.0, help="Time in the picture [s].")] = 0.5,
    trace: Annotated[
        bool, typer.Option("--trace", help="Print what driver and device had said to each other last.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Show what happened around a fault: the event, some figures, and a picture of position and force.

    Example: hapticd fault show --window 2
    """
    record = read(_find(name, instance, directory))
    summary = summarise(record)
    if as_json:
        typer.echo(json.dumps({"name": record.name, **record.header, "summary": asdict(summary)}))
        return
    for line in _lines(record, summary):
        typer.echo(line)
    if trace:
        for line in record.trace:
            typer.echo(_since(line, record.fault_ns))
        return
    console = Console(highlight=False)
    for picture in _picture(record, window, console.width):
        picture.rstrip()
        console.print(picture)


@app.command()
def export(
    name: Name = None,
    instance: Instance = DEFAULT_INSTANCE,
    directory: Directory = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File to write; standard output when not given.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the output file if it exists.")] = False,
) -> None:
    """Write every field of every tick of a fault record as CSV; t_s is the time since the fault.

    Example: hapticd fault export --output fault.csv
    """
    there = None if output is None else replacing.place(output, overwrite)
    record = read(_find(name, instance, directory))
    if there is None:
        write_csv(record, sys.stdout)
        return
    table = io.StringIO(newline="")
    write_csv(record, table)
    replacing.write(there, table.getvalue().encode())
    typer.echo(f"{output}: {len(record.ticks)} rows of {record.name}")


def _places(instance: str, directory: Path | None) -> list[Path]:
    return fault_directories(instance) if directory is None else [directory]


def _paths(instance: str, directory: Path | None) -> list[Path]:
    """All records, newest first.

    Raises:
        HapticdError: there are none that this user may read.
    """
    found: list[Path] = []
    refusal: HapticdError | None = None
    for place in _places(instance, directory):
        try:
            found += FaultStore(place).paths()
        except HapticdError as error:
            refusal = error
    if refusal is not None and not found:
        raise refusal
    return sorted(found, key=lambda path: path.name, reverse=True)


def _find(name: str | None, instance: str, directory: Path | None) -> Path:
    paths = _paths(instance, directory)
    matching = [path for path in paths if name is None or name in path.stem]
    if not matching:
        which = "no fault record" if name is None else f"no fault record {name!r}"
        raise HapticdError(f"{which} in {' or '.join(map(str, _places(instance, directory)))}")
    if name is not None and len(matching) > 1 and matching[0].stem != name:
        raise HapticdError(f"{name!r} could be any of {', '.join(path.stem for path in matching[:5])}")
    return matching[0]


def _lines(record: FaultRecord, summary: FaultSummary) -> list[str]:
    header = record.header
    event = header["event"]
    when = moment(event["timestamp"])
    gone = f"gone after {summary.ramp_ticks} ticks" if summary.ramp_ticks is not None else "not gone in this record"
    if not summary.after_s:
        gone = "no ticks after the fault"
    return [
        f"{event['code']} {event['name']}: {event['text']}",
        f"{when}, tick {event['seq']}, instance {header['instance']}, hapticd {header['version']}",
        f"device   {header['device']['model']} {header['device']['serial']}".rstrip() + f", driver {header['driver']}",
        f"config   {header['config']['file']} ({header['config']['sha256'][:12]}), law {header['law']}",
        f"record   {summary.ticks} ticks, {summary.before_s:.2f} s before and {summary.after_s:.2f} s after, "
        f"{summary.skipped} deadlines skipped",
        f"trace    {len(record.trace)} entries" + (", shown by --trace" if record.trace else ""),
        f"force    {summary.force_before_n:.3g} N before, at most {summary.peak_force_n:.3g} N after, {gone}",
    ]


def _since(line: str, fault_ns: int) -> str:
    at_ns, said = line.split(" ", 1)
    return f"{(int(at_ns) - fault_ns) * 1e-6:+12.3f} ms  {said}"


def _picture(record: FaultRecord, window_s: float, width: int) -> list[Text]:
    """Position and force of each axis, the fault in the middle unless the record ends there."""
    around = [tick for tick in record.ticks if abs(tick.deadline_ns - record.fault_ns) <= 0.5e9 * window_s]
    if not around:
        return []
    columns = 2 * max(1, width - LABEL_WIDTH)
    stretch = SLICE_S * columns / window_s
    first_ns = around[0].deadline_ns
    axes = len(around[0].position_m)
    position, force = Trace(axes), Trace(axes)
    for tick in around:
        at = (tick.deadline_ns - first_ns) * 1e-9 * stretch
        position.add(at, tick.position_m)
        force.add(at, tick.force_n)
    styles = ("cyan", "magenta", "green")
    lines = [Text("position [mm]", "bold")]
    lines += plot(position, width, _PLOT_ROWS, styles, scale=1e3, least=0.01)
    lines += [Text("force [N]", "bold"), *plot(force, width, _PLOT_ROWS, styles, least=0.1, marks=(0.0,))]
    newest, at_fault = (
        int((ns - first_ns) * 1e-9 * stretch / SLICE_S) for ns in (around[-1].deadline_ns, record.fault_ns)
    )
    return [*lines, Text(" " * (LABEL_WIDTH + (columns - 1 - max(0, newest - at_fault)) // 2) + "▲")]
