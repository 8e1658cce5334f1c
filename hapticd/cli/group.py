"""A group of commands that imports only the one that is going to run; for command groups of any distribution."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

import typer
from typer.core import TyperGroup


def lazy_group(commands: Mapping[str, tuple[str, str]], **settings: Any) -> typer.Typer:
    """A group that lists all its commands and imports one.

    Args:
        commands: name of each, with its function as `module:function` and its line in the overview.
        settings: of the `typer.Typer`, such as `help` and `epilog`.
    """

    class Group(TyperGroup):
        def resolve_command(self, ctx: Any, args: list[str]) -> Any:
            name, listed, rest = super().resolve_command(ctx, args)
            if name is None or listed is None:
                return name, listed, rest
            module, _, function = commands[name][0].partition(":")
            one = typer.Typer(add_completion=False, rich_markup_mode=None)
            one.command(name)(getattr(importlib.import_module(module), function))
            return name, typer.main.get_command(one), rest

    app = typer.Typer(cls=Group, rich_markup_mode=None, **settings)
    app.callback(invoke_without_command=True)(_overview)
    for name, (_, summary) in commands.items():
        app.command(name, help=summary)(_listed)
    return app


def _overview(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def _listed() -> None:
    """Stand in the overview for a command that is not going to run."""
