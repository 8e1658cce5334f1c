"""Put another law or other values into the text of a configuration; all else stays as its author wrote it."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from typing import Any

import tomlkit
from tomlkit.container import Container
from tomlkit.items import Comment, InlineTable, Null, Table, Whitespace

from hapticd.config.file import table_of
from hapticd.config.loading import parse
from hapticd.config.plugin_tables import ControllerConfig
from hapticd.config.values import put
from hapticd.errors import ConfigError

_BOM = "\ufeff"
_UNIX_END = re.compile(r"(?<!\r)\n")


def with_law(text: str, name: str, law: str, params: dict[str, Any]) -> str:
    """The text with another law, or other parameters of the same one.

    Parameters belong to a law: those of the law before leave with it. Where they stood in a table of their own they
    stay behind as one line of comment, one a law.

    Args:
        text: TOML.
        name: what to call it in errors, usually its path.
        law: name of the law.
        params: parameters to set; others of the same law stay as they are.

    Returns:
        A text that `parse` takes.

    Raises:
        ConfigError: the old text is no TOML, the new one would be no configuration, or only a person can edit it.
    """
    mark = _BOM if text.startswith(_BOM) else ""
    text = text.removeprefix(_BOM)
    try:
        data = table_of(text)
    except (ValueError, RecursionError):
        parse(text, name)  # says where
        raise
    controller = data.setdefault("controller", {})
    old = controller.get("params", {}) if isinstance(controller, dict) else None
    if not isinstance(old, dict):
        parse(text, name)
        raise ConfigError(f"{name}: controller: must be a table")
    was = controller.get("law", ControllerConfig().law)
    left = {} if law == was else old
    controller |= {"law": law, "params": {**({} if left else old), **params}}

    try:
        edited = _edited(text, law, params, f"{was}: " if left else "")
        found = tomllib.loads(edited)
    except Exception:  # noqa: BLE001 - tomlkit's book-keeping breaks on some mixtures of tables, as IndexError for one
        raise _by_hand(name) from None
    parse(edited, name)
    found["controller"].setdefault("params", {})
    if found != data:
        raise _by_hand(name)
    return mark + _ended_as(text, edited)


def with_edits(text: str, name: str, values: Mapping[str, Any]) -> str:
    """The text with other values, comments and layout kept. What the values mean is not looked at: `parse` does that.

    Args:
        text: TOML.
        name: what to call it in errors, usually its path.
        values: by key, such as `safety.max_force_n` or `scene.walls[0].stiffness_n_per_m`; None takes the key out.

    Raises:
        ConfigError: the text is no TOML, a key has no place in it, or only a person can edit it.
    """
    if not values:
        return text
    mark = _BOM if text.startswith(_BOM) else ""
    text = text.removeprefix(_BOM)
    try:
        data = table_of(text)
        document: Any = tomlkit.parse(text)
    except (ValueError, RecursionError):
        parse(text, name)  # says where
        raise
    for key, value in values.items():
        _set(data, key, value, name)
        try:
            _set(document, key, value, name)
        except ConfigError:
            raise
        except Exception:  # noqa: BLE001 - tomlkit's book-keeping breaks on some mixtures of tables
            raise _by_hand(name, key) from None
    edited = tomlkit.dumps(document)
    try:
        if tomllib.loads(edited) == data:
            return mark + _ended_as(text, edited)
    except ValueError:
        pass
    raise _by_hand(name, ", ".join(values))


def _set(data: Any, key: str, value: Any, name: str) -> None:
    """Put a value under a dotted key, or take the key out; it comes behind the last key of its table."""
    owner, _, last = key.rpartition(".")
    if last.endswith("]"):
        raise ConfigError(f"{name}: {key}: the configuration has no such place")
    table = data
    for step in re.findall(r"\[\d+\]|[^.\[\]]+", owner):
        try:
            table = table[int(step[1:-1])] if step.startswith("[") else table.get(step)
        except (LookupError, TypeError, AttributeError):
            raise ConfigError(f"{name}: {key}: the configuration has no such place") from None
        if table is None:
            break
    if value is None:
        if table is not None:
            table.pop(last, None)
        return
    if isinstance(table, dict) and isinstance(table.get(last), float) and type(value) is int:
        value = float(value)
    if not isinstance(table, Table) or last in table:
        put(data, key, value, name)
        return
    tail = _cut_tail(table.value)
    put(data, key, value, name)
    for item in tail:
        table.add(item)


def _ended_as(text: str, edited: str) -> str:
    """New lines end as all others of the file do."""
    dos = "\r\n" in text and not _UNIX_END.search(text)
    return _UNIX_END.sub("\r\n", edited) if dos else edited


def _by_hand(name: str, what: str = "[controller]") -> ConfigError:
    return ConfigError(f"{name}: {what} is written in a way that only a person can edit")


def _edited(text: str, law: str, params: dict[str, Any], leaving: str) -> str:
    document = tomlkit.parse(text)
    if "controller" not in document:
        start = f"{text.rstrip()}\n\n" if text.strip() else ""
        table = "".join(f"{line}\n" for line in ["", "[controller.params]", *map(_line, params.items())] if params)
        return f"{start}[controller]\n{_line(('law', law))}\n{table}"
    controller: Any = document["controller"]
    controller["law"] = law
    if "params" not in controller:
        if not params:
            return tomlkit.dumps(document)
        if isinstance(controller, InlineTable):
            controller["params"] = tomlkit.inline_table()
        else:
            controller["params"] = tomlkit.table()
            controller["params"].add(tomlkit.nl())
    table = controller["params"]
    if leaving:
        values = ", ".join(_line((key, value)) for key, value in table.unwrap().items())
        for key in list(table):
            del table[key]
        if isinstance(table, Table) and not table.is_super_table():
            _note(table, leaving, values)
    for key in [key for key in params if key in table]:
        table[key] = params[key]
    tail = _cut_tail(table.value) if isinstance(table, Table) else []
    for key, value in params.items():
        table[key] = value
    for item in tail:
        table.add(item)
    edited = tomlkit.dumps(document)
    return edited if text.endswith("\n\n") else f"{edited.rstrip()}\n"


def _line(pair: tuple[str, Any]) -> str:
    key, value = pair
    return f"{tomlkit.key(key).as_string()} = {tomlkit.item(value).as_string()}"


def _note(table: Table, law: str, values: str) -> None:
    """Leave one line of comment behind, in the place of an earlier one of the same law."""
    body = table.value.body
    for index, (key, item) in enumerate(body):
        if key is None and isinstance(item, Comment) and item.as_string().lstrip().startswith(f"# {law}"):
            body[index] = (None, Null())
    tail = _cut_tail(table.value)
    table.add(tomlkit.comment(f"{law}{values}"))
    for item in tail:
        table.add(item)


def _cut_tail(container: Container) -> list[Any]:
    """Take off what follows the last key: it may be a comment that heads the next table.

    A table without keys ends where the first blank line is.
    """
    body = container.body
    keys = [index for index, (key, item) in enumerate(body) if key is not None or isinstance(item, Null)]
    blanks = [index for index, (_, item) in enumerate(body) if isinstance(item, Whitespace)]
    end = keys[-1] + 1 if keys else blanks[0] if blanks else len(body)
    tail = [item for _, item in body[end:]]
    del body[end:]
    return tail
