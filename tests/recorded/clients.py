"""Clients that say this and that of couplings, forces and objects, fall silent, let go, and see the scene change."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from hapticd.tick.remote.one_port import OnePort
from hapticd.tick.remote.remote_object import RemoteObject
from tests.recorded.hand import Hand
from tests.recorded.journal import Journal
from tests.tick.remote.rig import FORCE_PORT, WALL, Rig

TICKS = 1000
TALKS_FOR, SILENT_FOR = 330, 130
"""Of a while of talking, how much at its end is silence [ticks]."""
REACH_M = 0.006


def coupling(stiffness_n_per_m: float, most_n: float, more: str = "") -> str:
    return (
        f'[[scene.couplings]]\nname = "tool"\nstiffness_n_per_m = {stiffness_n_per_m}\n'
        f"damping_n_s_per_m = 5.0\nmax_force_n = {most_n}\n{more}"
    )


def ball(stiffness_n_per_m: float, more: str = "") -> str:
    return (
        '[[scene.objects]]\nname = "ball"\nshape = "box"\nsize_m = [0.02, 0.03, 0.02]\n'
        "position_m = [0.0, 0.0, -0.012]\ndamping_n_s_per_m = 2.0\n"
        f"stiffness_n_per_m = {stiffness_n_per_m}\nremote = true\n{more}"
    )


@dataclass(frozen=True, slots=True)
class Talk:
    """What clients talk of.

    Attributes:
        scenes: one after the other, each for as long as the others.
        law: of walls and of what clients drive.
        axes: of the device.
        seed: of what is said.
    """

    scenes: tuple[str, ...]
    law: str
    axes: str
    seed: int


FLOOR = '[[scene.objects]]\nname = "floor"\nshape = "plane"\nstiffness_n_per_m = 1200.0\nremote = true\n'
ROUGH = "static_friction = 0.6\ndynamic_friction = 0.5\n"
SLOW, FAST = "hold_s = 0.04\nmax_speed_m_per_s = 0.1\n", "hold_s = 0.1\nmax_speed_m_per_s = 0.5\n"
LINE = (
    coupling(1500.0, 4.0, FAST) + FORCE_PORT + WALL,
    coupling(900.0, 4.5, SLOW) + FORCE_PORT.replace("3.0", "2.4") + "hold_s = 0.3\n" + WALL,
    FORCE_PORT,
    coupling(1500.0, 3.8, SLOW) + FORCE_PORT,
)
SPACE = (
    ball(1500.0, FAST + ROUGH) + coupling(800.0, 3.0, SLOW) + FORCE_PORT,
    ball(900.0, SLOW + ROUGH) + coupling(800.0, 3.3, FAST) + FORCE_PORT,
    coupling(800.0, 3.0, FAST),
    FLOOR + FORCE_PORT,
)

TALKS = {
    "clients on a line": Talk(LINE, "none", "x", 1),
    "clients under ring-damping": Talk(LINE, "ring-damping", "x", 3),
    "clients driven": Talk(tuple(each.replace(SLOW, SLOW + "driven = true\n") for each in LINE), "tdpa", "x", 4),
    "clients in space under late-cycle": Talk(SPACE, "late-cycle", "xyz", 7),
}


def listen(talk: Talk) -> Journal:
    """What the device and the clients get of it, at every tick."""
    journal = Journal()
    draw = random.Random(talk.seed).random
    rig = Rig(talk.scenes[0], law=talk.law, axes=talk.axes)
    hand = Hand(talk.seed, len(talk.axes), REACH_M)
    for journal.tick in range(TICKS):
        if journal.tick and journal.tick % (TICKS // len(talk.scenes)) == 0:
            rig.switch(talk.scenes[journal.tick * len(talk.scenes) // TICKS])
        _let_go_and_arm(rig, journal.tick)
        for port in rig.ports:
            at = journal.tick % TALKS_FOR
            if at < TALKS_FOR - SILENT_FOR and draw() < (0.9 if at < 80 else 0.08):
                rig.say(port.name, **_something(draw, port.kind, len(talk.axes)))
        if draw() < 0.1:
            rig.repeat()
        else:
            rig.go(hand.go(), dt_s=1e-3 * (0.8 + 0.4 * draw()))
        _note(journal, rig)
    journal.say("the books balance" if rig.unbalanced_j() < 1e-9 else "they do not balance")
    return journal


def _let_go_and_arm(rig: Rig, tick: int) -> None:
    if tick == 830:
        rig.tick.start(rig.sample)
        rig.force, rig.pulled = [0.0] * len(rig.force), []
    if tick % 400 == 370:
        rig.tick.release()
    if tick % 400 == 399 or tick == 850:
        rig.tick.arm()


def _something(draw: Callable[[], float], kind: str, axes: int) -> dict[str, Any]:
    def vector(most: float, count: int = axes) -> list[float]:
        return [most * (2.0 * draw() - 1.0) for _ in range(count)]

    if kind == "force":
        return {"force_n": vector(4.0)} if draw() < 0.97 else {"released": True}
    said: dict[str, Any] = {}
    if draw() < 0.8:
        said["position_m"] = vector(REACH_M)
    if draw() < 0.4:
        said["velocity_m_per_s"] = vector(0.1)
    if draw() < 0.2:
        said["stiffness_n_per_m"] = 2000.0 * draw()
    if draw() < 0.2:
        said["damping_n_s_per_m"] = 8.0 * draw()
    if kind == "object" and draw() < 0.4:
        said["orientation"] = vector(1.0, 4)
    if kind == "object" and draw() < 0.2:
        said["angular_velocity_rad_per_s"] = vector(3.0)
    if draw() < 0.02:
        said["released"] = True
    return said


def _note(journal: Journal, rig: Rig) -> None:
    journal.note("force", rig.force)
    for port in rig.ports:
        name = port.name
        journal.note(f"{name} force", tuple(port.force_n))
        journal.note(f"{name} impulse", tuple(port.impulse_n_s))
        journal.note(f"{name} target", tuple(port.target_m))
        journal.note(f"{name} state", [float(port.state), float(port.seq), port.age_s])
        journal.note(f"{name} books", [port.work_j, *port.law_values()])
        if port.news is not None:
            journal.say(f"{name}: {port.news!r}")
            port.news = None
        if isinstance(port, RemoteObject):
            journal.note(f"{name} turned", [*port.turning.now, float(port.rests)])
        if isinstance(port, OnePort):
            books = port.books
            cycle = (books.ledger.cycle, books.ledger.cycle_duration_s, books.ledger.cycle_damping_n_s_per_m)
            journal.note(f"{name} cycle", [*cycle, books.ledger.energy_j, books.carried_j, float(port.asleep)])
    totals = rig.tick.totals()
    ledger = totals.ledger
    journal.note("books", [ledger.energy_j, ledger.stored_j, ledger.dissipated_j, ledger.generated_j, totals.moved_j])


HEARD: dict[str, Callable[[], Journal]] = {name: partial(listen, talk) for name, talk in TALKS.items()}
