"""What is installed under an entry-point group, with its parameters: `hapticd devices` and `hapticd controllers`."""

from __future__ import annotations

import json
import typing
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any, Literal

import typer
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from hapticd import plugins
from hapticd.config.problems import allowed_range, shown_value, tables_of, unit_of
from hapticd.errors import PluginError


@dataclass(frozen=True, slots=True)
class Parameter:
    """One key of a plug-in's table.

    Attributes:
        key: `hand.force.newton`, `changes[].at_s`.
        default: value when the file does not set it; None when it is then not set at all.
        required: whether the file must set it.
        allowed: the range or choice of its values.
        unit: unit of a number.
        description: what it means.
        only_with: `hand.force.profile = "step"`, when it exists only then.
    """

    key: str
    default: Any
    required: bool
    allowed: str
    unit: str
    description: str
    only_with: str


@dataclass(frozen=True, slots=True)
class Plugin:
    """One installed plug-in.

    Attributes:
        name: what the configuration calls it.
        summary: first line of its docstring.
        problem: why it cannot be used, empty when it can.
        parameters: the keys of its table.
    """

    name: str
    summary: str = ""
    problem: str = ""
    parameters: list[Parameter] = field(default_factory=list)


def describe_plugins(
    group: str, only: str | None, find: Callable[[str], Any], model: Callable[[Any], type[BaseModel]]
) -> list[Plugin]:
    """Describe the plug-ins of a group.

    Args:
        group: entry-point group.
        only: name of the single one that is wanted, if so.
        find: loads a plug-in by its name.
        model: what declares its parameters.

    Raises:
        PluginError: `only` cannot be used.
    """
    if only is not None:
        return [_described(only, find(only), model)]
    described = []
    for name in plugins.names(group):
        try:
            described.append(_described(name, find(name), model))
        except PluginError as error:
            described.append(Plugin(name, problem=str(error)))
    return described


def show_plugins(described: list[Plugin], table_name: str, as_json: bool) -> None:
    """Print plug-ins, for people or for programs.

    Args:
        described: what to print.
        table_name: the table of the configuration that their parameters belong to.
        as_json: one JSON array.
    """
    if as_json:
        typer.echo(json.dumps([asdict(plugin) for plugin in described], indent=2, default=str))
        return
    console = Console(highlight=False)
    for plugin in described:
        state = f"[red]cannot be used: {escape(plugin.problem)}[/]" if plugin.problem else escape(plugin.summary)
        console.print(f"[bold]{escape(plugin.name)}[/]  {state}")
        if plugin.parameters:
            table = Table(title=escape(f"[{table_name}]"), title_justify="left", box=None, pad_edge=True, expand=False)
            table.add_column("key", no_wrap=True)
            table.add_column("default", overflow="fold")
            table.add_column("meaning", overflow="fold")
            branch = ""
            for parameter in plugin.parameters:
                if parameter.only_with not in ("", branch):
                    table.add_row("[dim]with[/]", "", f"[dim]{escape(parameter.only_with)}[/]")
                branch = parameter.only_with
                default = "required" if parameter.required else _shown_default(parameter.default)
                meaning = "; ".join(filter(None, (parameter.description, parameter.allowed)))
                table.add_row(escape(parameter.key), escape(default), escape(meaning))
            console.print(table)
        console.print()


def _described(name: str, plugin: Any, model: Callable[[Any], type[BaseModel]]) -> Plugin:
    summary = (plugin.__doc__ or "").strip().partition("\n")[0]
    return Plugin(name, summary=summary, parameters=list(_parameters(model(plugin), "", "")))


def _parameters(model: type[BaseModel], prefix: str, only_with: str) -> Iterator[Parameter]:
    for name, info in model.model_fields.items():
        key = f"{prefix}{name}"
        inner = list(tables_of(info.annotation))
        if (
            not inner and len(_choices(info.annotation)) != 1
        ):  # a single choice only tells the branches of a union apart
            yield _parameter(key, info, only_with)
        key += "[]" if typing.get_origin(info.annotation) is tuple else ""
        for table in inner:
            branch = only_with
            if info.discriminator:
                tag = table.model_fields[str(info.discriminator)].default
                branch = f"{key}.{info.discriminator} = {shown_value(tag)}"
            yield from _parameters(table, f"{key}.", branch)


def _parameter(key: str, info: FieldInfo, only_with: str) -> Parameter:
    default = info.get_default(call_default_factory=True)
    required = info.is_required()
    return Parameter(
        key=key,
        default=None if default is PydanticUndefined else default,
        required=required,
        allowed=" | ".join(map(shown_value, _choices(info.annotation)))
        or allowed_range(info)
        or _kind(info.annotation),
        unit=unit_of(info),
        description=info.description or "",
        only_with=only_with,
    )


def _choices(annotation: Any) -> tuple[Any, ...]:
    return typing.get_args(annotation) if typing.get_origin(annotation) is Literal else ()


def _kind(annotation: Any) -> str:
    for kind, name in ((bool, "true | false"), (str, "a string"), (int, "a whole number"), (float, "a number")):
        if annotation is kind or kind in typing.get_args(annotation):
            return name
    return "an array" if typing.get_origin(annotation) is tuple else ""


def _shown_default(default: object) -> str:
    return "not set" if default is None else shown_value(default)


def controllers(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Only this law, also `package.module`.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON array, an object a law.")] = False,
) -> None:
    """List the installed laws and their parameters.

    A law that cannot be imported is listed with the reason.

    Example: hapticd controllers energy-cycle
    """
    laws = describe_plugins(plugins.CONTROLLERS, name, plugins.law, lambda law: law.Params)
    show_plugins(laws, "controller.params", as_json)
