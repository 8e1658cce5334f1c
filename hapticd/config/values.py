"""Single values of a configuration's text, by their dotted keys."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping
from typing import Any

from hapticd.config.file import table_of
from hapticd.config.plugin_tables import ControllerConfig, DeviceConfig, RemoteLawTable
from hapticd.config.problems import shown_value
from hapticd.errors import ConfigError

_KEY = re.compile(r"[A-Za-z0-9_-]+(\[\d+\]|\.[A-Za-z0-9_-]+)*")

_PLUGINS = {
    "device.driver": ("options", DeviceConfig().driver),
    "controller.law": ("params", ControllerConfig().law),
    "remote.law": ("params", RemoteLawTable().law),
}
"""Keys that name a plug-in, with the table that belongs to it and its default."""


def with_values(text: str, name: str, values: Mapping[str, Any]) -> str:
    """The text of a configuration with some values put in; comments are lost.

    Parameters belong to a law and options to a driver: with another one they leave.

    Args:
        text: TOML.
        name: what to call it in errors, usually its path.
        values: by key, such as `scene.walls[0].stiffness_n_per_m`.

    Raises:
        ConfigError: a key that is none or has no place, or a value that TOML cannot hold.
    """
    import tomlkit  # nothing that runs needs it, and it takes long to import

    data = table_of(text)
    for key in sorted(values, key=lambda key: key not in _PLUGINS):
        if key in _PLUGINS:
            table, (owned, default) = data.setdefault(key.partition(".")[0], {}), _PLUGINS[key]
            if table.get(key.partition(".")[2], default) != values[key]:
                table.pop(owned, None)
        put(data, key, values[key], name)
    try:
        return tomlkit.dumps(data)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{name}: {error}") from None


def put(data: dict[str, Any], key: str, value: Any, name: str) -> None:
    """Put a value under a dotted key; tables on the way are made.

    Args:
        data: a configuration.
        key: where, such as `scene.walls[0].stiffness_n_per_m`.
        value: what; a number or an array of numpy is taken as its own.
        name: what to call the configuration in errors.

    Raises:
        ConfigError: it is no key, it has no place, or the value is none that TOML can hold.
    """
    import tomlkit

    if not _KEY.fullmatch(key):
        raise ConfigError(f"{name}: {shown_value(key)}: must be a key such as scene.walls[0].stiffness_n_per_m")
    steps: list[str | int] = [
        int(step[1:-1]) if step.startswith("[") else step for step in re.findall(r"\[\d+\]|[A-Za-z0-9_-]+", key)
    ]
    given = value.tolist() if hasattr(value, "tolist") else value
    try:
        tomlkit.item(given)
    except ValueError:
        raise ConfigError(f"{name}: {key} = {given!r}: must be a value that TOML can hold") from None
    place: Any = data
    try:
        for step, after in itertools.pairwise(steps):
            if isinstance(place, dict):
                place = place.setdefault(step, [] if isinstance(after, int) else {})
            else:
                place = place[step]
        place[steps[-1]] = given
    except (TypeError, KeyError, IndexError):
        raise ConfigError(f"{name}: {key}: the configuration has no such place") from None
