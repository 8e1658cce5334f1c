"""Objects as scalar fields by name, and fields as records: the form in which a point waits for its run."""

from __future__ import annotations

import typing
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from hapticd.law import plain_object
from hapticd.simulation.compiler.compile import record_dtype


@lru_cache
def hints(cls: type[Any]) -> dict[str, type[Any]]:
    """The scalar fields that a class declares, and their types."""
    return {name: kind for name, kind in typing.get_type_hints(cls).items() if kind in (float, int, bool)}


def fields_of(plain: Any) -> dict[str, Any]:
    """The fields of a slotted object."""
    return {name: getattr(plain, name) for name in type(plain).__slots__}


def plain(fields: Mapping[str, Any]) -> Any:
    """A slotted object with these fields."""
    return plain_object("Fields", dict(fields))


def records(rows: Sequence[Mapping[str, Any]], fields: Mapping[str, type[Any]]) -> np.ndarray[Any, Any]:
    """An array of records, one a row."""
    array = np.zeros(len(rows), record_dtype(fields))
    for name in fields:
        array[name] = [row[name] for row in rows]
    return array


def store(row: Any, plain: Any) -> None:
    """Put the fields of an object into the record that has them."""
    for name in row.dtype.names:
        if hasattr(plain, name):
            row[name] = getattr(plain, name)
