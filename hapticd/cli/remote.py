"""Requests to a running daemon: `hapticd arm`, `disarm`, `calibrate`, `tare`, `clear`, `stop`, `mark`, `reload`.

Also the options that say which daemon: one of this computer by its name, or another computer's by its endpoint.
"""

from __future__ import annotations

import signal
import time
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from hapticd.cli.completion import instances
from hapticd.client import commands
from hapticd.client.commands import RefusedError, command
from hapticd.errors import InstanceError
from hapticd.paths import CONTROL, DEFAULT_INSTANCE, alive, locate
from hapticd.telemetry.records import Status

_ENDED_S = 15.0  # a ramp, and a driver that takes its time to let go of a device
_CALL_OFF = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

Instance = Annotated[str, typer.Option("--instance", "-i", help="Name of the daemon.", autocompletion=instances)]
Connect = Annotated[
    str | None,
    typer.Option("--connect", metavar="ENDPOINT", help="The daemon's control.tcp, tcp://HOST:PORT, instead of a name."),
]
Keys = Annotated[
    Path | None,
    typer.Option("--keys", metavar="FILE", help="Your key file for an endpoint; $HAPTICD_KEYS when not given."),
]


def arm(
    instance: Instance = DEFAULT_INSTANCE,
    connect: Connect = None,
    keys: Keys = None,
) -> None:
    """Let a running daemon apply forces.

    The device is enabled, and a wall that is already pressed comes in by a ramp.

    Example: hapticd arm --instance left
    """
    command("arm", instance, connect=connect, keys=keys)


def disarm(
    instance: Instance = DEFAULT_INSTANCE,
    connect: Connect = None,
    keys: Keys = None,
) -> None:
    """Ramp the force of a running daemon to zero.

    Returns when the device has let go; where it may not have, the error says so: switch the device off. Positions go
    on streaming.

    Example: hapticd disarm --instance left
    """
    command("disarm", instance, connect=connect, keys=keys, wait=True)


def clear(
    instance: Instance = DEFAULT_INSTANCE,
    connect: Connect = None,
    keys: Keys = None,
) -> None:
    """Clear the fault that stopped a running daemon.

    The device stays disarmed until `hapticd arm`.

    Example: hapticd clear --instance left
    """
    command("clear", instance, connect=connect, keys=keys)


def tare(
    instance: Instance = DEFAULT_INSTANCE,
    connect: Connect = None,
    keys: Keys = None,
) -> None:
    """Take the present position as the scene's origin.

    Positions count from here on every axis, and the walls stand relative to it, until the device is calibrated, lost
    or opened anew. The daemon must be disarmed: no wall moves under a hand that it pushes.

    Example: hapticd tare
    """
    command("tare", instance, connect=connect, keys=keys)


def stop(
    instance: Instance = DEFAULT_INSTANCE,
    connect: Connect = None,
    keys: Keys = None,
) -> None:
    """Ramp the force of a running daemon to zero and end it.

    Returns when a daemon of this computer has ended; where its device did not let go, the error says so. A service
    stays off until it is started again.

    Example: hapticd stop --instance left
    """
    place = None if connect else locate(CONTROL, instance).parent
    command("stop", instance, connect=connect, keys=keys)
    due_s = time.monotonic() + _ENDED_S
    while place is not None and alive(place):
        if time.monotonic() > due_s:
            raise InstanceError(f"{instance}: has not ended after {_ENDED_S:.0f} s; its log says what holds it up")
        time.sleep(0.02)


def mark(
    text: Annotated[str, typer.Argument(help="The marker: one line of at most 200 characters.")],
    instance: Instance = DEFAULT_INSTANCE,
    connect: Connect = None,
    keys: Keys = None,
) -> None:
    """Put a marker into a running daemon's event stream.

    It is event 111 with this text, and so in every recording and with every subscriber; armed or not.

    Example: hapticd mark "trial 3 begins"
    """
    command("mark", instance, connect=connect, keys=keys, text=text)


def calibrate(
    instance: Instance = DEFAULT_INSTANCE,
    countdown_s: Annotated[int, typer.Option("--countdown", min=0, max=60, help="Seconds to clear the workspace.")] = 5,
    connect: Connect = None,
    keys: Keys = None,
) -> None:
    """Calibrate a running daemon's device, which moves its arm.

    Let go of the arm and clear its workspace. Ctrl-C calls it off, during the countdown and afterwards, and so do
    SIGTERM, a terminal that is closed, and `hapticd disarm`. The daemon must be disarmed, and goes on streaming.

    Example: hapticd calibrate --countdown 10
    """
    # First: is there a daemon, and will it? A countdown says that the arm will move.
    status = Status.of(command("status", instance, connect=connect, keys=keys)["status"])
    if status.device_lost_timestamp:
        raise RefusedError("there is no device to calibrate: it was lost, and is being looked for")
    if status.armed:
        raise RefusedError("calibration moves the arm by itself: `hapticd disarm` first")
    for number in _CALL_OFF:
        if signal.getsignal(number) is not signal.SIG_IGN:  # nohup wants it to go on
            signal.signal(number, _call_off)
    try:
        for left_s in range(countdown_s, 0, -1):
            typer.echo(f"the arm will move by itself in {left_s} s; Ctrl-C to call it off", err=True)
            time.sleep(1.0)
        typer.echo("calibrating", err=True)
        commands.calibrate(instance, connect, keys)
    except KeyboardInterrupt:
        typer.echo("called off", err=True)
        raise


def _call_off(_signal: int, _frame: FrameType | None) -> None:
    """Interrupt once: a second signal, as impatience or a closing terminal sends it, must not keep the arm moving."""
    for number in _CALL_OFF:
        signal.signal(number, lambda *_: None)
    raise KeyboardInterrupt


def reload(
    instance: Instance = DEFAULT_INSTANCE,
    wait: Annotated[bool, typer.Option(help="Wait for the verdict; without it, only the daemon's events tell.")] = True,
    connect: Connect = None,
    keys: Keys = None,
) -> None:
    """Let a running daemon take its edited file over.

    Law, walls, limits and telemetry decimation change between two ticks, without a step in force; a file that cannot
    be used, or that changes what needs a restart, is refused and changes nothing: every problem is named, and the exit
    status is 2.

    Example: hapticd reload --instance left
    """
    command("reload", instance, connect=connect, keys=keys, wait=wait)
