"""What a recording's messages look like: a JSON object a record, and the JSON schema that it keeps to.

A record of telemetry has the keys of docs/telemetry.md. What the recorder adds has topics of its own,
`recording/gap` and `recording/note`.
"""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, get_args

from hapticd.telemetry.records import Event, Gap, Sent

TELEMETRY: tuple[type[Sent], ...] = get_args(Sent)
"""The records of telemetry that are recorded."""

GAP = "recording/gap"
NOTE = "recording/note"


@dataclass(frozen=True, slots=True)
class Note:
    """Something that the recorder itself has seen or done.

    Attributes:
        timestamp: when [s since the epoch].
        text: one line for people.
        restart: the daemon has started anew: `seq`, energies and cycles count from 0 again.
    """

    timestamp: float
    text: str
    restart: bool = False


@dataclass(frozen=True, slots=True)
class RecordedGap:
    """Ticks that did not arrive.

    Attributes:
        timestamp: of the first record after them [s since the epoch].
        topic: whose ticks, such as "hapticd/position".
        after: last tick before the gap.
        seq: first tick after it.
        missing: ticks in between; 0 when the daemon started anew.
    """

    timestamp: float
    topic: str
    after: int
    seq: int
    missing: int


def recorded_gap(gap: Gap, timestamp: float) -> RecordedGap:
    """A gap as it is recorded, before the record that came at this time."""
    return RecordedGap(timestamp, str(gap.topic), gap.after, gap.seq, gap.missing)


def topic_of(record: type[Any]) -> str:
    """The topic that records of this class are recorded under."""
    return {Note: NOTE, RecordedGap: GAP}.get(record) or str(record.topic)


def schema_of(record: type[Any]) -> dict[str, Any]:
    """The JSON schema of a record class, made of its fields and its docstring."""
    meanings = _meanings(record)
    properties: dict[str, Any] = {}
    required = []
    for field in dataclasses.fields(record):
        if field.name == "fields":  # an event's own keys stand beside the others
            continue
        properties[field.name] = dict(_JSON_TYPES[str(field.type)])
        if field.name in meanings:
            properties[field.name]["description"] = meanings[field.name]
        if not _may_miss(field):
            required.append(field.name)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": topic_of(record),
        "description": (record.__doc__ or "").split("\n", 1)[0],
        "type": "object",
        "properties": properties,
        "required": required,
    }


def encoder_of(record: type[Any]) -> Callable[[Any], bytes]:
    """A function that makes the JSON of one record; every float in the digits that give the same float again."""
    encode = json.JSONEncoder(allow_nan=False, check_circular=False, separators=(",", ":")).encode
    names = [field.name for field in dataclasses.fields(record) if field.name != "fields"]
    values = attrgetter(*names)
    may_miss = {field.name for field in dataclasses.fields(record) if _may_miss(field)}
    if record is Event:
        return lambda event: encode({**event.fields, **dict(zip(names, values(event), strict=True))}).encode()
    if not may_miss:
        return lambda one: encode(dict(zip(names, values(one), strict=True))).encode()

    def without_absent(one: Any) -> bytes:
        told = dict(zip(names, values(one), strict=True))
        for name in may_miss:
            if told[name] is None or told[name] is False or told[name] == ():
                del told[name]
        return encode(told).encode()

    return without_absent


def _may_miss(field: dataclasses.Field[Any]) -> bool:
    """Whether a key is left out where it says nothing: `invalid`, and what a device does not have."""
    return field.name == "invalid" or field.default is None or field.default == ()


def _meanings(record: type[Any]) -> dict[str, str]:
    _, _, attributes = (record.__doc__ or "").partition("Attributes:")
    found = re.findall(r"^ {8}(\w+): (.*(?:\n {12}.*)*)", attributes, re.MULTILINE)
    return {name: re.sub(r"\s+", " ", text) for name, text in found}


_NUMBER = {"type": "number"}
_INTEGER = {"type": "integer"}
_BOOLEAN = {"type": "boolean"}
_TEXT = {"type": "string"}
_JSON_TYPES: dict[str, dict[str, Any]] = {
    "float": _NUMBER,
    "float | None": _NUMBER,
    "int": _INTEGER,
    "int | None": _INTEGER,
    "bool": _BOOLEAN,
    "str": _TEXT,
    "dict[str, float]": {"type": "object", "additionalProperties": _NUMBER},
    "tuple[float, ...]": {"type": "array", "items": _NUMBER},
    "tuple[int, ...]": {"type": "array", "items": _INTEGER},
    "tuple[bool, ...]": {"type": "array", "items": _BOOLEAN},
    "tuple[str, ...]": {"type": "array", "items": _TEXT},
}
