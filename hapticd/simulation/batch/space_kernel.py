"""One run in space from tick to tick, as machine code takes it.

The order of `SpatialDevice.advance`, `Motion.see`, `SpaceTick.step_in_space` and `Nearby.look`, for a device of three
axes, objects alone and an armed guard; what they call is compiled from their own source.
tests/simulation/test_space_batch.py holds every object that a run leaves against the daemon's.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from hapticd.shapes.reach import slack_m
from hapticd.simulation.options import FARTHEST_M
from hapticd.simulation.plant import move, sense
from hapticd.simulation.space.coupled import place_of, swing
from hapticd.tick.motion import MOST_M_PER_S
from hapticd.tick.velocity import Difference

difference: Callable[..., float] = Difference.update

TRACE_COLUMNS = (
    *("x_m", "y_m", "z_m"),
    *("vx_m_per_s", "vy_m_per_s", "vz_m_per_s"),
    *("x_measured_m", "y_measured_m", "z_measured_m"),
    *("fx_n", "fy_n", "fz_n"),
    *("fx_requested_n", "fy_requested_n", "fz_requested_n"),
    "energy_j",
)
"""True position and velocity, position as measured, force applied and asked for, energy into all objects."""


class SpaceLoop:
    """What a run remembers beside its objects.

    Attributes:
        ticks: periods of the device that are done.
        stop: how many there are to be.
        dt_s: time between two samples [s].
        at_x, at_y, at_z: where the device was at the last sample [m].
        estimators: of the velocity along each axis.
        nearby: where the device may be before another object comes into reach.
        coupled: whether the axes share a mass matrix.
        step_m: distance of the places at which there is one [m].
        places_x, places_y, places_z: how many there are along each axis.
    """

    __slots__ = (
        *("at_x", "at_y", "at_z", "coupled", "dt_s", "estimators", "nearby"),
        *("places_x", "places_y", "places_z", "step_m", "stop", "ticks"),
    )

    ticks: int
    stop: int
    dt_s: float
    at_x: float
    at_y: float
    at_z: float
    estimators: list[Any]
    nearby: Any
    coupled: bool
    step_m: float
    places_x: int
    places_y: int
    places_z: int


class SpaceDevice(NamedTuple):
    """The simulated device."""

    plants: Any  # fields of `PlantState`, by axis
    params: Any  # fields of `PlantParams`, by axis
    buffers: Any  # `Buffers`, by axis
    table: Any  # mass matrices of all places, where the axes share one
    springs: Any  # stiffness of the hand, by axis, where the axes share a mass matrix [N/m]


class SpaceContacts(NamedTuple):
    """The solids and which of them the tick goes through."""

    contacts: Any  # fields of `SolidContact`, by solid
    awake: Any  # by solid whether the device may touch it
    held: Any  # by solid whether a tick without news holds its force


class SpaceVectors(NamedTuple):
    """What the tick leaves to be seen, by axis."""

    position_m: Any
    velocity_m_per_s: Any
    force_n: Any
    requested_n: Any


def run(loops: Any, guards: Any, device: SpaceDevice, solids: SpaceContacts, vectors: SpaceVectors, trace: Any) -> bool:
    """A run from where it is to its last tick.

    Args:
        loops: the one `SpaceLoop`.
        guards: the one guard.
        device: where it is.
        solids: the same of what it touches.
        vectors: the same of what is seen of the tick.
        trace: room for `TRACE_COLUMNS`, (ticks, columns).

    Returns:
        False where it left all bounds, as the daemon would have stopped it.
    """
    loop = loops[0]
    guard = guards[0]
    plants, params, buffers, table, springs = device
    contacts, awake, held = solids
    position_m, velocity_m_per_s, force_n, requested_n = vectors
    count = len(contacts)
    dt_s = loop.dt_s
    while loop.ticks < loop.stop:
        for axis in range(3):
            move(plants[axis], params[axis], buffers[axis], force_n[axis])
        if loop.coupled:
            at = place_of(
                plants[0].x_m,
                plants[1].x_m,
                plants[2].x_m,
                loop.step_m,
                loop.places_x,
                loop.places_y,
                loop.places_z,
            )
            swing(plants[0], plants[1], plants[2], table, at, springs)
        for axis in range(3):
            sense(plants[axis], params[axis])
        loop.ticks += 1

        # position and velocity
        for axis in range(3):
            x_m = plants[axis].measured_m
            if not (-FARTHEST_M < x_m < FARTHEST_M):
                return False
            position_m[axis] = x_m
            velocity_m_per_s[axis] = difference(loop.estimators[axis], x_m, dt_s, 0.0)
            if not (-MOST_M_PER_S < velocity_m_per_s[axis] < MOST_M_PER_S):
                return False
            force_n[axis] = 0.0
        x = position_m[0]
        y = position_m[1]
        z = position_m[2]
        way = (x - loop.at_x, y - loop.at_y, z - loop.at_z)
        loop.at_x = x
        loop.at_y = y
        loop.at_z = z
        velocity = (velocity_m_per_s[0], velocity_m_per_s[1], velocity_m_per_s[2])

        # contacts and laws
        if loop.nearby.moved_out(x, y, z):
            look_around(loop.nearby, contacts, awake, held, x, y, z)
        for at in range(count):
            held[at] = awake[at] and contacts[at].observe((x, y, z), velocity, way, dt_s)
        for at in range(count):
            if held[at]:
                contacts[at].act(1.0)
        for at in range(count):
            if held[at]:
                contacts[at].add(force_n)
        for axis in range(3):  # no blend is under way
            requested_n[axis] = force_n[axis]

        # limit and books
        share = guard.reduce(force_n, dt_s)
        if guard.latched:
            return False
        for at in range(count):
            if held[at]:
                contacts[at].settle(share, guard.gain, guard.limit_n, dt_s)
        record(plants, contacts, force_n, requested_n, trace, loop.ticks - 1)
    return True


def look_around(nearby: Any, contacts: Any, awake: Any, held: Any, x: float, y: float, z: float) -> None:
    """Find out which solids are in reach; one that comes into reach is begun with."""
    least_m = 1e3
    for at in range(len(contacts)):
        contact = contacts[at]
        proxy = contact.solid.proxy
        free_m = slack_m(proxy, x, y, z)
        near = free_m <= proxy.margin_m or proxy.touching
        if not near and free_m < least_m:
            least_m = free_m
        if near or not contact.quiet:
            if not awake[at] and contact.quiet:
                contact.start(x, y, z)
            awake[at] = True
        else:
            awake[at] = False
            held[at] = False
    nearby.stay(x, y, z, least_m)


def record(plants: Any, contacts: Any, force_n: Any, requested_n: Any, trace: Any, row: int) -> None:
    """Enter one tick into the trace."""
    if row >= len(trace):
        return
    energy_j = 0.0
    for at in range(len(contacts)):
        energy_j += contacts[at].ledger.energy_j
    for axis in range(3):
        trace[row, axis] = plants[axis].x_m
        trace[row, 3 + axis] = plants[axis].v_m_per_s
        trace[row, 6 + axis] = plants[axis].measured_m
        trace[row, 9 + axis] = force_n[axis]
        trace[row, 12 + axis] = requested_n[axis]
    trace[row, 15] = energy_j
