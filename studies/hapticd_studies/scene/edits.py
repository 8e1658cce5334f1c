"""Edits of a configuration file that take something out of it and keep everything else, comments too."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import tomlkit

from hapticd.config.loading import parse

Document = Any  # tomlkit's documents and tables, which are dictionaries with a memory for comments
Edit = Callable[[Document], None]


@dataclass(frozen=True, slots=True)
class Term:
    """Something that a scene has and might do without.

    Attributes:
        name: for people.
        edit: takes it out of a document.
        order: edits are made in this order, so that counting walls stays right.
    """

    name: str
    edit: Edit
    order: int = 0


def device_edit(key: str, change_key: str) -> Edit:
    """Take a value of the device out, and its changes."""
    *tables, last = key.split(".")

    def edit(document: Document) -> None:
        without_change(table_in(document, "device", "options"), change_key)
        table = table_in(document, "device", "options", *tables)
        if tables:
            table.pop(last, None)  # a hand has nothing that is not given
        else:
            table[last] = 0 if last == "force_delay_samples" else 0.0  # a preset may have it
            _drop_zero(document, table, last)

    return edit


def table_in(document: Document, *path: str) -> Document:
    """A table of the file, made where there is none."""
    for name in path:
        if name not in document:
            document[name] = tomlkit.table()
        document = document[name]
    return document


def without_change(table: Document, *keys: str) -> None:
    """Take keys out of every entry of `changes`, and entries that change nothing any more."""
    if "changes" not in table:
        return
    kept = []
    for change in table["changes"]:
        left = {name: value for name, value in change.items() if name not in keys}
        if len(left) > 1:
            kept.append(left)
    if not kept:
        table.pop("changes")
    elif len(kept) < len(table["changes"]) or any(
        dict(old) != new for old, new in zip(table["changes"], kept, strict=True)
    ):
        array = tomlkit.array()
        for left in kept:
            entry = tomlkit.inline_table()
            entry.update(left)
            array.append(entry)
        table["changes"] = array


def _drop_zero(document: Document, table: Document, key: str) -> None:
    """Leave a zero out where the file means the same without it."""
    options = parse(tomlkit.dumps(document), "-").options
    value = table.pop(key)
    try:
        same = parse(tomlkit.dumps(document), "-").options == options
    except ValueError:
        same = False
    if not same:
        table[key] = value
