"""Laws by name with parameters, as `energy-cycle:cap=none:window=1`."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from hapticd import plugins
from hapticd.config.problems import Problems
from hapticd.errors import ConfigError
from hapticd.law import LawParams
from hapticd.simulation.compiler.compile import compiled_step


@dataclass(frozen=True, slots=True)
class LawSpec:
    """A law with parameters.

    Attributes:
        label: what the user called it.
        name: of the law.
        values: parameters that differ from the law's defaults.
    """

    label: str
    name: str
    values: Mapping[str, Any]

    @property
    def law(self) -> ModuleType:
        """The law's module."""
        return plugins.law(self.name)

    @property
    def params(self) -> LawParams:
        """The law's parameters."""
        params: LawParams = self.law.Params.model_validate(dict(self.values))
        return params


def parse_laws(text: str, base: Mapping[str, Mapping[str, Any]], option: str = "--laws") -> list[LawSpec]:
    """Read `none,tdpa,energy-cycle:cap=none`, and make sure that each can be run as machine code.

    Args:
        text: names with parameters, separated by commas.
        base: parameters that a configuration sets, by name of the law.
        option: for errors.

    Raises:
        ConfigError: a law or a parameter that there is not, or one twice.
        PluginError: a law that cannot be compiled.
    """
    readings = []
    for label in [part.strip() for part in text.split(",") if part.strip()]:
        name, *assignments = label.split(":")
        values = dict(base.get(name, {}))
        for one in assignments:
            key, equals, value = one.partition("=")
            if not equals:
                raise ConfigError(f"{option} {label}: must be LAW:KEY=VALUE:..., as energy-cycle:cap=none")
            values[key.strip()] = toml_value(value)
        law = plugins.law(name)
        problems = Problems(f"{option} {label}")
        if problems.validated(law.Params, values) is None:
            raise ConfigError(*problems.lines)
        readings.append(LawSpec(label, name, values))
    if not readings:
        raise ConfigError(
            f"{option}: name at least one law; installed: {', '.join(plugins.names(plugins.CONTROLLERS))}"
        )
    labels = [reading.label for reading in readings]
    if len(set(labels)) < len(labels):
        raise ConfigError(f"{option} {text}: a law stands there twice")
    for reading in readings:
        compiled_step(reading.law)
    return readings


def toml_value(text: str) -> Any:
    """A value as TOML reads it; what is none is a string."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text.strip()
