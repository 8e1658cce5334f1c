"""Columns of numbers: numpy arrays where numpy is installed, plain ones where it is not."""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol, overload

if TYPE_CHECKING:
    from numpy.typing import NDArray

_DTYPES = {"d": "float64", "q": "int64", "b": "bool"}


class HasColumns(Protocol):
    """What keeps its columns by name, as `array.array` or as nested lists."""

    @property
    def columns(self) -> Mapping[str, Any]:
        """They."""


class Column:
    """A column under its name, as an attribute of what has it.

    Args:
        meaning: what it holds, with its unit.
    """

    def __init__(self, meaning: str) -> None:
        self.__doc__ = meaning
        self._name = ""

    def __set_name__(self, _owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, holder: None, owner: type) -> Column: ...

    @overload
    def __get__(self, holder: HasColumns, owner: type) -> NDArray[Any]: ...

    def __get__(self, holder: HasColumns | None, owner: type) -> Column | NDArray[Any]:
        return self if holder is None else as_numpy(holder.columns[self._name])


def as_numpy(values: Any) -> Any:
    """An `array.array` or nested lists as a numpy array to read; as they are where numpy is not installed."""
    try:
        import numpy as np
    except ModuleNotFoundError:
        return values
    found = np.frombuffer(values, _DTYPES[values.typecode]) if isinstance(values, array) else np.array(values)
    found.flags.writeable = False
    return found
