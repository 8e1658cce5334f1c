"""`hapticd controllers`: the installed laws and the parameters of each."""

from __future__ import annotations

from typing import Annotated

import typer

from hapticd import registry
from hapticd.cli import catalogue


def controllers(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Only this law, also `package.module`.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON array, an object a law.")] = False,
) -> None:
    """List the installed laws and their parameters.

    A law that cannot be imported is listed with the reason.

    Example: hapticd controllers energy-cycle
    """
    plugins = catalogue.installed(registry.CONTROLLERS, name, registry.law, lambda law: law.Params)
    catalogue.show(plugins, "controller.params", as_json)
