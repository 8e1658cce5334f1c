"""Objects that overlap and are alike are one solid: a record tells which carries the force, and which are met."""

from __future__ import annotations

import pytest

from hapticd.config.walls import MAX_WALLS
from hapticd.tick.contact_record import ObjectRecord
from hapticd.tick.record import RecordLayout
from tests.tick.space.rig import Point, Rig, ball, table

SCENE = (
    ball("far", 4000.0, position_m=(0.2, 0.0, 0.0))
    + table("table", "plane")
    + ball("ball", radius_m=0.012)
    + table("post", "cylinder", radius_m=0.005, length_m=0.04, position_m=(0.05, 0.0, 0.01), orientation=(1, 0, 0, 0))
)
FAR, TABLE, BALL, POST = range(4)


def recorded(rig: Rig) -> ObjectRecord:
    """The one object that is touched."""
    (touched,) = near(rig)
    return touched


def near(rig: Rig) -> list[ObjectRecord]:
    """The objects that are touched, as a reader of the ring finds them."""
    layout = RecordLayout(3, False, MAX_WALLS)
    layout.serve(rig.tick)
    area = memoryview(bytearray(layout.size))
    layout.pack(area, 0, rig.tick, rig.sample, 7, 0, 0.0, 0.0, 0, 0)
    space = layout.unpack(area).space
    assert space is not None
    return [one for one in space.near if one.contact.in_contact]


def pressed(*points: Point) -> ObjectRecord:
    rig = Rig(SCENE).start(points[0])
    for at in points[1:]:
        rig.to(at, 40)
    return recorded(rig)


def test_on_the_ball_the_ball_carries() -> None:
    one = pressed((0.0, 0.0, 0.014), (0.0, 0.0, 0.0115))
    assert (one.index, one.carrier, one.inside) == (TABLE, BALL, (BALL,))


def test_beside_it_the_table_does() -> None:
    one = pressed((0.03, 0.0, 0.002), (0.03, 0.0, -0.0005))
    assert (one.index, one.carrier, one.inside) == (TABLE, TABLE, (TABLE,))


def test_a_device_may_be_in_two_of_them_while_one_carries() -> None:
    one = pressed((0.0, 0.0, 0.014), (0.0, 0.0, -0.001))
    assert (one.carrier, one.inside) == (BALL, (TABLE, BALL))


def test_a_shape_with_a_place_of_its_own_is_seen_where_it_is() -> None:
    one = pressed((0.05, 0.0, 0.032), (0.05, 0.0, 0.0295))
    assert (one.carrier, one.inside) == (POST, (POST,))


def test_an_object_by_itself_carries_its_own_force() -> None:
    one = pressed((0.2, 0.0, 0.031), (0.2, 0.0, 0.0299))
    assert (one.index, one.carrier, one.inside) == (FAR, FAR, (FAR,))


def test_a_scene_in_another_order_keeps_their_numbers() -> None:
    rig = Rig(SCENE).start((0.0, 0.0, 0.014)).to((0.0, 0.0, 0.0115), 40)
    rig.switch(SCENE + ball("new", 3000.0, position_m=(-0.2, 0.0, 0.0))).to((0.0, 0.0, 0.0114), 5)
    assert recorded(rig).carrier == BALL
    rig.switch(ball("new", 3000.0, position_m=(-0.2, 0.0, 0.0)) + SCENE).to((0.0, 0.0, 0.0115), 5)
    one = recorded(rig)
    assert (one.index, one.carrier, one.inside) == (TABLE + 1, BALL + 1, (BALL + 1,))


def test_in_the_seam_of_two_the_first_carries_and_on_a_face_the_device_is_in_neither() -> None:
    floor = table("floor", "box", size_m=(0.125, 0.125, 0.03125), position_m=(0.0, 0.0, -0.015625))
    wall = table("wall", "box", size_m=(0.03125, 0.125, 0.125), position_m=(-0.015625, 0.0, 0.0))
    step_m = 0.0009765625  # of numbers that have no rounding
    for scene in (floor + wall, wall + floor):
        solid = Rig(scene).start((step_m, step_m, step_m)).to((-step_m, 0.0, -step_m), 2).tick.solids[0].solid
        assert solid.shares(-step_m, 0.0, -step_m) == (0, 0b11)
    assert solid.shares(step_m, 0.0, 0.0)[1] == 0
    assert solid.shares(step_m, 0.0, -1e-9)[1] == 0b10


def test_a_reader_looks_anew_at_who_is_who_only_where_one_came_went_or_changed_places() -> None:
    first, second = ball("first", 4000.0), ball("second", 3000.0, position_m=(0.2, 0.0, 0.0))
    rig = Rig(first + second)
    listings = [rig.tick.listing]
    for scene in (first + second, ball("first", 5000.0) + second, second + first, first, first + second):
        listings.append(rig.switch(scene).tick.listing)
    assert listings == [0, 0, 0, 1, 2, 3]


@pytest.mark.parametrize("remote", [False, True], ids=["still", "remote"])
def test_what_fades_out_of_an_object_after_a_reload_is_its_force_too(remote: bool) -> None:
    """It was said to push with 0 N where the hand felt 3 N."""
    before = ball("ball", 3000.0, static_friction=0.5, dynamic_friction=0.4, remote=remote)
    other = ball("other", 500.0, position_m=(0.002, 0.0, 0.0))
    at = (0.0004, 0.0, 0.029)
    rig = Rig(before + other, "none").start((0.0, 0.0, 0.031)).to((0.0, 0.0, 0.029), 100).to(at, 100)
    rig.switch(before.replace("0.5", "0.7") + other)
    for _ in range(60):
        rig.go(at)
        each = near(rig)
        assert [one.index for one in each] == [0, 1]
        assert [sum(of) for of in zip(*(one.force_n for one in each), strict=True)] == pytest.approx(rig.force)
        assert each[0].force_n[2] > 2.8


def test_an_object_that_comes_back_has_what_was_left_of_it() -> None:
    rig = Rig(ball("ball") + ball("far", position_m=(0.2, 0.0, 0.0)), "none").start((0.0, 0.0, 0.031))
    rig.to((0.0, 0.0, 0.029), 100).switch(ball("far", position_m=(0.2, 0.0, 0.0))).to((0.0, 0.0, 0.029), 5)
    assert not near(rig), "of one that is gone nothing is told"
    rig.switch(ball("ball") + ball("far", position_m=(0.2, 0.0, 0.0))).go((0.0, 0.0, 0.029))
    assert recorded(rig).force_n == pytest.approx(rig.force)
    assert rig.force[2] > 4.0


def test_what_fades_out_takes_no_place_of_an_object_that_is_touched() -> None:
    """A record has eight: those that faded out came first in them, and of eight that were reloaded none was told."""

    def eight(more: float) -> str:
        return "".join(ball(f"ball {at}", 100.0 + at + more) for at in range(8))

    rig = Rig(eight(0.0), "none").start((0.0, 0.0, 0.031)).to((0.0, 0.0, 0.029), 100)
    assert [one.index for one in near(rig)] == list(range(8))
    rig.switch(eight(10.0)).go((0.0, 0.0, 0.029))
    assert [one.index for one in near(rig)] == list(range(8))
