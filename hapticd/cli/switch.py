"""`hapticd switch`: another law, or other parameters of it, into the file and into force."""

from __future__ import annotations

import difflib
import os
import tomllib
from pathlib import Path
from typing import Annotated, Any

import typer

from hapticd.cli.completion import laws
from hapticd.cli.remote import Instance
from hapticd.client.commands import RefusedConfigError, command
from hapticd.client.edited import put_into_force
from hapticd.config.editing import with_law
from hapticd.config.file import read, replace, table_of
from hapticd.config.plugin_tables import ControllerConfig
from hapticd.config.problems import shown_value
from hapticd.errors import ConfigError
from hapticd.paths import CONTROL, DEFAULT_INSTANCE, SYSTEM_CONFIG, alive, locate


def switch(
    law: Annotated[str, typer.Argument(metavar="LAW", help="Installed law, or package.module.", autocompletion=laws)],
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", "-s", metavar="KEY=VALUE", help="Parameter of the law; may be given several times."),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option("--config", "-c", help="File to edit; that of the running daemon if absent."),
    ] = None,
    instance: Instance = DEFAULT_INSTANCE,
    dry_run: Annotated[bool, typer.Option("--dry-run", "-n", help="Show the edit and do nothing.")] = False,
) -> None:
    """Put another law into the file, and into force.

    Comments and layout of the file stay. A law or a parameter that cannot be used changes nothing, and neither does a
    file that the daemon refuses. Parameters of the law before leave with it and stay behind as a comment.

    Example: hapticd switch tdpa --set damping_cap_n_s_per_m=20 --dry-run
    """
    given = dict(_parameter(setting) for setting in settings or [])
    running = _running_file(instance)
    path = config or running or SYSTEM_CONFIG
    if path == SYSTEM_CONFIG and not (config or path.exists()):
        raise ConfigError(f"no daemon {instance!r} runs, and there is no {path}: name the file with --config")
    before = read(path)
    after = with_law(before, str(path), law, given)
    if dry_run:
        typer.echo("".join(_difference(before, after, str(path))), nl=False)
        return
    ours = running is not None and _same(path, running)
    if after != before and not ours:
        replace(path, after)
    if running is None:
        outcome = f"no daemon {instance!r} runs"
        if after != before:
            outcome += "; it has effect at its next start"
    elif not ours:
        outcome = f"daemon {instance!r} runs {running} and goes on with that"
    else:
        _take_over(path, before, after, instance)
        outcome = f"daemon {instance!r} has {'read it again' if after == before else 'taken it over'}"
    for line in _changes(before, after) or ["nothing to change" if after == before else "says the same in other words"]:
        typer.echo(f"{path}: {line}")
    typer.echo(outcome)


def _parameter(setting: str) -> tuple[str, Any]:
    """Key and value of KEY=VALUE; the value as in TOML, where a text needs no quotes."""
    key, equals, value = setting.partition("=")
    key, value = key.strip(), value.strip()
    if not equals or not key or not value:
        raise ConfigError(f"--set {setting}: must be KEY=VALUE, such as window=2")
    try:
        read_as = tomllib.loads(f"value = {value}")
    except ValueError:
        return key, value
    return key, read_as["value"] if len(read_as) == 1 else value


def _running_file(instance: str) -> Path | None:
    """The file that a running daemon has in force; None while none runs.

    Raises:
        InstanceError: one runs and does not answer, so that it is not known.
    """
    if not alive(locate(CONTROL, instance).parent):
        return None
    return Path(command("status", instance)["status"]["config_file"])


def _same(path: Path, other: Path) -> bool:
    try:
        return path.samefile(other)
    except OSError:
        return False


def _take_over(path: Path, before: str, after: str, instance: str) -> None:
    try:
        put_into_force(path, before, after, instance)
    except RefusedConfigError:
        if after != before and read(path) == before:
            typer.echo(f"{path}: refused by the daemon; the file is as it was", err=True)
        raise


def _changes(before: str, after: str) -> list[str]:
    """What another law or parameter there is, a line each."""
    old, new = _controller(before), _controller(after)
    lines = []
    for key in [*new, *(key for key in old if key not in new)]:
        if old.get(key) != new.get(key):
            is_now = f"{key} = {shown_value(new[key])}" if key in new else f"{key} is gone"
            lines.append(f"{is_now} ({f'was {shown_value(old[key])}' if key in old else 'was not set'})")
    return lines


def _controller(text: str) -> dict[str, Any]:
    table = table_of(text).get("controller", {})
    params = table.get("params", {})
    law = {"controller.law": table.get("law", ControllerConfig().law)}
    return {**law, **{f"controller.params.{key}": value for key, value in params.items()}}


def _difference(before: str, after: str, name: str) -> list[str]:
    lines = difflib.unified_diff(before.splitlines(True), after.splitlines(True), name, f"{name} (edited)")
    return [line if line.endswith("\n") else f"{line}{os.linesep}" for line in lines]
