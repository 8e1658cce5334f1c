"""Law, scene and limits of a configuration as a form: every value with its unit, its bounds and its meaning."""

from __future__ import annotations

import typing
from collections.abc import Iterable, Iterator
from typing import Any, Literal

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from hapticd import plugins
from hapticd.config.loading import LoadedConfig
from hapticd.config.models import SceneConfig
from hapticd.config.problems import allowed_range, unit_of
from hapticd.config.safety import SafetyConfig
from hapticd.config.walls import WallConfig
from hapticd.errors import PluginError

LIMITS = ("max_force_n", "max_axis_force_n", "max_speed_m_per_s", "ramp_s")
"""Keys of [safety] that the form has."""

WALL = ("axis", "free_side", "position_m", "stiffness_n_per_m", "damping_n_s_per_m")
"""Keys of a wall that the form has."""

Field = dict[str, Any]


def form(loaded: LoadedConfig) -> dict[str, Any]:
    """What the form shows of a configuration.

    Args:
        loaded: it.

    Returns:
        `law`, its name; `laws`, each with `name`, `summary` and `fields`; `scene`, walls and objects, each with `title`
        and `fields`; `limits`, fields.
        A field has `key`, `name`, `unit`, `meaning`, `allowed`, `kind` (number, whole, flag, choice or text),
        `choices`, `optional` and `value`, which is None when it is not set.
    """
    now = loaded.config.controller.law
    names = [*plugins.names(plugins.CONTROLLERS)]
    if now not in names:
        names.append(now)
    return {
        "law": now,
        "laws": [*_laws(names, loaded)],
        "scene": [*_scene(loaded.config.scene)],
        "limits": _fields(SafetyConfig, LIMITS, "safety", loaded.config.safety),
    }


def _scene(scene: SceneConfig) -> Iterator[dict[str, Any]]:
    for index, wall in enumerate(scene.walls):
        yield {"title": f"Wall {index + 1}", "fields": _fields(WallConfig, WALL, f"scene.walls[{index}]", wall)}
    for index, each in enumerate(scene.objects):
        fields = _fields(type(each), type(each).model_fields, f"scene.objects[{index}]", each)
        title = f"{each.name} ({each.shape})"
        yield {"title": title, "fields": [field for field in fields if field["kind"] in ("number", "flag")]}


def _laws(names: Iterable[str], loaded: LoadedConfig) -> Iterator[dict[str, Any]]:
    for name in names:
        try:
            law = plugins.law(name)
        except PluginError:  # `hapticd controllers` says why
            continue
        values = loaded.params if name == loaded.config.controller.law else None
        yield {
            "name": name,
            "summary": (law.__doc__ or "").strip().partition("\n")[0],
            "fields": _fields(law.Params, law.Params.model_fields, "controller.params", values),
        }


def _fields(model: type[BaseModel], names: Iterable[str], table: str, values: BaseModel | None) -> list[Field]:
    fields = (_field(model.model_fields[name], name, f"{table}.{name}", values) for name in names)
    return [field for field in fields if field["kind"] != "array"]  # which take an editor


def _field(info: FieldInfo, name: str, key: str, values: BaseModel | None) -> Field:
    default = info.get_default(call_default_factory=True)
    value = None if default is PydanticUndefined else default
    choices = typing.get_args(info.annotation) if typing.get_origin(info.annotation) is Literal else ()
    return {
        "key": key,
        "name": name,
        "unit": unit_of(info),
        "meaning": info.description or "",
        "allowed": allowed_range(info),
        "kind": "choice" if choices else _kind(info.annotation),
        "choices": list(choices),
        "optional": type(None) in typing.get_args(info.annotation),
        "value": getattr(values, name) if values is not None else value,
    }


def _kind(annotation: Any) -> str:
    if typing.get_origin(annotation) is tuple:
        return "array"
    for kind, name in ((bool, "flag"), (str, "text"), (int, "whole"), (float, "number")):
        if annotation is kind or kind in typing.get_args(annotation):
            return name
    return "text"
