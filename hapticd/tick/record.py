"""What one tick records, and how a record lies in shared memory.

The control process writes one record a tick; the supervisor decodes it and publishes it. A record has a fixed size
(the slot of the ring); only the walls that the scene has are written.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from struct import Struct


class Flag(enum.IntFlag):
    """State bits of a tick."""

    ARMED = 1  # forces are let through
    FALLBACK = 2  # the law failed and the damping fallback stands in for it
    RELEASING = 4  # the force is being ramped to zero
    LATCHED = 8  # stopped by a fault until cleared
    LIMITED = 16  # the guard reduced the force in this tick
    UNCALIBRATED = 32  # the device does not know where it is


@dataclass(slots=True)
class WallRecord:
    """One wall in one tick.

    Attributes:
        in_contact: whether the device is inside the wall.
        damping_n_s_per_m: damping of the law [N s/m]; 0 when the law has none.
        felt_mass_kg: mass that the law has identified [kg]; 0 while unknown.
        cycle: number of completed cycles; the four fields below belong to the last one.
        cycle_energy_j: energy at its end [J].
        cycle_generated_j: energy that it generated [J], > 0 when the wall gave back more than it took.
        cycle_damping_n_s_per_m: damping in force when it ended [N s/m].
        cycle_duration_s: how long it took [s].
    """

    in_contact: bool
    damping_n_s_per_m: float
    felt_mass_kg: float
    cycle: int
    cycle_energy_j: float
    cycle_generated_j: float
    cycle_damping_n_s_per_m: float
    cycle_duration_s: float


@dataclass(slots=True)
class TickRecord:
    """One tick.

    Attributes:
        seq: tick number, counted from 0 when the loop started; skipped deadlines have no tick.
        deadline_ns: CLOCK_MONOTONIC time that the tick was due [ns].
        late_us: how late it started [us].
        busy_us: how long its body took [us].
        dt_s: time since the tick before, on the device's clock where it has one [s].
        skipped: deadlines skipped so far.
        flags: state bits.
        law: index of the law activation, counted up at each switch.
        buttons: bit i is button i.
        gripper_m: gripper opening [m].
        position_m, velocity_m_per_s, force_n, force_requested_n: one element an axis.
        energy_j: energy into all contacts with the applied force [J].
        spring_energy_j: energy stored in their springs now [J].
        dissipated_j: energy taken by wall damping and law [J].
        generated_j: energy made by sampling and hold [J].
        orientation: rotation matrix row by row, empty without a wrist.
        walls: one an entry of scene.walls, in order.
    """

    seq: int
    deadline_ns: int
    late_us: float
    busy_us: float
    dt_s: float
    skipped: int
    flags: int
    law: int
    buttons: int
    gripper_m: float
    energy_j: float
    spring_energy_j: float
    dissipated_j: float
    generated_j: float
    position_m: tuple[float, ...]
    velocity_m_per_s: tuple[float, ...]
    force_n: tuple[float, ...]
    force_requested_n: tuple[float, ...]
    orientation: tuple[float, ...]
    walls: tuple[WallRecord, ...]


_HEAD = "qqddd qqqq ddddd q"  # seq ... generated_j, then the number of walls
_WALL = "qddqdddd"
_HEAD_FIELDS = 15
_WALL_FIELDS = 8


class RecordLayout:
    """Where the fields of a record lie, for a device with so many axes.

    The writer packs scalars in the order of `TickRecord`, then the axes, the orientation and the walls.

    Args:
        axes: translation axes of the device.
        orientation: whether the device has a wrist.
        max_walls: most walls that a record can hold.
    """

    def __init__(self, axes: int, orientation: bool, max_walls: int) -> None:
        self.axes = axes
        self.orientation = orientation
        self.max_walls = max_walls
        self._structs = [self._struct(walls) for walls in range(max_walls + 1)]
        self.size = self._structs[-1].size

    def struct(self, walls: int) -> Struct:
        """The packing of a record with so many walls; unused room behind it is left as it was."""
        return self._structs[walls]

    def unpack(self, row: bytes | memoryview) -> TickRecord:
        """Decode one record."""
        walls = int.from_bytes(row[(_HEAD_FIELDS - 1) * 8 : _HEAD_FIELDS * 8], "little")
        values = self._structs[walls].unpack_from(row)
        at = _HEAD_FIELDS
        vectors: list[tuple[float, ...]] = []
        for length in (self.axes, self.axes, self.axes, self.axes, 9 if self.orientation else 0):
            vectors.append(values[at : at + length])
            at += length
        wall_records = []
        for _ in range(walls):
            wall = WallRecord(*values[at : at + _WALL_FIELDS])
            wall.in_contact = bool(wall.in_contact)
            wall_records.append(wall)
            at += _WALL_FIELDS
        fields = (*values[: _HEAD_FIELDS - 1], *vectors, tuple(wall_records))
        return TickRecord(*fields)

    def _struct(self, walls: int) -> Struct:
        doubles = 4 * self.axes + (9 if self.orientation else 0)
        return Struct("<" + _HEAD.replace(" ", "") + "d" * doubles + _WALL * walls)
