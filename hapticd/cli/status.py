"""`hapticd status`: every daemon of this computer in a few lines, or as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Annotated, Any

import typer

from hapticd.cli.completion import instances
from hapticd.cli.local_time import moment
from hapticd.client.commands import command
from hapticd.errors import InstanceError
from hapticd.paths import living_instances
from hapticd.telemetry.records import Status, late_ticks

SCHEMA = 1
"""Version of what `--json` prints."""


def status(
    instance: Annotated[
        str | None, typer.Option("--instance", "-i", help="Only this daemon.", autocompletion=instances)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Say how every daemon of this computer is.

    Since when it runs, its law, whether it is armed, its rate, how many ticks were late, its faults. Exits with 1 when
    none runs, or one does not answer.

    Example: hapticd status --json
    """
    names = living_instances() if instance is None else [instance]
    said = [_asked(name) for name in names]
    if as_json:
        typer.echo(json.dumps({"schema": SCHEMA, "instances": said}, indent=2))
    else:
        for one in said:
            typer.echo("\n".join(_lines(one)))
        if not said:
            typer.echo("no daemon runs: start one with `hapticd run` or `systemctl start hapticd`", err=True)
    raise typer.Exit(0 if said and all("problem" not in one for one in said) else 1)


def _asked(name: str) -> dict[str, Any]:
    try:
        status: dict[str, Any] = command("status", name)["status"]
    except InstanceError as error:
        return {"name": name, "problem": str(error)}
    histogram = Status.of(status).late_histogram
    return {"name": name, "late_share": late_ticks(histogram) / (sum(histogram) or 1), "status": status}


def _lines(one: Mapping[str, Any]) -> list[str]:
    if "problem" in one:
        return [f"{one['name']}: {one['problem']}"]
    status = Status.of(one["status"])
    rate_hz = status.measured_rate_hz
    parts = (
        _mode(status),
        f"law {status.law}" + (" (failed, damping instead)" if status.fallback else ""),
        f"{f'{rate_hz:.0f}' if rate_hz else '?'} of {status.rate_hz:g} Hz",
        f"{100.0 * one['late_share']:.2g} % late",
    )
    device = status.device + (", simulated" if status.simulated else "")
    since = f", since {moment(status.started_timestamp)}" if status.started_timestamp else ""
    lines = [f"{one['name']}: {', '.join(parts)}", f"  {device}{since}"]
    if status.fault_code:
        lines.append(f"  fault {status.fault_code} at {moment(status.fault_timestamp)}: {status.fault_text}")
    if status.latched:
        lines.append("  no force until `hapticd clear`, then `hapticd arm`")
    lines.extend(_driven(status))
    lines.extend(f"  {warning}" for warning in status.warnings)
    return lines


def _mode(status: Status) -> str:
    """Whether it pushes, and why not; it does as long as it ramps the force out."""
    if status.device_lost_timestamp:
        return "no device"
    if status.latched:
        return "stopped by a fault" + (", releasing" if status.releasing else "")
    return "releasing" if status.releasing else "armed" if status.armed else "disarmed"


def _driven(status: Status) -> Iterator[str]:
    """A line for each thing that clients may drive."""
    counted = (status.remote_kind, status.remote_owner, status.remote_messages, status.remote_refused)
    for name, kind, owner, messages, refused in zip(status.remote_name, *counted, strict=True):
        whose = f"driven by {owner}" if owner else "no client"
        yield f"  {kind} {name}: {whose}, {messages} messages, {refused} refused"
