"""A fault record as a table: one row a tick, one column a number, named as on the wire."""

from __future__ import annotations

import csv
import dataclasses
from collections.abc import Iterator
from typing import TextIO

from hapticd.faults.record import FaultRecord
from hapticd.tick.contact_record import SpaceRecord, WallRecord
from hapticd.tick.record import TickRecord
from hapticd.tick.remote.port_record import PortRecord, PortsRecord

_WALLS = "walls"
_WALL_FIELDS = [field.name for field in dataclasses.fields(WallRecord)]
_TICK_FIELDS = [field.name for field in dataclasses.fields(TickRecord) if field.name not in (_WALLS, "space", "ports")]
_SPACE_FIELDS = ["objects", "moved_j", "friction_j", "friction_energy_j"]
_PORT_FIELDS = [field.name for field in dataclasses.fields(PortRecord)]
_PORT_VECTORS = ["target_m", "force_n", "impulse_n_s"]
_OBJECT_VECTORS = ["proxy_m", "normal", "force_n"]


def write_csv(record: FaultRecord, file: TextIO) -> None:
    """Write every field of every tick; `t_s` is the time since the fault, a wall that was not there yet is empty.

    In a scene with objects, those in reach follow, as many as there were at most at once; and behind them what clients
    drive.
    """
    walls = max((len(tick.walls) for tick in record.ticks), default=0)
    near = max((len(tick.space.near) for tick in record.ticks if tick.space is not None), default=-1)
    ports = max((len(tick.ports.shown) for tick in record.ticks if tick.ports is not None), default=-1)
    axes = len(record.ticks[0].position_m) if record.ticks else 0
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(["t_s", *_names(record, walls), *_space_names(near), *_port_names(ports, axes)])
    for tick in record.ticks:
        time_s = f"{(tick.deadline_ns - record.fault_ns) * 1e-9:.6f}"
        shown = [*_space_values(tick.space, near), *_port_values(tick.ports, ports, axes)]
        writer.writerow([time_s, *_values(tick, walls), *shown])


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
        yield from (f"{name}[object {at}]" for name in ("depth_m", "sliding", "carrier", "inside"))


def _space_values(space: SpaceRecord | None, near: int) -> Iterator[object]:
    if near < 0:
        return
    shown = () if space is None else space.near
    yield from ("" if space is None else getattr(space, name) for name in _SPACE_FIELDS)
    for one in shown:
        yield one.index
        yield from (int(value) if isinstance(value, bool) else value for value in dataclasses.astuple(one.contact))
        yield from (value for name in _OBJECT_VECTORS for value in getattr(one, name))
        yield from (one.depth_m, int(one.sliding), one.carrier, " ".join(map(str, one.inside)))
    yield from [""] * ((near - len(shown)) * (len(_WALL_FIELDS) + 14))


def _port_names(ports: int, axes: int) -> Iterator[str]:
    if ports < 0:
        return
    yield "port_work_j"
    for at in range(ports):
        for name in _PORT_FIELDS:
            if name in _PORT_VECTORS:
                yield from (f"{name}[port {at}][{axis}]" for axis in range(axes))
            else:
                yield f"{name}[port {at}]"


def _port_values(ports: PortsRecord | None, most: int, axes: int) -> Iterator[object]:
    if most < 0:
        return
    yield "" if ports is None else ports.work_j
    shown = () if ports is None else ports.shown
    for one in shown:
        for name in _PORT_FIELDS:
            value = getattr(one, name)
            yield from value if name in _PORT_VECTORS else (value,)
    yield from [""] * ((most - len(shown)) * (len(_PORT_FIELDS) - 3 + 3 * axes))
