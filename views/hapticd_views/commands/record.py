"""`hapticd record`: a running daemon into MCAP files, and what there is to do with these."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hapticd.cli.group import Overview
from hapticd.errors import ConfigError, HapticdError
from hapticd.paths import DEFAULT_INSTANCE
from hapticd_views.commands.signals import stop_signals

if TYPE_CHECKING:
    from hapticd_views.recording.recorder import Progress

app = typer.Typer(cls=Overview, rich_markup_mode=None)

Output = Annotated[Path, typer.Option("--output", "-o", help="The file to write.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace the output file if it exists.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
File = Annotated[Path, typer.Argument(metavar="FILE", help="A recording.")]


@app.callback(invoke_without_command=True, epilog="Example: hapticd record --output press.mcap --duration 30")
def record(
    context: typer.Context,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE.mcap", help="The file; the time names it if not given."),
    ] = None,
    duration_s: Annotated[
        float | None, typer.Option("--duration", "-d", min=0.0, help="How long [s]; until Ctrl-C when not given.")
    ] = None,
    max_size_mb: Annotated[
        float | None, typer.Option("--max-size", min=0.01, help="Begin the next file at this size [MB].")
    ] = None,
    max_duration_s: Annotated[
        float | None, typer.Option("--max-duration", min=1.0, help="Begin the next file after this time [s].")
    ] = None,
    topics: Annotated[
        list[str] | None,
        typer.Option("--topics", help="position, energy, ...; may be repeated. Status and events come always."),
    ] = None,
    instance: Annotated[str, typer.Option("--instance", "-i", help="Name of the daemon.")] = DEFAULT_INSTANCE,
    connect: Annotated[
        str | None,
        typer.Option("--connect", metavar="ENDPOINT", help="A daemon's telemetry.tcp, tcp://HOST:PORT, elsewhere."),
    ] = None,
    control: Annotated[
        str | None, typer.Option("--control", metavar="ENDPOINT", help="Its control.tcp, for the configuration's text.")
    ] = None,
    keys: Annotated[
        Path | None, typer.Option("--keys", metavar="FILE", help="Your key file for it; $HAPTICD_KEYS when not given.")
    ] = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Record a running daemon to MCAP, until Ctrl-C or for some time; PlotJuggler and Lichtblick open the file.

    Every tick is in it, and what belongs to it: configuration, versions, device, computer, markers, events, gaps. A
    chunk is closed every 0.4 s: a kill loses no more than half a second. The daemon may be restarted in between.
    """
    if context.invoked_subcommand is not None:
        return
    with _extra():
        from hapticd_views.recording.recorder import MOST_UNREAD, Limits, Recorder
    from hapticd.client import connect as connected

    path = _mcap(output or Path(f"hapticd-{datetime.now(UTC):%Y%m%dT%H%M%SZ}.mcap"))
    size_bytes = None if max_size_mb is None else max_size_mb * 1e6
    wanted: dict[str, Any] = {"receive_high_water": MOST_UNREAD}
    if topics is not None:
        wanted["topics"] = [*_split(topics), "status", "event"]
    with (
        connected(instance, telemetry=connect, control=control, keys=keys, **wanted) as daemon,
        stop_signals() as stopped,
        _progress_line(path) as tell,
    ):
        done = Recorder(daemon, path, Limits(size_bytes, max_duration_s), overwrite).run(stopped, duration_s, tell)
    if as_json:
        typer.echo(json.dumps({**asdict(done), "files": [str(file) for file in done.files]}))
    else:
        names = str(done.files[0]) + (f" to {done.files[-1].name}" if len(done.files) > 1 else "")
        typer.echo(f"{names}: {_words(done)}")


@app.command("show", epilog="Example: hapticd record show press.mcap")
def show(file: File, as_json: AsJson = False) -> None:
    """Say what a recording is of, what happened in it, and what is missing."""
    with _extra():
        from hapticd_views.recording import read
        from hapticd_views.recording.summary import lines, summary
    recording = read(file)
    typer.echo(json.dumps(summary(recording), default=str) if as_json else "\n".join(lines(recording)))


@app.command("export", epilog="Example: hapticd record export press.mcap --output press.parquet")
def export(
    file: File,
    output: Annotated[Path, typer.Option("--output", "-o", help="A .csv, .parquet or .npz file.")],
    topic: Annotated[
        str, typer.Option("--topic", help="ticks: position, energy, damping and timing side by side; or one topic.")
    ] = "ticks",
    overwrite: Overwrite = False,
) -> None:
    """Write a recording as a table; every float comes back with the same bits."""
    with _extra():
        from hapticd_views.recording import read
        from hapticd_views.recording.export import export as exported
    recording = read(file)
    rows = exported(recording, output, topic, overwrite)
    typer.echo(f"{output}: {rows} rows" + (f"; {file} ends early: {recording.cut}" if recording.cut else ""))


@app.command("repair", epilog="Example: hapticd record repair cut.mcap --output whole.mcap")
def repair(file: File, output: Output, overwrite: Overwrite = False) -> None:
    """Make a complete file of one that was cut: all that can be read, with an index."""
    with _extra():
        from hapticd_views.recording.repair import repair as repaired
    count, cut = repaired(file, _mcap(output), overwrite)
    typer.echo(f"{output}: {count} messages; {file} {f'ends early: {cut}' if cut else 'is complete'}")


@contextmanager
def _extra() -> Iterator[None]:
    """Imports that need the extra, which the overview of all commands does not."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise HapticdError(f"recordings need {error.name}: pip install 'hapticd[record]'") from None


def _mcap(path: Path) -> Path:
    """The file that is to be written, whose name has to say what it is: readers go by it."""
    if path.suffix != ".mcap":
        raise ConfigError(f"{path}: must end in .mcap; `hapticd record export` makes .csv, .parquet and .npz of one")
    return path


def _split(topics: list[str]) -> list[str]:
    from hapticd.telemetry.wire import Topic

    found = [one for given in topics for one in given.replace(",", " ").split()]
    known = [topic.removeprefix("hapticd/") for topic in Topic]
    for one in found:
        if one.removeprefix("hapticd/") not in known:
            raise typer.BadParameter(f"{one!r} is not one of {', '.join(known)}", param_hint="'--topics'")
    return found


@contextmanager
def _progress_line(path: Path) -> Iterator[Callable[[Progress], object]]:
    if not sys.stderr.isatty():
        yield lambda _progress: None
        return
    from rich.console import Console

    with Console(stderr=True).status(f"recording to {path}; Ctrl-C ends it") as shown:
        yield lambda progress: shown.update(f"recording to {progress.files[-1]}: {_words(progress)}; Ctrl-C ends it")


def _words(progress: Progress) -> str:
    told = f"{progress.duration_s:.1f} s, {progress.ticks} ticks, {progress.bytes / 1e6:.2f} MB, "
    told += f"{progress.missing} ticks missing" if progress.gaps else "no tick missing"
    if progress.restarts:
        told += f", the daemon was started anew {progress.restarts} times"
    return told + (f", {progress.refused} messages refused" if progress.refused else "")
