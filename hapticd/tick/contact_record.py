"""What one tick records of each contact, wall or object, and how that lies in a record."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # clients read records without the tick that makes them
    from hapticd.tick.contact import Contact
    from hapticd.tick.energy import EnergyLedger
    from hapticd.tick.space.solid_contact import SolidContact

MOST_OBJECTS = 8
"""Most objects in one record: those that are touched come first."""


@dataclass(slots=True)
class WallRecord:
    """One wall in one tick.

    Attributes:
        in_contact: whether the device is inside the wall.
        stiffness_n_per_m: stiffness of the wall in this tick [N/m].
        damping_n_s_per_m: damping of the law [N s/m]; 0 when the law has none.
        felt_mass_kg: mass that the law has identified [kg]; 0 while unknown.
        cycle: number of completed cycles; the four fields below belong to the last one.
        cycle_energy_j: energy at its end [J].
        cycle_generated_j: energy that it generated [J], > 0 when the wall gave back more than it took.
        cycle_damping_n_s_per_m: damping in force when it ended [N s/m].
        cycle_duration_s: how long it took [s].
    """

    in_contact: bool
    stiffness_n_per_m: float
    damping_n_s_per_m: float
    felt_mass_kg: float
    cycle: int
    cycle_energy_j: float
    cycle_generated_j: float
    cycle_damping_n_s_per_m: float
    cycle_duration_s: float


@dataclass(slots=True)
class ObjectRecord:
    """One object that the device touches or may touch, in one tick.

    Attributes:
        index: of the object in the scene; of several that are one solid, the first.
        contact: what a wall has as well.
        proxy_m: the point on its surface that pulls the device back [m].
        normal: the direction from the device to the surface, outward, a unit vector.
        depth_m: how far that is [m].
        force_n: force that it applies to the device, with what is left of what it was before a reload [N].
        sliding: whether friction slips.
        carrier: of the objects that are one solid, the one on whose surface the proxy is.
        inside: of these, those that the device is in.
    """

    index: int
    contact: WallRecord
    proxy_m: tuple[float, ...]
    normal: tuple[float, ...]
    depth_m: float
    force_n: tuple[float, ...]
    sliding: bool
    carrier: int
    inside: tuple[int, ...]


@dataclass(slots=True)
class SpaceRecord:
    """What a scene with objects adds to a tick.

    Attributes:
        objects: how many the scene has.
        listing: which list of objects that is; another one where any of them came, went or changed places.
        moved_j: work that changes of the objects did on their springs [J].
        friction_j: energy that slipping took, a part of what is dissipated [J].
        friction_energy_j: energy in the springs along surfaces now, a part of what is stored [J].
        near: the objects that the device touches or may touch.
    """

    objects: int
    listing: int
    moved_j: float
    friction_j: float
    friction_energy_j: float
    near: tuple[ObjectRecord, ...]


CODES = {"int": "q", "bool": "q", "float": "d"}
"""How `struct` writes the types of fields."""

WALL = "".join(CODES[str(field.type)] for field in fields(WallRecord))
SPACE = "qddd"
LISTINGS = 65536
"""What stands where the number of objects does: that number, and this times that of their list."""

OBJECT = f"q{WALL}ddddddddddqqQ"
"""How `struct` writes what the records above have."""


def contact_values(contact: Contact, stiffness_n_per_m: float, ledger: EnergyLedger) -> tuple[float, ...]:
    """The fields of `WallRecord`."""
    return (
        contact.in_contact,
        stiffness_n_per_m,
        contact.damping_n_s_per_m,
        contact.felt_mass_kg,
        ledger.cycle,
        ledger.cycle_energy_j,
        ledger.cycle_generated_j,
        ledger.cycle_damping_n_s_per_m,
        ledger.cycle_duration_s,
    )


def object_values(
    contact: SolidContact, fading: Iterable[SolidContact], x: float, y: float, z: float
) -> tuple[float, ...]:
    """The fields of `ObjectRecord`, with the device at a point of the world.

    Args:
        contact: of the object.
        fading: those that fade out; what is left of what one of its name held is its force too.
        x: the device, with y and z [m].
        y: see x.
        z: see x.
    """
    solid = contact.solid
    proxy = solid.proxy
    depth_m = contact.depth_m
    carrier = solid.index
    inside = 1 << carrier if depth_m > 0.0 else 0
    if len(solid.members) > 1 and depth_m > 0.0:
        carrier, inside = solid.shares(x, y, z)
    force_n = contact.force
    for each in fading:
        if each.solid.name == solid.name:
            fx, fy, fz = each.force
            force_n = (force_n[0] + fx, force_n[1] + fy, force_n[2] + fz)
    return (
        solid.index,
        *contact_values(contact.normal, solid.stiffness_n_per_m, contact.ledger),
        x + depth_m * proxy.normal_x + proxy.stretch_x,
        y + depth_m * proxy.normal_y + proxy.stretch_y,
        z + depth_m * proxy.normal_z + proxy.stretch_z,
        proxy.normal_x,
        proxy.normal_y,
        proxy.normal_z,
        depth_m,
        *force_n,
        proxy.sliding,
        carrier,
        inside,
    )


def untouched(contact: SolidContact) -> bool:
    """Sorts those that are touched to the front."""
    return not contact.in_contact


def wall_record(values: Sequence[Any]) -> WallRecord:
    """A wall of a record that was read."""
    wall = WallRecord(*values)
    wall.in_contact = bool(wall.in_contact)
    return wall


def space_record(values: Sequence[Any]) -> SpaceRecord:
    """What comes behind the walls."""
    near = []
    for at in range(len(SPACE), len(values), len(OBJECT)):
        one = values[at : at + len(OBJECT)]
        where = one[1 + len(WALL) :]
        near.append(
            ObjectRecord(
                one[0],
                wall_record(one[1 : 1 + len(WALL)]),
                tuple(where[0:3]),
                tuple(where[3:6]),
                where[6],
                tuple(where[7:10]),
                bool(where[10]),
                where[11],
                tuple(index for index in range(where[12].bit_length()) if where[12] >> index & 1),
            )
        )
    objects, moved_j, friction_j, friction_energy_j = values[: len(SPACE)]
    listing, objects = divmod(objects, LISTINGS)
    return SpaceRecord(objects, listing, moved_j, friction_j, friction_energy_j, tuple(near))
