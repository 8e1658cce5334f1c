"""`hapticd devices`: the installed drivers and the options of each."""

from __future__ import annotations

from typing import Annotated

import typer

from hapticd import registry
from hapticd.cli import catalogue


def devices(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Only this driver.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON array, an object a driver.")] = False,
) -> None:
    """List the installed device drivers and their options.

    A driver that cannot be imported is listed with the reason.

    Example: hapticd devices loopback
    """
    plugins = catalogue.installed(registry.DRIVERS, name, registry.driver, lambda driver: driver.Options)
    catalogue.show(plugins, "device.options", as_json)
