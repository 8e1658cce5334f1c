"""Messages into records; one that does not keep to docs/telemetry.md is refused."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import msgpack

from hapticd.errors import WireError
from hapticd.telemetry.records import Cycle, Damping, Energy, Event, Input, Position, Sent, Status, Timing, Touch


def decode(topic: bytes, payload: bytes) -> list[Sent]:
    """The records of one message; none when the topic is not known to this client.

    Raises:
        WireError: the payload is not what the contract says.
    """
    reader = _READERS.get(topic)
    if reader is None:
        return []
    name = topic.decode()
    try:
        maps = msgpack.unpackb(payload, raw=False)
    except (ValueError, TypeError, msgpack.exceptions.UnpackException) as error:
        raise WireError(f"{name}: payload is no msgpack: {error or type(error).__name__}") from error
    if not isinstance(maps, list):
        raise WireError(f"{name}: payload is {type(maps).__name__}, not an array of maps")
    return [reader.read(name, fields) for fields in maps]


class _UnfitError(Exception):
    """A value that a key cannot have; the text says what it should be."""


def _number(value: Any) -> float:
    if type(value) is float and math.isfinite(value):
        return value
    if type(value) is int:
        return float(value)
    raise _UnfitError("a finite number")


def _integer(value: Any) -> int:
    if type(value) is int:
        return value
    raise _UnfitError("an integer")


def _flag(value: Any) -> bool:
    if type(value) is bool:
        return value
    raise _UnfitError("true or false")


def _text(value: Any) -> str:
    if type(value) is str:
        return value
    raise _UnfitError("text")


def _is_plain(value: Any) -> bool:
    return isinstance(value, int | str) or (isinstance(value, float) and math.isfinite(value))


def _array_of(element: Callable[[Any], Any]) -> Callable[[Any], tuple[Any, ...]]:
    def convert(value: Any) -> tuple[Any, ...]:
        if type(value) is not list:
            raise _UnfitError("an array")
        return tuple([element(one) for one in value])

    return convert


def _numbers_by_name(value: Any) -> dict[str, float]:
    if type(value) is not dict:
        raise _UnfitError("a map")
    return {_text(name): _number(number) for name, number in value.items()}


_CONVERTERS: dict[str, Callable[[Any], Any]] = {
    "float": _number,
    "int": _integer,
    "bool": _flag,
    "str": _text,
    "int | None": _integer,
    "float | None": _number,
    "dict[str, float]": _numbers_by_name,
    "tuple[float, ...]": _array_of(_number),
    "tuple[int, ...]": _array_of(_integer),
    "tuple[bool, ...]": _array_of(_flag),
    "tuple[str, ...]": _array_of(_text),
}


class _Reader:
    """Makes records of one class from maps: keys are its fields, types their annotations."""

    def __init__(self, record: type[Any]) -> None:
        self.record = record
        self.keys = []
        for key in dataclasses.fields(record):
            if key.name != "fields":
                required = key.default is key.default_factory is dataclasses.MISSING
                self.keys.append((key.name, _CONVERTERS[str(key.type)], required))

    def read(self, topic: str, fields: Any) -> Any:
        if type(fields) is not dict:
            raise WireError(f"{topic}: an element is {type(fields).__name__}, not a map")
        values = {}
        for name, convert, required in self.keys:
            if name in fields:
                try:
                    values[name] = convert(fields[name])
                except _UnfitError as unfit:
                    raise WireError(f"{topic}: {name} = {str(fields[name])[:40]!r} is not {unfit}") from None
            elif required:
                raise WireError(f"{topic}: a map has no `{name}`")
        if self.record is Event:
            values["fields"] = {
                key: value
                for key, value in fields.items()
                if key not in values and isinstance(key, str) and _is_plain(value)
            }
        return self.record(**values)


_READERS: dict[bytes, _Reader] = {
    record.topic.encode(): _Reader(record)
    for record in (Position, Energy, Damping, Touch, Timing, Cycle, Input, Event, Status)
}
