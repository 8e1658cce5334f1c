"""A configuration written out in full: every key with the value that is in force, and what it means."""

from __future__ import annotations

import tomlkit
from pydantic import BaseModel
from tomlkit.items import Item, Table

from hapticd.config.loading import LoadedConfig


def effective_toml(loaded: LoadedConfig) -> str:
    """TOML that says explicitly all that `loaded` is; loading it again gives the same configuration."""
    config = loaded.config
    document = tomlkit.document()
    for name in type(config).model_fields:
        table = _table(getattr(config, name))
        if name == "device":
            table["options"] = _table(loaded.options)
        elif name == "controller":
            table["params"] = _table(loaded.params)
        elif name == "remote":
            table["params"] = _table(loaded.port_params)
        document.add(name, table)
    return tomlkit.dumps(document)


def _table(model: BaseModel) -> Table:
    table = tomlkit.table()
    inner: dict[str, Item] = {}
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        meaning = field.description or ""
        if isinstance(value, BaseModel):
            inner[name] = _table(value)
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            tables = tomlkit.aot()
            for element in value:
                tables.append(_table(element))
            inner[name] = tables
        elif isinstance(value, dict):
            continue  # the plug-in's own model stands for it
        elif value is None:
            table.add(tomlkit.comment(f"{name} is not set: {meaning}"))
        else:
            item = tomlkit.item(list(value) if isinstance(value, tuple) else value)
            table.add(name, item.comment(meaning) if meaning else item)
    for name, tables_or_table in inner.items():
        table.add(name, tables_or_table)
    return table
