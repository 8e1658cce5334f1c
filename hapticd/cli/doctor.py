"""`hapticd doctor`: what keeps this computer from running a good loop and from reaching its device."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from hapticd.doctor.configuration import Wanted
from hapticd.doctor.examination import SCHEMA, Examination, verdict
from hapticd.doctor.finding import Finding, Mark
from hapticd.doctor.latency import Latency
from hapticd.paths import DEFAULT_INSTANCE, default_config, runtime_directory
from hapticd.progress import progress_bar
from hapticd.telemetry.records import LATE_EDGES_US
from hapticd.version import __version__

_STYLES: dict[Mark, str] = {"ok": "green", "advice": "yellow", "problem": "bold red", "unknown": "cyan"}
_COUNTED = {"problem": "problems", "advice": "advice", "unknown": "could not tell", "ok": "ok"}
_MARK_WIDTH = 8
_TITLE_WIDTH = 13
_INDENT = 4
_WIDEST = 110
_WORD = re.compile(r"""(?:[^\s'"]|'[^']*'|"[^"]*")+""")
"""A word of a command line, with what is quoted in it."""


def doctor(
    config: Annotated[
        Path | None,
        typer.Option(
            "--config", "-c", help="Configuration file; /etc/hapticd/hapticd.toml or the shipped one when not given."
        ),
    ] = None,
    instance: Annotated[str, typer.Option("--instance", "-i", help="Name of the daemon.")] = DEFAULT_INSTANCE,
    duration: Annotated[
        float, typer.Option("--duration", min=0.1, max=3600.0, help="How long to measure the loop [s].")
    ] = 5.0,
    no_latency: Annotated[bool, typer.Option("--no-latency", help="Do not measure it.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Say what keeps this computer from running a good loop.

    Looks at kernel, rights, processors, memory, devices, files and sockets, measures how late a loop wakes and how
    long its tick computes, and names the command that mends each finding. Changes nothing. Exits with 1 when there was
    a problem.

    Example: hapticd doctor --config /etc/hapticd/hapticd.toml
    """
    runtime_directory(instance)  # a name that no directory can have is a misuse
    examination = Examination(Wanted.of(config or default_config()), instance)
    shown = None if as_json else _Shown(Console(highlight=False), examination)
    findings = []
    for finding in _found(examination, 0.0 if no_latency else duration):
        findings.append(finding)
        if shown is not None:
            shown.finding(finding)
    if shown is not None:
        shown.end(findings)
    else:
        typer.echo(json.dumps(_report(examination, findings), indent=2))
    raise typer.Exit(1 if verdict(findings) == "problem" else 0)


def _found(examination: Examination, seconds: float) -> Iterator[Finding]:
    """Every finding as soon as it is known; the measurement, when there is one, comes last."""
    yield from examination.findings()
    if seconds:
        with progress_bar(1.0, f"measuring {seconds:g} s") as tell:
            measured = examination.measured(seconds, lambda share: tell(completed=share))
        yield from measured


class _Shown:
    """The report as it grows, for people."""

    def __init__(self, console: Console, examination: Examination) -> None:
        self._console = console
        self._examination = examination
        self._width = min(console.width, _WIDEST)
        wanted = examination.wanted
        console.print(
            Text(f"{wanted.path}: {wanted.driver} at {wanted.loop.rate_hz:g} Hz, instance {examination.instance}"),
            width=self._width,
        )
        console.print()

    def finding(self, finding: Finding) -> None:
        """A row, and below it what mends it."""
        table = Table.grid()
        table.add_column(width=_MARK_WIDTH)
        table.add_column(width=_TITLE_WIDTH)
        table.add_column(overflow="fold")
        mark = "?" if finding.mark == "unknown" else finding.mark
        table.add_row(Text(mark, _STYLES[finding.mark]), finding.title, Text(finding.text))
        self._console.print(table, width=self._width)
        for command in finding.mend:
            for line in folded(command, self._width - _INDENT):
                self._console.print(
                    Text(" " * _INDENT + line, "dim" if line.startswith("#") else "bold"), soft_wrap=True
                )

    def end(self, findings: list[Finding]) -> None:
        """The histogram, and how many findings there are of each kind."""
        if self._examination.latency is not None:
            self._histogram(self._examination.latency)
        counts = {mark: sum(finding.mark == mark for finding in findings) for mark in _COUNTED}
        self._console.print()
        self._console.print(
            Text(", ".join(f"{name}: {counts[mark]}" for mark, name in _COUNTED.items() if counts[mark]))
        )

    def _histogram(self, latency: Latency) -> None:
        edges = [0, *LATE_EDGES_US]
        names = [f"{low} to {high} us" for low, high in pairwise(edges)]
        names.append(f"over {LATE_EDGES_US[-1]} us")
        seen = [index for index, count in enumerate(latency.histogram) if count]
        largest = max(latency.histogram)
        room = self._width - _INDENT - 34
        self._console.print()
        quantiles = latency.late_us
        self._console.print(
            Text(
                f"Late by, of {quantiles.count} ticks: p50 {quantiles.p50:.0f}, p99 {quantiles.p99:.0f}, "
                f"p99.9 {quantiles.p999:.0f}, max {quantiles.max:.0f} us"
            )
        )
        for index in range(seen[0], seen[-1] + 1) if seen else ():
            count = latency.histogram[index]
            bar = "█" * round(room * count / largest) or ("▏" if count else "")
            self._console.print(Text(f"{'':{_INDENT}}{names[index]:>18} {count:>8} {bar}"))


def folded(command: str, width: int) -> list[str]:
    """A command in lines that a shell takes as one; no word is torn, and a remark at its end has lines of its own."""
    words = _WORD.findall(command)
    remark = words.index("#") if "#" in words else len(words)
    lines = _filled(words[:remark], width, "    ", " \\")
    return lines + [f"# {line}" for line in _filled(words[remark + 1 :], width - 2, "", "")]


def _filled(words: list[str], width: int, indent: str, joint: str) -> list[str]:
    lines: list[str] = []
    for word in words:
        if lines and len(lines[-1]) + 1 + len(word) + len(joint) <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(f"{indent}{word}" if lines else word)
    return [line + joint for line in lines[:-1]] + lines[-1:]


def _report(examination: Examination, findings: list[Finding]) -> dict[str, Any]:
    """What a program reads; keys never change meaning."""
    wanted = examination.wanted
    latency = examination.latency
    return {
        "schema": SCHEMA,
        "version": __version__,
        "config": str(wanted.path),
        "driver": wanted.driver,
        "rate_hz": wanted.loop.rate_hz,
        "instance": examination.instance,
        "verdict": verdict(findings),
        "findings": [asdict(finding) for finding in findings],
        "late_edges_us": LATE_EDGES_US,
        "latency": None if latency is None else asdict(latency),
    }
