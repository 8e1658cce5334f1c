"""Of objects out of reach a record has nothing: what was known of one is never told of another."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import pytest

from hapticd.config.walls import MAX_WALLS
from hapticd.telemetry.wire import Cycles, Objects, damping_map
from hapticd.tick.record import RecordLayout, TickRecord
from tests.telemetry.sockets import Wire
from tests.tick.space.rig import Rig, ball

ABOVE, INSIDE = (0.0, 0.0, 0.031), (0.0, 0.0, 0.0292)
AWAY = ball("away", position_m=(0.2, 0.0, 0.0))
_seqs = itertools.count()


def recorded(rig: Rig) -> TickRecord:
    """The last tick, as a reader of the ring finds it."""
    layout = RecordLayout(3, False, MAX_WALLS)
    layout.serve(rig.tick)
    area = memoryview(bytearray(layout.size))
    layout.pack(area, 0, rig.tick, rig.sample, next(_seqs), 0, 0.0, 0.0, 0, 0)
    return layout.unpack(area)


def touched(objects: Objects, rig: Rig) -> list[bool]:
    record = recorded(rig)
    said = damping_map(record, 0.0, objects.see(record))
    for inside, damping, mass in zip(said["in_contact"], said["damping_n_s_per_m"], said["felt_mass_kg"], strict=True):
        assert inside or damping == mass == 0.0
    return list(said["in_contact"])


def pressed_twice(scene: str) -> Rig:
    """Once let go: the ball has completed a cycle, and its law has felt a mass."""
    rig = Rig(scene).start(ABOVE)
    for at in (INSIDE, ABOVE, INSIDE):
        rig.to(at, 60)
    return rig


def test_one_that_takes_the_place_of_a_touched_one_is_not_touched() -> None:
    objects, rig = Objects(), pressed_twice(ball())
    assert touched(objects, rig) == [True]
    rig.switch(AWAY).to((0.0, 0.0, 0.05), 100)
    assert touched(objects, rig) == [False]


def test_those_that_change_places_take_what_is_known_of_them_along() -> None:
    objects, cycles, rig = Objects(), Cycles(), pressed_twice(ball() + AWAY)
    assert touched(objects, rig) == [True, False]
    assert list(cycles.completed(recorded(rig))) == [(0, 1)]
    rig.switch(AWAY + ball()).go(INSIDE)
    assert touched(objects, rig) == [False, True]
    assert list(cycles.completed(recorded(rig))) == [], "it was told at its place of before"
    rig.to(ABOVE, 60).to(INSIDE, 60)
    assert list(cycles.completed(recorded(rig))) == [(1, 2)]


def test_a_part_of_what_has_become_one_solid_is_not_touched_by_itself() -> None:
    objects, rig = Objects(), pressed_twice(AWAY + ball())
    assert touched(objects, rig) == [False, True]
    rig.switch(ball("away", position_m=(0.0, 0.0, -0.01)) + ball()).go(INSIDE)
    assert touched(objects, rig) == [True, False]


def test_a_reload_that_leaves_them_where_they_are_forgets_nothing_of_those_out_of_reach() -> None:
    objects, rig = Objects(), pressed_twice(ball() + AWAY).to((0.0, 0.0, 0.2), 100)
    record = recorded(rig)
    before = damping_map(record, 0.0, objects.see(record))
    rig.switch(ball() + ball("away", stiffness=900.0, position_m=(0.2, 0.0, 0.0))).go((0.0, 0.0, 0.2))
    record = recorded(rig)
    assert damping_map(record, 0.0, objects.see(record))["felt_mass_kg"] == before["felt_mass_kg"]


@pytest.fixture
def wire() -> Iterator[Wire]:
    with Wire() as wire:
        yield wire


def test_what_was_touched_when_the_device_was_lost_is_not_once_it_is_back(wire: Wire) -> None:
    subscriber = wire.subscribe("hapticd/damping")
    publisher = wire.publisher
    publisher.publish([recorded(pressed_twice(ball()))])
    publisher.take_loop()
    publisher.publish([recorded(Rig(ball()).start((0.0, 0.0, 0.2)).go((0.0, 0.0, 0.2)))])
    publisher.flush(1 << 62)
    assert [fields["in_contact"] for fields in subscriber.until("hapticd/damping", 2)] == [[True], [False]]
