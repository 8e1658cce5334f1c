"""`hapticd lsl`: a running daemon as Lab Streaming Layer streams."""

from __future__ import annotations

import json
import time
from dataclasses import asdict
from typing import Annotated

import typer

from hapticd.errors import HapticdError
from hapticd.paths import DEFAULT_INSTANCE
from hapticd_views.commands.signals import stop_signals

WARNING = (
    "warning  LSL listens on all addresses of this computer and encrypts nothing: any program that reaches it can\n"
    "         read these streams. liblsl has no setting against that; keep others out with a firewall on its ports,\n"
    "         16571 to 16604."
)


def lsl(
    duration: Annotated[
        float | None, typer.Option("--duration", "-d", min=0.0, help="How long [s]; until Ctrl-C when not given.")
    ] = None,
    instance: Annotated[str, typer.Option("--instance", "-i", help="Name of the daemon.")] = DEFAULT_INSTANCE,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was streamed as one JSON object.")] = False,
) -> None:
    """Stream a running daemon of this computer to Lab Streaming Layer, until Ctrl-C or for some time.

    Two streams: hapticd-INSTANCE-ticks, a sample a tick whose time stamp is the tick's deadline, and
    hapticd-INSTANCE-events, a JSON text for each marker, cycle, event and gap. LabRecorder finds both.

    Example: hapticd lsl
    """
    try:
        from hapticd_views.lsl.bridge import TOPICS, Bridge
    except (ModuleNotFoundError, RuntimeError) as error:  # pylsl raises the latter without its library
        raise HapticdError(f"streams need pylsl and liblsl: pip install 'hapticd[lsl]' ({_line(error)})") from None
    from hapticd.client import connect

    began_s = time.monotonic()
    bridge = Bridge()
    with connect(instance, topics=TOPICS) as daemon, stop_signals() as stopped:
        typer.echo(WARNING, err=True)
        typer.echo(f"streaming hapticd-{instance}-ticks and hapticd-{instance}-events; Ctrl-C ends it", err=True)
        while not stopped() and (duration is None or time.monotonic() - began_s < duration):
            records = daemon.receive(0.05)
            assert daemon.latest_status is not None
            bridge.take(records, daemon.latest_status)
    streamed = bridge.streamed
    if as_json:
        typer.echo(json.dumps(asdict(streamed)))
    else:
        missing = f"{streamed.missing} ticks missing" if streamed.missing else "no tick missing"
        typer.echo(f"{streamed.ticks} ticks, {streamed.texts} texts, {missing}")


def _line(error: Exception) -> str:
    return str(error).strip().splitlines()[0]
