"""`hapticd study`: the studies, each imported only when it is wanted, since they need the extra `study`."""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any, Final

import typer
from typer.core import TyperGroup

STUDIES: Final = {
    "paper": "Run every simulation and experiment of the paper, and say what reproduces.",
    "zwidth": "Map where laws keep a pressed wall stable, over any two parameters.",
    "robustness": "Try laws and readings on random devices.",
    "accuracy": "Measure what every shortcut costs in accuracy, and all accuracy in time.",
    "scene": "Find the smallest model that keeps every answer of a scene.",
    "extremes": "Hold the model's arithmetic against exact answers, over many decades.",
}
"""Every study with its line in the overview. `hapticd.study.NAME.command` has a function `command`."""


class _Studies(TyperGroup):
    """Lists every study, and imports the one that is going to run."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        name, listed, rest = super().resolve_command(ctx, args)
        if name is None or listed is None:
            return name, listed, rest
        one = typer.Typer(add_completion=False, rich_markup_mode=None)
        one.command(name)(importlib.import_module(f"hapticd.study.{name}.command").command)
        return name, typer.main.get_command(one), rest


app = typer.Typer(
    cls=_Studies,
    help="Put laws to the test offline, over many runs. Needs: pip install 'hapticd[study]'",
    epilog="Example: hapticd study paper --output paper",
    rich_markup_mode=None,
)


@app.callback(invoke_without_command=True)
def overview(context: typer.Context) -> None:
    """List the studies."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def _listed() -> None:
    """Stand in the overview for a study that is not going to run."""


for _name, _summary in STUDIES.items():
    if importlib.util.find_spec(f"hapticd.study.{_name}.command") is not None:
        app.command(_name, help=_summary)(_listed)
