"""The JSON Schema of the configuration file, with what the installed drivers and laws add to it: for editors."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from hapticd import plugins
from hapticd.config.models import Config
from hapticd.errors import PluginError


def json_schema() -> dict[str, Any]:
    """The schema of a whole file.

    `$defs` has `driver.NAME` and `law.NAME` for every plug-in that can be imported; `device.options` and
    `controller.params` follow the driver and the law that the file names.
    """
    drivers: dict[str, type[BaseModel]] = {}
    for name in plugins.names(plugins.DRIVERS):
        try:
            drivers[name] = plugins.driver(name).Options
        except PluginError:
            continue  # `hapticd devices` says why
    laws: dict[str, type[BaseModel]] = {}
    for name in plugins.names(plugins.CONTROLLERS):
        try:
            laws[name] = plugins.law(name).Params
        except PluginError:
            continue  # `hapticd controllers` says why
    models: set[type[BaseModel]] = {Config, *drivers.values(), *laws.values()}
    references, schema = models_json_schema([(model, "validation") for model in models])
    definitions: dict[str, Any] = schema["$defs"]
    config: dict[str, Any] = definitions.pop("Config")
    for kind, models_of, table, key, choice in (
        ("driver", drivers, "DeviceConfig", "options", "driver"),
        ("law", laws, "ControllerConfig", "params", "law"),
    ):
        for name, model in models_of.items():
            definitions[f"{kind}.{name}"] = references[model, "validation"]
        default = definitions[table]["properties"][choice]["default"]
        definitions[table]["allOf"] = [
            {
                "if": {"properties": {choice: {"const": name}}, **({} if name == default else {"required": [choice]})},
                "then": {"properties": {key: {"$ref": f"#/$defs/{kind}.{name}"}}},
            }
            for name in models_of
        ]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "hapticd configuration",
        **{name: value for name, value in config.items() if name != "title"},
        "$defs": dict(sorted(definitions.items())),
    }
