"""`hapticd devices`: which devices the installed drivers find, and the options of a driver."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import chain
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.text import Text

from hapticd import discovery, plugins
from hapticd.cli.doctor import folded
from hapticd.cli.plugins import describe_plugins, show_plugins
from hapticd.config.loading import load
from hapticd.discovery import Discovery
from hapticd.doctor.finding import for_this_user
from hapticd.driver import DriverOptions
from hapticd.errors import ConfigError
from hapticd.paths import default_config

_HEAD = ("driver", "device", "serial", "where", "state")
_STYLES = {"ready": "green", "usable": "yellow", "cannot be used": "bold red"}
_INDENT = 4

Row = tuple[str, ...]
Details = tuple[str, Sequence[str]]


def devices(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Only this driver, also `package.module`, with its options.")
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            "--config",
            "-c",
            help="Configuration file, whose [device.options] tell its driver where to look; "
            "/etc/hapticd/hapticd.toml or the shipped one when not given.",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON array, an object a driver.")] = False,
) -> None:
    """List the devices that the installed drivers find.

    Also those of a driver that the configuration names by its module. One that cannot be used is listed with the reason
    and with what mends it. No device is moved; some have to be opened for a moment, so one that the daemon has shows as
    held. With NAME, the options of that driver follow.

    Example: hapticd devices omega7
    """
    drivers = describe_plugins(plugins.DRIVERS, name, plugins.driver, lambda driver: driver.Options)
    configured, options = _configured(config)
    if name is None and configured not in ("", *plugins.names(plugins.DRIVERS)):  # it is named by its module
        drivers += describe_plugins(plugins.DRIVERS, configured, plugins.driver, lambda driver: driver.Options)
    wanted = {plugin.name: options if plugin.name == configured else None for plugin in drivers if not plugin.problem}
    looked = {one.driver: one for one in discovery.look(wanted)}
    if as_json:
        found = [looked.get(plugin.name, Discovery(plugin.name, problem=plugin.problem)) for plugin in drivers]
        rows = [
            {
                **asdict(plugin),
                "problem": one.problem,
                "looks": one.looks,
                "devices": [asdict(device) for device in one.devices],
                "diagnoses": [asdict(diagnosis) for diagnosis in one.diagnoses],
            }
            for plugin, one in zip(drivers, found, strict=True)
        ]
        typer.echo(json.dumps(rows, indent=2, default=str))
        return
    console = Console(highlight=False)
    _show(
        console,
        [
            looked.get(plugin.name, Discovery(plugin.name, problem=f"cannot be used: {plugin.problem}"))
            for plugin in drivers
        ],
    )
    console.print()
    if name is None:
        console.print("hapticd devices NAME lists the options of a driver.", style="dim")
    else:
        show_plugins(drivers, "device.options", False)


def _configured(config: Path | None) -> tuple[str, DriverOptions | None]:
    """The configured driver and its options; a file that was not named may be unusable."""
    try:
        loaded = load(config or default_config())
    except ConfigError:
        if config is not None:
            raise
        return "", None
    return loaded.config.device.driver, loaded.options


def _show(console: Console, looked: Sequence[Discovery]) -> None:
    """A line a device, what is to be known of it below, and a line for a driver that found none."""
    lines = list(chain.from_iterable(map(_lines, looked)))
    rows = [_HEAD, *(row for row, _ in lines)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEAD) - 1)]
    for row, details in [(_HEAD, ()), *lines]:
        text = Text("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=False)) + "  ")
        text.append(row[-1], "" if row is _HEAD else _STYLES.get(row[-1], "dim"))
        if row is _HEAD:
            text.stylize("bold")
        console.print(text, soft_wrap=True)
        for said, mend in details:
            for line in textwrap.wrap(said, max(40, console.width - _INDENT), break_long_words=False):
                console.print(Text(" " * _INDENT + line), soft_wrap=True)
            for command in map(for_this_user, mend):
                for line in folded(command, max(40, console.width - _INDENT)):
                    style = "dim" if line.startswith("#") else "bold"
                    console.print(Text(" " * _INDENT + line, style), soft_wrap=True)


def _lines(looked: Discovery) -> Iterator[tuple[Row, tuple[Details, ...]]]:
    for device in looked.devices:
        state = "cannot be used" if device.problem else "usable" if device.note else "ready"
        told: list[Details] = [(device.problem, device.mend), (device.note, ())]
        said = tuple(details for details in told if details[0])
        yield (looked.driver, device.model, device.serial or "-", device.where or "-", state), said
    # What keeps a driver from every device was already said of each that was found.
    lacks = [(one.text, one.mend) for one in looked.diagnoses if one.mark == "problem" and not looked.devices]
    if looked.problem:
        yield (looked.driver, "-", "-", "-", "could not look"), ((looked.problem, ()), *lacks)
    elif not looked.looks:
        why = "it has no `find`, and so it cannot tell which devices are there; hapticd run opens one all the same"
        yield (looked.driver, "-", "-", "-", "does not look"), ((why, ()), *lacks)
    elif not looked.devices:
        yield (looked.driver, "-", "-", "-", "none found"), ((looked.absent, ()), *lacks)
