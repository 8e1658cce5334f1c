"""Laws on devices that a wall, a late force or another hand does not leave alone: what they learn there and let go.

Sums and products alone, so that every computer gives the same numbers. What is kept of a tick is what reaches the hand
and what is published, not what a law remembers.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from hapticd import plugins
from hapticd.law import LawSnapshot, LawTick, fresh_state, plain_object, scalar_params
from tests.recorded.journal import Journal
from tests.recorded.laws import modes, named

PERIOD_S = 1e-3
PARTS = 5
"""Steps of the device in a tick."""
LIMIT_N = 12.0


@dataclass(slots=True)
class Place:
    """A device, its hand and what it touches; its fields change on the way.

    Attributes:
        mass_kg: of the device.
        viscous_n_s_per_m: its friction.
        resolution_m: of its position.
        hand_n: how the hand pushes it [N].
        stiffness_n_per_m: of what it touches.
        damping_n_s_per_m: of the same, and no law's.
        port: there is no surface: what it touches is a client's, on both sides of 0.
        spring: the law of the port knows a spring; else a force that says nothing of itself.
        heard: how many ticks later the force of the port has been computed [ticks].
        late: how many ticks later the device applies a force [ticks].
        shakes: the period varies by so much, as a share.
        stroke_m: a machine leads it to and fro by so much, whatever acts; 0: it is free [m].
        stroke_ticks: how long that takes one way [ticks].
        x_m: where it is [m].
        v_m_per_s: how fast.
    """

    mass_kg: float = 0.25
    viscous_n_s_per_m: float = 4.4
    resolution_m: float = 1e-5
    hand_n: float = -3.0
    stiffness_n_per_m: float = 12e3
    damping_n_s_per_m: float = 0.0
    port: bool = False
    spring: bool = False
    heard: int = 0
    late: int = 0
    shakes: float = 0.0
    stroke_m: float = 0.0
    stroke_ticks: int = 1
    x_m: float = 0.0
    v_m_per_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Course:
    """What happens to it.

    Attributes:
        ticks: for how long.
        begin: the place, as fields of `Place`.
        then: what changes at which tick.
        again_every: after how many ticks all this happens once more; 0: never.
        damping_n_s_per_m: what the law before had learned.
        debt_j: and what it owed.
    """

    ticks: int
    begin: Mapping[str, Any] = field(default_factory=dict)
    then: Mapping[int, Mapping[str, Any]] = field(default_factory=dict)
    again_every: int = 0
    damping_n_s_per_m: float = 0.0
    debt_j: float = 0.0


TAPS = {100: {"hand_n": 1.0}, 150: {"hand_n": 0.0, "v_m_per_s": 0.0, "x_m": 2e-3}, 300: {"hand_n": -4.0}}
SWAYS = {at: {"hand_n": newton} for at, newton in ((0, -6.0), (400, 4.0), (700, -2.0), (1100, 0.5))}

COURSES: dict[str, Course] = {
    "a hard wall": Course(1500, {"x_m": 2e-3}),
    "a wall that softens": Course(1600, {"x_m": 2e-3, "hand_n": -2.4}, {900: {"stiffness_n_per_m": 2e3}}),
    "taps on a soft wall": Course(4000, {"stiffness_n_per_m": 4e3, "x_m": 2e-3}, TAPS, 400),
    "taps where another law was": Course(
        2000, {"stiffness_n_per_m": 4e3, "x_m": 2e-3, "shakes": 0.3}, TAPS, 400, damping_n_s_per_m=150.0, debt_j=2e-3
    ),
    "a late device, then a hand that damps it": Course(
        5000,
        {"stiffness_n_per_m": 15e3, "viscous_n_s_per_m": 1.0, "resolution_m": 2e-6, "late": 1, "hand_n": -3.3},
        {
            3000: {"viscous_n_s_per_m": 30.0},
            3500: {"hand_n": 1.0},
            3700: {"hand_n": -4.0, "v_m_per_s": 0.0, "x_m": 2e-3},
            4200: {"hand_n": 1.0},
            4400: {"hand_n": -3.0, "v_m_per_s": 0.0, "x_m": 2e-3},
        },
    ),
    "a wall that no damping holds": Course(
        3000, {"stiffness_n_per_m": 25e3, "viscous_n_s_per_m": 0.5, "resolution_m": 2e-6, "late": 1, "hand_n": -3.3}
    ),
    "a light device that bounces": Course(
        2500, {"mass_kg": 0.05, "viscous_n_s_per_m": 0.0, "stiffness_n_per_m": 6e3, "hand_n": -0.6, "x_m": 2e-3}
    ),
    "coarse counts": Course(2500, {"resolution_m": 2e-4, "stiffness_n_per_m": 8e3, "x_m": 3e-3, "hand_n": -5.0}),
    "a wall that pushes along": Course(2000, {"stiffness_n_per_m": 3e3, "damping_n_s_per_m": -6.0, "x_m": 1e-3}),
    "a heavy device": Course(
        2500,
        {"mass_kg": 3.0, "viscous_n_s_per_m": 0.0, "stiffness_n_per_m": 9e3, "hand_n": -5.0, "x_m": 1e-3},
        {1500: {"hand_n": 5.0}, 1800: {"hand_n": -5.0, "v_m_per_s": 0.0, "x_m": 2e-3}},
    ),
    "swings that do not die away": Course(
        3000,
        {"stroke_m": 5e-4, "stroke_ticks": 25, "x_m": -1e-3, "stiffness_n_per_m": 4e3},
        {
            400: {"stroke_m": 1e-9},
            600: {"stroke_m": 5e-4, "x_m": -1e-3},
            1500: {"stroke_m": 3e-5, "x_m": -1e-3, "stroke_ticks": 12},
            2000: {"stroke_m": 4e-4, "stroke_ticks": 60},
            2500: {"stroke_m": 2e-4, "stroke_ticks": 30, "stiffness_n_per_m": 9e3},
        },
    ),
    "touches without a turn": Course(
        2500,
        {"stroke_m": 6e-4, "stroke_ticks": 12, "x_m": 5e-4, "resolution_m": 2e-4},
        {800: {"stroke_ticks": 60, "x_m": 5e-4}, 1500: {"stroke_m": 9e-4, "stroke_ticks": 20, "x_m": 4e-4}},
    ),
    "a wall that pulls for a while": Course(
        1500,
        {},
        {
            0: {"x_m": 1e-3, "v_m_per_s": 0.0, "hand_n": -3.0},
            300: {"stiffness_n_per_m": -500.0},
            310: {"stiffness_n_per_m": 12e3},
            400: {"hand_n": 9.0},
        },
        again_every=500,
    ),
}
"""At walls."""

PORT = {"port": True, "mass_kg": 0.3, "viscous_n_s_per_m": 5.0}
PORTS: dict[str, Course] = {
    "a force 10 ms late": Course(3000, {**PORT, "heard": 10, "stiffness_n_per_m": 2e3}, SWAYS, 1500),
    "a force 40 ms late": Course(3000, {**PORT, "heard": 40, "stiffness_n_per_m": 500.0}, SWAYS, 1500),
    "a force 80 ms late": Course(4000, {**PORT, "heard": 80, "stiffness_n_per_m": 250.0}, SWAYS, 1500),
    "a spring 10 ms late": Course(
        3500, {**PORT, "spring": True, "heard": 10, "stiffness_n_per_m": 1500.0, "resolution_m": 1e-6}, SWAYS, 1500
    ),
    "a spring 30 ms late": Course(
        3500,
        {**PORT, "spring": True, "heard": 30, "stiffness_n_per_m": 900.0},
        {**SWAYS, 1200: {"stiffness_n_per_m": 0.0}, 1300: {"stiffness_n_per_m": 900.0}},
        1750,
    ),
    "a late device, too": Course(
        3000,
        {**PORT, "heard": 10, "late": 1, "stiffness_n_per_m": 2.5e3, "resolution_m": 1e-6, "shakes": 0.2},
        SWAYS,
        1500,
    ),
    "small swings": Course(
        3000, {**PORT, "heard": 5, "stiffness_n_per_m": 3e3, "resolution_m": 5e-4, "hand_n": -1.0}, {}, 0, 20.0, 1e-3
    ),
    "a light device": Course(
        3000,
        {**PORT, "mass_kg": 0.06, "viscous_n_s_per_m": 0.3, "heard": 8, "stiffness_n_per_m": 1e3, "shakes": 0.3},
        SWAYS,
        1500,
    ),
}
"""At what clients do."""


def follow(law_name: str, keys: str, course: Course) -> Journal:
    """Go through a course with a law in one of its modes, as a daemon would ask it."""
    law: Any = plugins.law(law_name)
    journal = Journal()
    state, params = fresh_state(law), plain_object("Params", scalar_params(law.Params(**tomllib.loads(keys))))
    place = Place(**course.begin)
    tick = LawTick(place.resolution_m)
    seen_m = _counted(place)
    holds_n = -place.hand_n  # what the hand leans against
    law.start(state, params, LawSnapshot(seen_m, 0.0, holds_n, course.debt_j, course.damping_n_s_per_m))
    heard_n: list[float] = []
    forces_n = [0.0] * (place.late + 1)
    for journal.tick in range(course.ticks):
        at = journal.tick % course.again_every if course.again_every else journal.tick
        for name, value in course.then.get(at, {}).items():
            setattr(place, name, value)
        before_m, seen_m = seen_m, _counted(place)
        tick.dt_s = PERIOD_S * (1.0 + place.shakes * (journal.tick % 5 - 2) / 2.0)
        _see(tick, place, seen_m, before_m, heard_n)
        force_n = law.step(state, params, tick)
        tick.applied_contact_n, tick.applied_n = _limited(tick.contact_n), _limited(force_n)
        forces_n.append(tick.applied_n)
        if place.stroke_m:
            place.x_m += place.stroke_m / place.stroke_ticks * (1.0 if at // place.stroke_ticks % 2 else -1.0)
        else:
            _move(place, forces_n[-1 - place.late], tick.dt_s)
        journal.note("force_n", force_n)
        journal.note("damping", getattr(state, "damping_n_s_per_m", 0.0))
        journal.note("felt mass", getattr(state, "felt_mass_kg", 0.0))
    journal.say(f"at {1e3 * place.x_m:.6f} mm")
    return journal


def _see(tick: Any, place: Place, seen_m: float, before_m: float, heard_n: list[float]) -> None:
    """What the law is shown, but for what was applied."""
    tick.moved_m = seen_m - before_m
    tick.velocity_m_per_s = tick.moved_m / tick.dt_s
    own_n = -place.stiffness_n_per_m * seen_m - place.damping_n_s_per_m * tick.velocity_m_per_s
    heard_n.append(_limited(own_n))
    if place.port:
        tick.in_contact = place.stiffness_n_per_m > 0.0
        tick.x_m = seen_m - 1e-15 if place.spring else -1e-15
        tick.spring_n = -place.stiffness_n_per_m * tick.x_m if place.spring else 0.0
        tick.contact_n = heard_n[-1 - place.heard] if len(heard_n) > place.heard and tick.in_contact else 0.0
    else:
        tick.in_contact = seen_m < 0.0
        tick.x_m = seen_m
        tick.spring_n = -place.stiffness_n_per_m * seen_m if tick.in_contact else 0.0
        tick.contact_n = own_n if tick.in_contact else 0.0


def _counted(place: Place) -> float:
    return round(place.x_m / place.resolution_m) * place.resolution_m


def _limited(newton: float) -> float:
    return max(-LIMIT_N, min(LIMIT_N, newton))


def _move(place: Place, force_n: float, dt_s: float) -> None:
    """One period of the device under a held force."""
    for _ in range(PARTS):
        pull_n = force_n + place.hand_n - place.viscous_n_s_per_m * place.v_m_per_s
        place.v_m_per_s += dt_s / PARTS * pull_n / place.mass_kg
        place.x_m += dt_s / PARTS * place.v_m_per_s


HELD = (("energy-cycle", COURSES), ("ring-damping", COURSES), ("late-cycle", PORTS))
MODES = (
    ("ring-damping", COURSES, "a late device, then a hand that damps it"),
    ("ring-damping", COURSES, "swings that do not die away"),
    ("late-cycle", PORTS, "a force 10 ms late"),
    ("late-cycle", PORTS, "a spring 30 ms late"),
)
"""Where each number of a law is halved, too."""

FOLLOWED: dict[str, Callable[[], Journal]] = {
    **{f"{law} at {name}": partial(follow, law, "", each) for law, courses in HELD for name, each in courses.items()},
    **{
        f"{law} {named(mode)} at {name}": partial(follow, law, mode, courses[name])
        for law, courses, name in MODES
        for mode in modes(law)
        if mode
    },
}
