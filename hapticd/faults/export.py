"""A fault record as a table: one row a tick, one column a number, named as on the wire."""

from __future__ import annotations

import csv
import dataclasses
from collections.abc import Iterator
from typing import TextIO

from hapticd.faults.record import FaultRecord
from hapticd.tick.record import TickRecord, WallRecord

_WALLS = "walls"
_WALL_FIELDS = [field.name for field in dataclasses.fields(WallRecord)]
_TICK_FIELDS = [field.name for field in dataclasses.fields(TickRecord) if field.name != _WALLS]


def write_csv(record: FaultRecord, file: TextIO) -> None:
    """Write every field of every tick; `t_s` is the time since the fault, a wall that was not there yet is empty."""
    walls = max((len(tick.walls) for tick in record.ticks), default=0)
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(["t_s", *_names(record, walls)])
    for tick in record.ticks:
        writer.writerow([f"{(tick.deadline_ns - record.fault_ns) * 1e-9:.6f}", *_values(tick, walls)])


def _names(record: FaultRecord, walls: int) -> Iterator[str]:
    like = record.ticks[0] if record.ticks else None
    for name in _TICK_FIELDS:
        value = getattr(like, name, 0)
        if isinstance(value, tuple):
            yield from (f"{name}[{index}]" for index in range(len(value)))
        else:
            yield name
    for wall in range(walls):
        yield from (f"{name}[{wall}]" for name in _WALL_FIELDS)


def _values(tick: TickRecord, walls: int) -> Iterator[object]:
    for name in _TICK_FIELDS:
        value = getattr(tick, name)
        if isinstance(value, tuple):
            yield from value
        else:
            yield value
    for wall in tick.walls:
        yield from (int(value) if isinstance(value, bool) else value for value in dataclasses.astuple(wall))
    yield from [""] * ((walls - len(tick.walls)) * len(_WALL_FIELDS))
