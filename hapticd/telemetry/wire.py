"""What goes over the wire: topics, and a tick record as the maps that docs/telemetry.md promises.

Pure functions: no socket, no file. A number that is not finite never leaves: 0 is sent in its place and the
map says `invalid`.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator, Mapping, Sequence
from struct import Struct
from typing import Any, Protocol

import msgpack

from hapticd.tick.contact_record import SpaceRecord, WallRecord
from hapticd.tick.event import LoopEvent
from hapticd.tick.record import TickRecord
from hapticd.tick.remote.port_record import PortRecord, PortsRecord
from hapticd.tick.remote.port_state import PortState

SCHEMA = 1
"""Version of the contract; goes up only when a key changes its meaning or goes, which clients must notice."""

INVALID = "invalid"
"""Key that is true in a map in which a value was not finite, and absent otherwise."""

Map = dict[str, Any]


class Topic(enum.StrEnum):
    """First frame of every message. None is a prefix of another, since ZeroMQ subscribes by prefix."""

    POSITION = "hapticd/position"
    ENERGY = "hapticd/energy"
    DAMPING = "hapticd/damping"
    CONTACT = "hapticd/contact"
    TIMING = "hapticd/timing"
    CYCLE = "hapticd/cycle"
    INPUT = "hapticd/input"
    EVENT = "hapticd/event"
    STATUS = "hapticd/status"


class Inputs(Protocol):
    """The part of `DeviceInfo` that says what a device can report besides its position."""

    @property
    def buttons(self) -> int:
        """Number of buttons."""

    @property
    def has_gripper(self) -> bool:
        """Whether it has a gripper."""

    @property
    def has_orientation(self) -> bool:
        """Whether it has a wrist."""


def position_map(record: TickRecord, timestamp: float) -> Map:
    """hapticd/position: where the device is and what pushes it."""
    fields: Map = {
        "timestamp": timestamp,
        "seq": record.seq,
        "position_m": record.position_m,
        "velocity_m_per_s": record.velocity_m_per_s,
        "force_n": record.force_n,
        "force_requested_n": record.force_requested_n,
    }
    # One sum tells whether all of its numbers are finite; one that merely overflowed is left to `plain_map`.
    total = sum(record.position_m) + sum(record.velocity_m_per_s)
    total += sum(record.force_n) + sum(record.force_requested_n)
    return fields if math.isfinite(total) else plain_map(fields)


def energy_map(record: TickRecord, timestamp: float) -> Map:
    """hapticd/energy: the ledger."""
    fields: Map = {
        "timestamp": timestamp,
        "seq": record.seq,
        "energy_j": record.energy_j,
        "spring_energy_j": record.spring_energy_j,
        "dissipated_j": record.dissipated_j,
        "generated_j": record.generated_j,
    }
    total = record.energy_j + record.spring_energy_j + record.dissipated_j + record.generated_j
    space = record.space
    if space is not None:
        fields["scene_work_j"] = space.moved_j + (record.ports.work_j if record.ports else 0.0)
        fields["friction_j"] = space.friction_j
        fields["friction_energy_j"] = space.friction_energy_j
        total += space.moved_j + space.friction_j + space.friction_energy_j
    elif record.ports is not None:
        fields["scene_work_j"] = record.ports.work_j
    if record.ports is not None:
        total += record.ports.work_j
    return fields if math.isfinite(total) else plain_map(fields)


class Objects:
    """What is known of every object: a record has those in reach only, and of the others nothing changes.

    Where the list of objects has become another one, those that have not been in reach since are as good as new.
    """

    def __init__(self) -> None:
        self._known: list[WallRecord] = []
        self._listing = -1

    def see(self, record: TickRecord) -> Sequence[WallRecord]:
        """Walls, objects, couplings and forces of a record, in scene order; records must come in order."""
        space = record.space
        ports = [] if record.ports is None else [_as_contact(one) for one in pulling(record.ports)]
        if space is None:
            self._known = []
            return [*record.walls, *ports] if ports else record.walls
        if len(self._known) != space.objects or self._listing != space.listing:
            self._listing = space.listing
            self._known = [_UNTOUCHED] * space.objects
        for one in space.near:
            self._known[one.index] = one.contact
        return [*record.walls, *self._known, *ports]


def pulling(ports: PortsRecord) -> list[PortRecord]:
    """The couplings and forces of a scene: a record has room for all of them."""
    return sorted((one for one in ports.shown if one.index >= ports.objects), key=lambda one: one.index)


def _acts(port: PortRecord) -> bool:
    """Whether a coupling or a force is in force, or still fades out."""
    return port.state == PortState.HELD or any(port.force_n)


def _as_contact(port: PortRecord) -> WallRecord:
    acts = _acts(port)
    return WallRecord(acts, port.stiffness_n_per_m, port.damping_n_s_per_m, port.felt_mass_kg, 0, 0.0, 0.0, 0.0, 0.0)


def damping_map(record: TickRecord, timestamp: float, contacts: Sequence[WallRecord] | None = None) -> Map:
    """hapticd/damping: what the law does at each wall, then at each object, then at each coupling and force.

    Args:
        record: the tick.
        timestamp: of its deadline [s].
        contacts: walls, objects, couplings and forces; None: the walls of the record.
    """
    contacts = record.walls if contacts is None else contacts
    damping = [contact.damping_n_s_per_m for contact in contacts]
    mass = [contact.felt_mass_kg for contact in contacts]
    fields: Map = {
        "timestamp": timestamp,
        "seq": record.seq,
        "damping_n_s_per_m": damping,
        "in_contact": [contact.in_contact for contact in contacts],
        "felt_mass_kg": mass,
    }
    return fields if math.isfinite(sum(damping) + sum(mass)) else plain_map(fields)


def contact_maps(record: TickRecord, timestamp: float) -> list[Map]:
    """hapticd/contact: a map for each object that is touched, then one for each coupling and force that acts."""
    maps: list[Map] = []
    said: dict[int, Map] = {}
    if record.ports is not None:
        said = {one.object: _said(one) for one in record.ports.shown if one.object >= 0}
    if record.space is not None:
        for one in record.space.near:
            if one.contact.in_contact:
                fields: Map = {
                    "timestamp": timestamp,
                    "seq": record.seq,
                    "object": one.index,
                    "proxy_m": one.proxy_m,
                    "normal": one.normal,
                    "depth_m": one.depth_m,
                    "force_n": one.force_n,
                    "sliding": one.sliding,
                    "carrier": one.carrier,
                    "inside": one.inside,
                }
                maps.append(plain_map({**fields, **said.get(one.index, {})}))
    if record.ports is not None:
        for port in pulling(record.ports):
            if _acts(port):
                maps.append(
                    plain_map({"timestamp": timestamp, "seq": record.seq, "force_n": port.force_n, **_said(port)})
                )
    return maps


def _said(port: PortRecord) -> Map:
    """What a map has of what a client drives."""
    return {"remote": port.index, "remote_seq": port.seq, "target_m": port.target_m}


def timing_map(record: TickRecord, timestamp: float) -> Map:
    """hapticd/timing: how punctual the tick was."""
    fields: Map = {
        "timestamp": timestamp,
        "seq": record.seq,
        "deadline_ns": record.deadline_ns,
        "late_us": record.late_us,
        "busy_us": record.busy_us,
        "dt_s": record.dt_s,
    }
    return fields if math.isfinite(record.late_us + record.busy_us + record.dt_s) else plain_map(fields)


def input_map(record: TickRecord, timestamp: float, inputs: Inputs) -> Map:
    """hapticd/input: buttons, gripper and wrist, those that the device has."""
    fields: Map = {"timestamp": timestamp, "seq": record.seq}
    if inputs.buttons:
        fields["buttons"] = record.buttons
    if inputs.has_gripper:
        fields["gripper_m"] = record.gripper_m
    if inputs.has_orientation:
        fields["orientation"] = record.orientation
    return fields if math.isfinite(record.gripper_m + sum(record.orientation)) else plain_map(fields)


class Cycles:
    """Sees from one record to the next which walls and objects completed a cycle.

    A reload may put a wall in another one's place. So a cycle counts as seen when any wall had it in the record before,
    number and figures the same to the last bit: each of those stands for one wall now. Of an object, which is not in
    every record, any had it in the list of objects before.
    """

    def __init__(self) -> None:
        self._last: list[bytes] = []
        self._of_objects: dict[int, bytes] = {}
        self._of_lists_before: list[bytes] = []
        self._listing = -1

    def completed(self, record: TickRecord) -> Iterator[tuple[int, int]]:
        """Contact and number of each cycle that ended in this record, walls before objects; records come in order."""
        if record.space is not None:
            for index, number in self._completed_by_objects(record.space):
                yield len(record.walls) + index, number
        before, self._last = self._last, [_cycle(wall) for wall in record.walls]
        if self._last == before:
            return
        left = list(before)
        changed = []
        for index, cycle in enumerate(self._last):
            if index < len(before) and cycle == before[index]:
                left.remove(cycle)
            else:
                changed.append(index)
        for index in changed:
            if self._last[index] in left:
                left.remove(self._last[index])
            elif record.walls[index].cycle > 0:
                yield index, record.walls[index].cycle

    def _completed_by_objects(self, space: SpaceRecord) -> Iterator[tuple[int, int]]:
        if space.listing != self._listing:
            self._listing = space.listing
            self._of_lists_before += self._of_objects.values()
            self._of_objects = {}
        for one in space.near:
            number = one.contact.cycle
            if number > 0:
                cycle = _cycle(one.contact)
                before, self._of_objects[one.index] = self._of_objects.get(one.index), cycle
                if before is None and cycle in self._of_lists_before:
                    self._of_lists_before.remove(cycle)
                elif cycle != before:
                    yield one.index, number


def cycle_map(record: TickRecord, timestamp: float, contact: int) -> Map:
    """hapticd/cycle: the cycle that a wall, or behind the walls an object, completed in this record."""
    walls = len(record.walls)
    if contact < walls or record.space is None:
        ended = record.walls[contact]
    else:
        ended = next(one.contact for one in record.space.near if one.index == contact - walls)
    return plain_map(
        {
            "timestamp": timestamp,
            "seq": record.seq,
            "contact": contact,
            "cycle": ended.cycle,
            "energy_j": ended.cycle_energy_j,
            "generated_j": ended.cycle_generated_j,
            "damping_n_s_per_m": ended.cycle_damping_n_s_per_m,
            "duration_s": ended.cycle_duration_s,
        }
    )


def event_map(event: LoopEvent, timestamp: float) -> Map:
    """hapticd/event: what happened; its fields come with the four keys that every event has."""
    return plain_map({**event.fields, "timestamp": timestamp, "seq": event.seq, "code": event.code, "text": event.text})


def status_map(status: Mapping[str, Any], timestamp: float, seq: int, every_ticks: int) -> Map:
    """hapticd/status: what the supervisor says, and what only the publisher knows."""
    wire = {"timestamp": timestamp, "seq": seq, "schema": SCHEMA, "every_ticks": every_ticks}
    return plain_map({**status, **wire})


def plain_map(fields: Mapping[str, Any]) -> Map:
    """The same map in plain finite values; says `invalid` when one was not finite."""
    invalid: list[str] = []
    plain: Map = {str(key): _plain(value, str(key), invalid) for key, value in fields.items()}
    if invalid:
        plain[INVALID] = True
    return plain


def new_packer() -> msgpack.Packer:
    """A packer to keep: making one costs more than packing a batch."""
    return msgpack.Packer(use_bin_type=True, unicode_errors="replace")


_UNTOUCHED = WallRecord(False, 0.0, 0.0, 0.0, 0, 0.0, 0.0, 0.0, 0.0)
_CYCLE = Struct("<qddd")


def _cycle(wall: WallRecord) -> bytes:
    """The last cycle of a wall, for comparison; in bytes a NaN is equal to itself."""
    return _CYCLE.pack(wall.cycle, wall.cycle_energy_j, wall.cycle_generated_j, wall.cycle_duration_s)


def _plain(value: Any, key: str, invalid: list[str]) -> Any:
    if isinstance(value, bool | str):
        return value
    if isinstance(value, int):
        if -(2**63) <= value < 2**63:
            return int(value)
    elif isinstance(value, float):
        if math.isfinite(value):
            return float(value)
    elif isinstance(value, Mapping):
        return {str(name): _plain(element, key, invalid) for name, element in value.items()}
    elif isinstance(value, list | tuple):
        return [_plain(element, key, invalid) for element in value]
    else:
        return str(value)
    invalid.append(key)
    return 0
