"""Messages of one topic as columns, by the JSON schema that the file itself has of them."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

Values = Any
"""A column: a numpy array of one row a message, or a list where the values are texts or maps."""

_DTYPES: dict[str, type[Any]] = {"number": np.float64, "integer": np.int64, "boolean": np.bool_}
_ABSENT: dict[str, Any] = {"number": math.nan, "boolean": False}


def columns_of(rows: Sequence[dict[str, Any]], schema: dict[str, Any]) -> dict[str, Values]:
    """The columns of some messages: a key that none of them has has no column.

    A number that some of them lack is NaN there, a flag false. Arrays of different length, as after a reload that adds
    a wall, are filled up in the same way.

    Raises:
        ValueError: they do not keep to the schema.
    """
    found = {}
    for name, kind in schema.get("properties", {}).items():
        values = [row.get(name) for row in rows]
        if any(value is not None for value in values):
            try:
                found[name] = _column(values, kind)
            except (TypeError, OverflowError) as error:
                raise ValueError(f"{schema.get('title')}: {name}: {error}") from error
    return found


def rows_of(payloads: Sequence[bytes]) -> list[dict[str, Any]]:
    """JSON objects from their bytes.

    Raises:
        ValueError: one is none.
    """
    rows = json.loads(b"[" + b",".join(payloads) + b"]")  # at once, since that is twice as fast
    if len(rows) != len(payloads) or not all(isinstance(row, dict) for row in rows):
        raise ValueError("a message is no JSON object")
    return list(rows)


def _column(values: list[Any], kind: dict[str, Any]) -> Values:
    what = kind.get("type")
    if what in _DTYPES:
        if None in values:
            return _filled(values, what)
        return _array(values, what)
    items = kind.get("items", {}).get("type")
    if what == "array" and items in _DTYPES:
        return _table([[] if value is None else value for value in values], items)
    return values


def _filled(values: list[Any], what: str) -> Values:
    """A column some of whose values are not there; an integer has no value for that, so it becomes a float."""
    kind = "number" if what == "integer" else what
    return _array([_ABSENT[kind] if value is None else value for value in values], kind)


def _table(values: list[list[Any]], what: str) -> Values:
    width = max(len(value) for value in values)
    if any(len(value) != width for value in values):
        what = "number" if what == "integer" else what
        values = [value + [_ABSENT[what]] * (width - len(value)) for value in values]
    return _array(values, what).reshape(len(values), width)


def _array(values: list[Any], what: str) -> Values:
    flat = values if not values or not isinstance(values[0], list) else [one for value in values for one in value]
    accepted = (int, float) if what == "number" else bool if what == "boolean" else int
    if not all(isinstance(one, accepted) for one in flat):
        raise TypeError(f"not every value is a JSON {what}")
    try:
        return np.array(values, _DTYPES[what])
    except OverflowError:  # an integer that no counter of ours reaches
        return np.array(values, np.float64)
