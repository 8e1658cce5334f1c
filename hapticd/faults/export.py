"""A fault record as a table: one row a tick, one column a number, named as on the wire."""

from __future__ import annotations

import csv
import dataclasses
from collections.abc import Iterator
from typing import TextIO

from hapticd.faults.record import FaultRecord
from hapticd.tick.contact_record import SpaceRecord, WallRecord
from hapticd.tick.record import TickRecord

_WALLS = "walls"
_WALL_FIELDS = [field.name for field in dataclasses.fields(WallRecord)]
_TICK_FIELDS = [field.name for field in dataclasses.fields(TickRecord) if field.name not in (_WALLS, "space")]
_SPACE_FIELDS = ["objects", "moved_j", "friction_j", "friction_energy_j"]
_OBJECT_VECTORS = ["proxy_m", "normal", "force_n"]


def write_csv(record: FaultRecord, file: TextIO) -> None:
    """Write every field of every tick; `t_s` is the time since the fault, a wall that was not there yet is empty.

    In a scene with objects, those in reach follow, as many as there were at most at once.
    """
    walls = max((len(tick.walls) for tick in record.ticks), default=0)
    near = max((len(tick.space.near) for tick in record.ticks if tick.space is not None), default=-1)
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(["t_s", *_names(record, walls), *_space_names(near)])
    for tick in record.ticks:
        time_s = f"{(tick.deadline_ns - record.fault_ns) * 1e-9:.6f}"
        writer.writerow([time_s, *_values(tick, walls), *_space_values(tick.space, near)])


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


def _space_names(near: int) -> Iterator[str]:
    if near < 0:
        return
    yield from _SPACE_FIELDS
    for at in range(near):
        yield from (f"{name}[object {at}]" for name in ("index", *_WALL_FIELDS))
        yield from (f"{name}[object {at}][{axis}]" for name in _OBJECT_VECTORS for axis in range(3))
        yield from (f"{name}[object {at}]" for name in ("depth_m", "sliding"))


def _space_values(space: SpaceRecord | None, near: int) -> Iterator[object]:
    if near < 0:
        return
    shown = () if space is None else space.near
    yield from ("" if space is None else getattr(space, name) for name in _SPACE_FIELDS)
    for one in shown:
        yield one.index
        yield from (int(value) if isinstance(value, bool) else value for value in dataclasses.astuple(one.contact))
        yield from (value for name in _OBJECT_VECTORS for value in getattr(one, name))
        yield from (one.depth_m, int(one.sliding))
    yield from [""] * ((near - len(shown)) * (len(_WALL_FIELDS) + 12))
