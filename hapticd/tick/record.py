"""What one tick records, and how a record lies in shared memory.

The loop writes one record a tick; the supervisor decodes it and publishes it. A record has a fixed size (the slot of
the ring); only the walls that the scene has are written, and only the objects that the device may touch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from struct import Struct
from typing import TYPE_CHECKING, cast

from hapticd.tick.contact_record import (
    CODES,
    LISTINGS,
    MOST_OBJECTS,
    OBJECT,
    SPACE,
    WALL,
    SpaceRecord,
    WallRecord,
    contact_values,
    object_values,
    space_record,
    untouched,
    wall_record,
)
from hapticd.tick.flags import Flag
from hapticd.tick.remote.port_record import PortLayout, PortsRecord

if TYPE_CHECKING:  # clients read records without the tick that makes them
    from hapticd.device import Sample
    from hapticd.tick.space.tick import SpaceTick
    from hapticd.tick.tick import ControlTick


@dataclass(slots=True)
class TickRecord:
    """One tick.

    Attributes:
        seq: tick number, counted from 0 when the loop started; skipped deadlines have no tick.
        deadline_ns: CLOCK_MONOTONIC time that the tick was due [ns].
        late_us: how late it started [us].
        busy_us: how long its body took [us].
        dt_s: time since the sample before, on the device's clock where it has one; 0 at a repeat [s].
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
        space: what objects add; None in a scene without.
        ports: what clients drive; None in a scene without.
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
    space: SpaceRecord | None = None
    ports: PortsRecord | None = None


_SCALARS = [field for field in fields(TickRecord) if field.type in CODES]
_HEAD = "".join(CODES[str(field.type)] for field in _SCALARS) + "q"  # and the number of walls
_WALLS = 256
"""What stands where the number of walls does: that number, and this times one more than the number of objects."""
_PORTS = 65536
"""And this more where ports follow behind the rest."""
_UNCALIBRATED = int(Flag.UNCALIBRATED)


