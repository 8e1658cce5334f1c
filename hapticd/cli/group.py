"""Groups of commands: their help, and one that imports only what is going to run; for any distribution."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping
from difflib import SequenceMatcher, get_close_matches
from typing import Any, ClassVar

import typer
from typer.core import TyperGroup

EXIT_MISUSED = 2


class Overview(TyperGroup):
    """A group whose help has of each command the whole first sentence, in as many lines as that takes.

    Attributes:
        ALIKE: how alike a mistyped name must be to one of these before that one is suggested, 0 to 1; above 1: never.
    """

    ALIKE: ClassVar[Mapping[str, float]] = {}

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Show the overview to those who name no command."""
        if not args and not self.invoke_without_command and not ctx.resilient_parsing:
            typer.echo(ctx.get_help(), err=True)
            raise typer.Exit(EXIT_MISUSED)
        return super().parse_args(ctx, args)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command; suggest another one for a name that there is not, if it is harmless or near enough."""
        self.suggest_commands = False  # typer's own knows no command that should not be suggested
        try:
            return super().resolve_command(ctx, args)
        except typer.TyperException as error:
            near = [] if args[0].startswith("-") else self._near(args[0])
            if near and hasattr(error, "message"):
                error.message = f"{error.message.rstrip('.')}. Did you mean {', '.join(map(repr, near))}?"
            raise

    def _near(self, name: str) -> list[str]:
        """The commands that may have been meant, the nearest first."""
        return [
            one
            for one in get_close_matches(name, list(self.commands))
            if SequenceMatcher(None, name, one).ratio() >= self.ALIKE.get(one, 0.0)
        ]

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a name and a sentence for each command."""
        listed = ((name, self.get_command(ctx, name)) for name in self.list_commands(ctx))
        rows = [(name, one.get_short_help_str(sys.maxsize)) for name, one in listed if one and not one.hidden]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


def lazy_group(commands: Mapping[str, tuple[str, str]], **settings: Any) -> typer.Typer:
    """A group that lists all its commands and imports one.

    Args:
        commands: name of each, with its function as `module:function` and its line in the overview.
        settings: of the `typer.Typer`, such as `help` and `epilog`.
    """

    class Group(Overview):
        def resolve_command(self, ctx: Any, args: list[str]) -> Any:
            name, listed, rest = super().resolve_command(ctx, args)
            if name is None or listed is None:
                return name, listed, rest
            module, _, function = commands[name][0].partition(":")
            one = typer.Typer(add_completion=False, rich_markup_mode=None)
            one.command(name)(getattr(importlib.import_module(module), function))
            return name, typer.main.get_command(one), rest

    app = typer.Typer(cls=Group, rich_markup_mode=None, **settings)
    app.callback()(_listed)
    for name, (_, summary) in commands.items():
        app.command(name, help=summary)(_listed)
    return app


def _listed() -> None:
    """Stand in the overview for a command that is not going to run."""
