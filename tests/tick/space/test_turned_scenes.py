"""Space has no axes: a scene that is turned, with the way of the device, gives the same force, turned."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest

from hapticd.shapes.pose import Pose
from tests.recorded.hand import Hand
from tests.tick.space.rig import Point, Rig, apart, table
from tests.tick.space.test_standing_anew import swings

STRAIGHT = (1.0, 0.0, 0.0, 0.0)
TURNED = (0.8, 0.3, -0.4, 0.5)
ROUGH = {"static_friction": 0.5, "dynamic_friction": 0.4}
Thing = tuple[str, dict[str, Any]]
NOTCH: list[Thing] = [
    ("box", {"size_m": (0.1, 0.1, 0.04), "position_m": (0.0, 0.0, -0.02)}),
    ("box", {"size_m": (0.04, 0.1, 0.1), "position_m": (-0.02, 0.0, 0.0)}),
]
ROOM: list[Thing] = [("box", {"inside": True, "size_m": (0.02, 0.02, 0.02), "position_m": (0.0095, 0.0095, 0.0095)})]
BODIES: list[Thing] = [
    ("capsule", {"radius_m": 0.006, "length_m": 0.01, "position_m": (0.0, 0.006, -0.006)}),
    ("box", {"size_m": (0.01, 0.014, 0.01), "rounding_m": 0.002, "position_m": (-0.008, -0.01, 0.0)}),
]
SCENES: dict[str, tuple[list[Thing], dict[str, Any]]] = {
    "notch": (NOTCH, {}),
    "rough notch": (NOTCH, ROUGH),
    "room": (ROOM, {}),
    "rough room": (ROOM, ROUGH),
    "rough bodies": (BODIES, ROUGH),
}
START: Point = (0.001, 0.001, 0.001)


def turned(things: list[Thing], keys: dict[str, Any], turn: tuple[float, ...]) -> str:
    """The scene, each thing at its place."""
    text = ""
    for number, (shape, own) in enumerate(things):
        made = {**own, **keys, "damping_n_s_per_m": 1.0}
        made |= {"position_m": Pose.of((0.0, 0.0, 0.0), turn).point(own["position_m"]), "orientation": turn}
        text += table(f"thing {number}", shape, 3000.0, **made)
    return text


def way() -> list[Point]:
    """From free room into the crease, to and fro across it and along it, and about."""
    hand = Hand(6, 3, 0.004)
    points = [START, *swings(80)]
    points += [(-4e-4 + a, -4e-4 - a, -5e-4) for a in (2e-4 * math.sin(0.4 * n) for n in range(60))]
    points += [(x, y, z) for x, y, z in (hand.go() for _ in range(120))]
    slow: list[Point] = []
    for of, to in pairwise(points):
        steps = 1 + int(apart(of, to) / 1e-4)
        places = [between(of, to, (n + 1) / steps) for n in range(steps)]
        slow += [(x - 1.7e-6, y + 2.3e-6, z - 3.1e-6) for x, y, z in places]  # on no face exactly, nor both at once
    return slow


def between(of: Point, to: Point, share: float) -> Point:
    x, y, z = (a + share * (b - a) for a, b in zip(of, to, strict=True))
    return (x, y, z)


@pytest.mark.parametrize("name", SCENES)
def test_a_turned_scene_is_felt_the_same_but_turned(name: str) -> None:
    pose = Pose.of((0.0, 0.0, 0.0), TURNED)
    things, keys = SCENES[name]
    straight = Rig(turned(things, keys, STRAIGHT), "damper").start(START)
    other = Rig(turned(things, keys, TURNED), "damper").start(pose.point(START))
    touched = 0
    for number, at in enumerate(way()):
        straight.go(at)
        other.go(pose.point(at))
        assert other.force == pytest.approx(pose.point(straight.force), abs=0.03 if not keys else 0.1), (number, at)
        touched += any(straight.force)
        for one, two in zip(straight.tick.solids, other.tick.solids, strict=True):
            assert keys or (two.grip, two.sides) == (one.grip, one.sides)
            assert two.depth_m == pytest.approx(one.depth_m, abs=3e-6)
    assert touched > 100
    books, turned_books = straight.totals, other.totals
    assert turned_books.ledger.generated_j == pytest.approx(books.ledger.generated_j, rel=0.03)
    assert turned_books.ledger.dissipated_j == pytest.approx(books.ledger.dissipated_j, rel=0.03)
    assert turned_books.friction_j == pytest.approx(books.friction_j, rel=0.03, abs=1e-9)