class RecordLayout:
    """Where the fields of a record lie, for a device with `axes` axes.

    First the scalars in the order of `TickRecord` and the number of walls, then the axes, the orientation, the walls,
    where the device has the three axes that it takes what `SpaceRecord` has, and behind it the ports.

    Args:
        axes: translation axes of the device.
        orientation: whether the device has a wrist.
        max_walls: most walls that a record can hold.

    Attributes:
        size: of a record, whatever it holds [bytes].
        format: of a full one, as `struct` writes it.
        pack: records a tick: `pack_walls`, or what else its scene needs, see `serve`.
    """

    def __init__(self, axes: int, orientation: bool, max_walls: int) -> None:
        self.axes = axes
        self.orientation = orientation
        self.max_walls = max_walls
        doubles = "d" * (4 * axes + (9 if orientation else 0))
        self._structs = [Struct(f"<{_HEAD}{doubles}{WALL * walls}") for walls in range(max_walls + 1)]
        self._packs = [struct.pack_into for struct in self._structs]
        full = self._structs[-1]
        self._in_space: list[list[Struct]] = []
        if axes == 3:
            self._in_space = [
                [Struct(f"{struct.format}{SPACE}{OBJECT * near}") for near in range(MOST_OBJECTS + 1)]
                for struct in self._structs
            ]
            full = self._in_space[-1][-1]
        self._ports = PortLayout(axes)
        self.size = full.size + self._ports.size
        self.format = full.format + self._ports.format
        self.pack: Callable[..., int | None] = self.pack_walls

    def struct(self, walls: int) -> Struct:
        """How a record with this many walls is packed; it may be shorter than `size`."""
        return self._structs[walls]

    def serve(self, tick: ControlTick) -> None:
        """Pack from now on what the scene of a tick has."""
        self.pack = self.pack_space if tick.has_objects else self.pack_walls
        if tick.has_ports:
            self.pack = self.pack_ports

    def pack_walls(
        self,
        area: memoryview,
        at: int,
        tick: ControlTick,
        sample: Sample,
        seq: int,
        deadline_ns: int,
        late_us: float,
        busy_us: float,
        skipped: int,
        law: int,
    ) -> None:
        """Record a tick that is done; room behind a record with fewer walls is left as it was.

        Args:
            area: where to.
            at: offset of the record in it [bytes].
            tick: what was done.
            sample: what the device said.
            seq: tick number.
            deadline_ns: when it was due [ns of CLOCK_MONOTONIC].
            late_us: how late it started [us].
            busy_us: how long its body took [us].
            skipped: deadlines skipped so far.
            law: index of the law activation.
        """
        motion = tick.motion
        past = tick.past
        energy_j = past.energy_j
        stored_j = past.stored_j
        dissipated_j = past.dissipated_j
        generated_j = past.generated_j
        walls: list[float] = []
        for contact in tick.contacts:
            ledger = contact.ledger
            energy_j += ledger.energy_j
            stored_j += ledger.stored_j
            dissipated_j += ledger.dissipated_j
            generated_j += ledger.generated_j
            walls += (
                contact.in_contact,
                contact.wall.stiffness_n_per_m,
                contact.damping_n_s_per_m,
                contact.felt_mass_kg,
                ledger.cycle,
                ledger.cycle_energy_j,
                ledger.cycle_generated_j,
                ledger.cycle_damping_n_s_per_m,
                ledger.cycle_duration_s,
            )
        for contact in tick.leaving:
            ledger = contact.ledger
            energy_j += ledger.energy_j
            stored_j += ledger.stored_j
            dissipated_j += ledger.dissipated_j
            generated_j += ledger.generated_j
        count = len(tick.contacts)
        self._packs[count](
            area,
            at,
            seq,
            deadline_ns,
            late_us,
            busy_us,
            motion.dt_s,
            skipped,
            tick.flags if sample.calibrated else tick.flags | _UNCALIBRATED,
            law,
            sample.buttons,
            sample.gripper_m,
            energy_j,
            stored_j,
            dissipated_j,
            generated_j,
            count,
            *motion.position_m,
            *motion.velocity_m_per_s,
            *tick.force_n,
            *tick.requested_n,
            *(sample.orientation if self.orientation else ()),
            *walls,
        )

    def pack_space(
        self,
        area: memoryview,
        at: int,
        tick: ControlTick,
        sample: Sample,
        seq: int,
        deadline_ns: int,
        late_us: float,
        busy_us: float,
        skipped: int,
        law: int,
        work_j: float = 0.0,
        more: int = 0,
    ) -> int:
        """The same for a scene with objects.

        Args:
            area: as `pack_walls` has it, and so are those up to `law`.
            at: see area.
            tick: see area.
            sample: see area.
            seq: see area.
            deadline_ns: see area.
            late_us: see area.
            busy_us: see area.
            skipped: see area.
            law: see area.
            work_j: of the clients of couplings and forces, which is recorded with those [J].
            more: added to the number of walls, for what follows behind.

        Returns:
            Its length [bytes].
        """
        motion = tick.motion
        books = tick.totals()
        totals = books.ledger
        values: list[float] = []
        for contact in tick.contacts:
            values += contact_values(contact, contact.wall.stiffness_n_per_m, contact.ledger)
        walls = count = len(tick.contacts)
        struct = self._structs[walls]
        if tick.has_objects:
            scene = cast("SpaceTick", tick)
            objects = scene.objects + LISTINGS * scene.listing
            values += (objects, books.moved_j - work_j, books.friction_j, books.friction_stored_j)
            x, y, z = motion.position_m
            shown = [each for each in scene.awake if not each.leaving]
            if len(shown) > MOST_OBJECTS:
                shown = sorted(shown, key=untouched)[:MOST_OBJECTS]
            for each in shown:
                values += object_values(each, scene.fading, x, y, z)
            struct = self._in_space[walls][len(shown)]
            count += _WALLS * (len(shown) + 1)
        struct.pack_into(
            area,
            at,
            seq,
            deadline_ns,
            late_us,
            busy_us,
            motion.dt_s,
            skipped,
            tick.flags if sample.calibrated else tick.flags | _UNCALIBRATED,
            law,
            sample.buttons,
            sample.gripper_m,
            totals.energy_j,
            totals.stored_j,
            totals.dissipated_j,
            totals.generated_j,
            count + more,
            *motion.position_m,
            *motion.velocity_m_per_s,
            *tick.force_n,
            *tick.requested_n,
            *(sample.orientation if self.orientation else ()),
            *values,
        )
        return struct.size

    def pack_ports(
        self,
        area: memoryview,
        at: int,
        tick: ControlTick,
        sample: Sample,
        seq: int,
        deadline_ns: int,
        late_us: float,
        busy_us: float,
        skipped: int,
        law: int,
    ) -> None:
        """The same for a scene with couplings, forces or remote objects, and with what else it has."""
        work_j = tick.own_ports.work_j()
        size = self.pack_space(area, at, tick, sample, seq, deadline_ns, late_us, busy_us, skipped, law, work_j, _PORTS)
        self._ports.pack(area, at + size, tick, work_j)

    def unpack(self, row: bytes | memoryview) -> TickRecord:
        """Decode one record."""
        scalars = len(_SCALARS)
        head = int.from_bytes(row[scalars * 8 : (scalars + 1) * 8], "little")
        has_ports, count = divmod(head, _PORTS)
        near, walls = divmod(count, _WALLS)
        struct = self._in_space[walls][near - 1] if near else self._structs[walls]
        values = struct.unpack_from(row)
        at = scalars + 1
        vectors: list[tuple[float, ...]] = []
        for length in (self.axes, self.axes, self.axes, self.axes, 9 if self.orientation else 0):
            vectors.append(values[at : at + length])
            at += length
        wall_records = []
        for _ in range(walls):
            wall_records.append(wall_record(values[at : at + len(WALL)]))
            at += len(WALL)
        space = space_record(values[at:]) if near else None
        ports = self._ports.unpack(row, struct.size) if has_ports else None
        made = (*values[:scalars], *vectors, tuple(wall_records), space, ports)
        return TickRecord(*made)
