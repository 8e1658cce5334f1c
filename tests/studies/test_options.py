"""Every study has the short names of options that the other commands have."""

from __future__ import annotations

from typing import Any

import typer

from hapticd_studies.commands.app import app

SHORT = {"--output": "-o", "--config": "-c"}


def test_every_study_takes_the_short_names() -> None:
    studies: Any = typer.main.get_command(app)
    context = typer.Context(studies)
    seen = set()
    for name in studies.list_commands(context):
        _, study, _ = studies.resolve_command(context, [name])
        for parameter in study.params:
            for long in SHORT.keys() & set(parameter.opts):
                seen.add(long)
                assert SHORT[long] in parameter.opts, f"hapticd study {name} {long}"
    assert seen == set(SHORT)
