"""What befalls a device and its tick on the way: whatever else is alike, two ticks that go through it give the same."""

from __future__ import annotations

import dataclasses
import math
import random
from collections.abc import Callable, Mapping
from typing import Any

from hapticd.tick.contact import RunningLaw
from tests.recorded.hand import Hand
from tests.tick.rig import law
from tests.tick.space.rig import INFO, Point, Rig

Act = Callable[[Rig], object]
Moment = tuple[float, ...]

REAL = dataclasses.replace(INFO, simulated=False)
"""A device whose ramps go by the clock."""


def lost(rig: Rig) -> None:
    """It says nonsense until it is found."""
    rig.sample.position_m[1] = math.nan


def armed(rig: Rig) -> None:
    """After whatever has happened."""
    rig.tick.guard.clear()
    rig.tick.fault = 0
    rig.tick.arm()


def released(rig: Rig) -> None:
    rig.tick.release()


def uncalibrated(rig: Rig) -> None:
    rig.sample.calibrated = False


def calibrated(rig: Rig) -> None:
    rig.sample.calibrated = True


def begun(rig: Rig) -> None:
    """As after a calibration."""
    rig.tick.start(rig.sample)


def tared(rig: Rig) -> None:
    rig.tick.tare()


def switched(scene: str, law: str | None = None) -> Act:
    """To another scene, and another law where one is named."""
    return lambda rig: rig.switch(scene, law)


def with_a_law_that_fails(calls: int) -> Act:
    """It goes well for a number of calls, and fails at the next."""

    def act(rig: Rig) -> None:
        done = 0

        def step(_state: Any, _params: Any, tick: Any) -> float:
            nonlocal done
            done += tick.in_contact
            if done > calls:
                raise ZeroDivisionError("of its own")
            return float(tick.contact_n)

        module = law(step)
        for _ in rig.tick.switch(make_law=lambda: RunningLaw(module, module.Params())):
            pass

    return act


STANDS = range(560, 600)
"""When it has nothing new."""

ACTS: dict[int, Act] = {
    **dict.fromkeys(range(150, 158), lost),
    240: lost,
    241: armed,
    175: armed,
    300: released,
    330: armed,
    400: uncalibrated,
    405: calibrated,
    415: armed,
    450: released,
    520: armed,
    570: released,
    575: armed,
    620: armed,
    700: released,
    760: begun,
    770: armed,
    850: with_a_law_that_fails(40),
    960: armed,
}
TICKS = 1000


def go_through(
    rig: Rig,
    told: Callable[[Rig], Moment],
    acts: Mapping[int, Act] | None = None,
    *,
    ticks: int = TICKS,
    seed: int = 3,
    middle_m: Point = (0.0, 0.0, 0.0),
    placed: Callable[[Point], Point] = lambda at: at,
) -> list[Moment]:
    """Let a hand go about a point, and do at some ticks what is to be done; the record after each.

    Args:
        rig: not yet started.
        told: of a tick.
        acts: before which tick; none: `ACTS`.
        ticks: for how long.
        seed: of the hand.
        middle_m: where it goes about [m].
        placed: where it goes instead.
    """
    draw = random.Random(seed).random
    hand = Hand(seed, 3, 0.012, middle_m)
    x, y, z = hand.go()
    rig.start(placed((x, y, z)))
    moments = []
    for number in range(ticks):
        act = (ACTS if acts is None else acts).get(number)
        x, y, z = hand.go()
        jitter, again = 0.8 + 0.4 * draw(), draw() < 0.05 or number in STANDS
        if not again:
            rig.sample.position_m[:] = placed((x, y, z))
            rig.sample.time_ns += round(1e6 * jitter)
            rig.sample.sequence += 1
        if act is not None:
            act(rig)
        rig.tick.advance(rig.sample, 1e-3 * (0.5 + draw()))
        moments.append(told(rig))
    return moments


def of_walls(rig: Rig) -> Moment:
    """What a hand feels and a record tells of a tick, but for objects."""
    tick = rig.tick
    ledger = tick.totals().ledger
    walls: list[float] = []
    for contact in tick.contacts:
        books = contact.ledger
        walls += (contact.x_m, contact.applied_n, contact.damping_n_s_per_m, contact.felt_mass_kg)
        walls += (contact.in_contact, books.cycle, books.energy_j, books.debt_j)
    return (
        *tick.force_n,
        *tick.requested_n,
        *(ledger.energy_j, ledger.stored_j, ledger.dissipated_j, ledger.generated_j),
        *(tick.flags, tick.fault, tick.guard.gain, tick.motion.dt_s),
        *walls,
    )


def of_objects(rig: Rig) -> Moment:
    """What a hand feels of objects in a tick, what the law of each direction is shown, and what is booked."""
    tick = rig.tick
    totals = tick.totals()
    moment: list[float] = [*tick.force_n, *tick.requested_n, tick.flags, tick.fault]
    for contact in tick.solids:
        channels = contact.channels[: contact.sides]
        moment += (contact.depth_m, contact.grip, contact.sides, contact.friction_stored_j, *contact.force)
        for channel in channels[:1] if contact.solid.rough else channels:  # how two lie on a surface is left to it
            shown = channel.tick
            moment += (channel.in_contact, channel.applied_n)
            if channel.in_contact:
                moment += (channel.dx, channel.dy, channel.dz, shown.x_m, shown.velocity_m_per_s, shown.dt_s)
                moment += (shown.contact_n, shown.spring_n, shown.applied_n, shown.applied_contact_n)
    return (*moment, totals.ledger.stored_j, totals.friction_stored_j)
