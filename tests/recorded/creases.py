"""Hands in creases and corners, smooth and rough, with what every law of them is shown and what is booked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from tests.recorded.hand import Hand
from tests.recorded.journal import Journal
from tests.tick.space.rig import Rig, table

TICKS = 700
ROUGH = "static_friction = 0.5\ndynamic_friction = 0.3\n"
REACH_M, MIDDLE_M = 0.0012, -7e-4


def notch(stiffness_n_per_m: float, keys: str = "") -> str:
    """A floor and a wall that meet along y, the floor a little askew."""
    floor = table(
        "floor",
        "box",
        stiffness_n_per_m,
        size_m=(0.1, 0.1, 0.04),
        position_m=(0.0, 0.0, -0.02),
        orientation=(1.0, 0.02, -0.03, 0.01),
        damping_n_s_per_m=1.0,
    )
    wall = table(
        "wall",
        "box",
        stiffness_n_per_m,
        size_m=(0.04, 0.1, 0.1),
        position_m=(-0.02, 0.0, 0.0),
        damping_n_s_per_m=1.0,
    )
    return floor + keys + wall + keys


def room(stiffness_n_per_m: float, keys: str = "") -> str:
    """A corner of three faces, a little askew."""
    place = {"position_m": (0.0095, 0.0095, 0.0095), "orientation": (1.0, 0.03, -0.02, 0.01)}
    return table("room", "box", stiffness_n_per_m, inside=True, size_m=(0.02, 0.02, 0.02), **place) + keys


@dataclass(frozen=True, slots=True)
class Visit:
    """A hand in a crease.

    Attributes:
        scene: to begin with.
        other: half-way.
        law: of all directions.
    """

    scene: str
    other: str
    law: str


VISITS = {
    "a notch": Visit(notch(4000.0), notch(6000.0), "ring-damping"),
    "a notch that turns rough": Visit(notch(4000.0), notch(4000.0, ROUGH), "energy-cycle"),
    "a corner": Visit(room(4000.0), room(3000.0), "energy-cycle"),
    "a rough corner": Visit(room(4000.0, ROUGH), room(5000.0), "ring-damping"),
}


def visit(one: Visit) -> Journal:
    """What the device gets of it, at every tick."""
    journal = Journal()
    rig = Rig(one.scene, one.law, "max_force_n = 8.0\n").start((0.001, 0.001, 0.001))
    hand = Hand(11, 3, REACH_M, (MIDDLE_M, MIDDLE_M, MIDDLE_M))
    x, y, z = hand.go()
    rig.to((x, y, z), 40)
    for journal.tick in range(TICKS):
        if journal.tick == TICKS // 2:
            rig.switch(one.other)
        if journal.tick == 500:
            rig.tick.release()
        if journal.tick == 530:
            rig.tick.arm()
        if journal.tick == 600:
            rig.tick.start(rig.sample)
            rig.tick.arm()
            rig.force = (0.0, 0.0, 0.0)
        if journal.tick % 9 == 4:
            rig.tick.advance(rig.sample, 1e-3)
        else:
            x, y, z = hand.go()
            rig.go((x, y, z))
        _note(journal, rig)
    return journal


def _note(journal: Journal, rig: Rig) -> None:
    tick = rig.tick
    journal.note("force", list(tick.force_n))
    journal.note("requested", list(tick.requested_n))
    for contact in tick.solids:
        name = contact.solid.name
        journal.note(f"{name} pinned", [float(contact.grip), float(contact.sides), contact.depth_m, contact.off_m])
        journal.note(f"{name} to", [contact.to_x, contact.to_y, contact.to_z])
        for number, channel in enumerate(contact.channels[: contact.sides]):
            shown = channel.tick
            journal.note(f"{name} {number} along", [channel.dx, channel.dy, channel.dz])
            journal.note(f"{name} {number} shown", [shown.x_m, shown.moved_m, shown.velocity_m_per_s, shown.contact_n])
            journal.note(f"{name} {number} applied", [shown.applied_n, shown.applied_contact_n, channel.held_n])
            journal.note(f"{name} {number} law", [channel.damping_n_s_per_m, channel.felt_mass_kg])
    totals = rig.totals
    ledger = totals.ledger
    journal.note("books", [ledger.energy_j, ledger.stored_j, ledger.dissipated_j, ledger.generated_j, totals.moved_j])
    journal.note("friction", [totals.friction_j, totals.friction_stored_j])


VISITED: dict[str, Callable[[], Journal]] = {name: partial(visit, each) for name, each in VISITS.items()}
