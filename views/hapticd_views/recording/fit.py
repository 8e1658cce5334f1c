"""Whether the columns of a recording are those of telemetry, and as many as its receipts have axes and walls.

A file may be forged, and what it was made of as well: a daemon is only believed to say what it says.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from hapticd_views.recording.columns import Values
from hapticd_views.recording.messages import TELEMETRY, schema_of

Table = dict[str, Values]

_KINDS = {str(kind.topic): kind for kind in TELEMETRY}
_ARRAYS = {"number": "fi", "integer": "fi", "boolean": "b"}
_PER = {"position": ("axes", "axes"), "damping": ("wall_axis", "walls")}
"""Topics whose tables have a column for each of what a key of the receipt lists."""


def checked(name: str, table: Table) -> Table:
    """The columns of a topic, which are those of telemetry under its name.

    Raises:
        ValueError: one is not there, or of another kind.
    """
    kind = _KINDS.get(name)
    if kind is None:
        return table
    wanted = schema_of(kind)["properties"]
    for field in dataclasses.fields(kind):
        if field.name in table:
            if not _is_of(table[field.name], wanted.get(field.name, {})):
                raise ValueError(f"{name}: {field.name} is not what telemetry has under that name")
        elif field.default is dataclasses.MISSING and field.name in wanted:
            raise ValueError(f"{name}: no message has {field.name}")
    return table


def widened(name: str, table: Table, receipts: Sequence[dict[str, Any]]) -> Table:
    """The columns with one for each axis or wall of every receipt: a reload may have come after the last tick.

    Args:
        name: of the topic, without "hapticd/".
        table: its columns.
        receipts: of the recording.

    Raises:
        ValueError: there are fewer than in any of them.
    """
    key, what = _PER.get(name, ("", ""))
    counts = [len(receipt[key]) for receipt in receipts if key]
    return {column: _widened(column, values, counts, what) for column, values in table.items()}


def _is_of(values: Values, kind: dict[str, Any]) -> bool:
    items = kind.get("items", {}).get("type")
    if (one := items or kind.get("type")) in _ARRAYS:
        return isinstance(values, np.ndarray) and values.dtype.kind in _ARRAYS[one] and values.ndim == 1 + bool(items)
    return isinstance(values, list) and (kind.get("type") != "string" or all(isinstance(one, str) for one in values))


def _widened(name: str, values: Values, counts: Sequence[int], what: str) -> Values:
    if not counts or not isinstance(values, np.ndarray) or values.ndim != 2:
        return values
    width = values.shape[1]
    if width < min(counts):
        raise ValueError(f"{name} has {width} columns, and the receipt {min(counts)} {what}")
    lacking = max(0, max(counts) - width)
    absent = False if values.dtype.kind == "b" else np.nan
    return np.pad(values, ((0, 0), (0, lacking)), constant_values=absent) if lacking else values
