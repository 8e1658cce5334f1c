"""Walks over every solid, smooth and rough, with all that a proxy gives."""

from __future__ import annotations

import random
from collections.abc import Callable
from functools import partial

from hapticd.shapes.pose import Pose
from hapticd.shapes.reach import slack_m
from hapticd.shapes.solid import Placed, Proxy
from tests.recorded.hand import Hand
from tests.recorded.journal import Journal
from tests.shapes.walks import SOLIDS, go, stand

TICKS = 600
ASKEW = (0.9, 0.2, -0.1, 0.3)


def hole(orientation: tuple[float, float, float, float]) -> list[Placed]:
    """Five boxes that are flush about a pit, in whose corners a slide runs against faces that are hidden."""
    frame = Pose.of((0.0, 0.0, 0.0), orientation)
    boxes = [
        ((0.0, 0.0, -0.012), (0.05, 0.05, 0.01)),
        ((0.015, 0.0, 0.008), (0.02, 0.05, 0.03)),
        ((-0.015, 0.0, 0.008), (0.02, 0.05, 0.03)),
        ((0.0, 0.015, 0.008), (0.05, 0.02, 0.03)),
        ((0.0, -0.015, 0.008), (0.05, 0.02, 0.03)),
    ]
    return [Placed("box", Pose.of(frame.point(at_m), orientation), size_m=size_m) for at_m, size_m in boxes]


HOLE = hole((1.0, 0.0, 0.0, 0.0))
IN_THE_FLOOR = Placed("box", Pose.of((0.0, 0.0, -0.012), ASKEW), size_m=(0.002, 0.002, 0.002))
"""What is first in a union gives it its frame, in which no other face is square then."""

PLACES = SOLIDS | {"hole": HOLE, "askew hole": hole(ASKEW), "hole seen askew": [IN_THE_FLOOR, *HOLE]}
READ = ("gx", "gy", "gz", "ux", "uy", "uz", "d", "depth_m", "normal_x", "normal_y", "normal_z")
RUBBED = ("sx", "sy", "sz", "stretch_x", "stretch_y", "stretch_z", "lost_m2", "touching", "sliding")


def walk(name: str) -> Journal:
    """Two hands, one on the solid without friction, one on the rough one, which moves on the way."""
    journal = Journal()
    for rough, friction in enumerate([(0.0, 0.0), (0.8, 0.3)]):
        proxy = Proxy(PLACES[name], *friction)
        first = proxy.shapes[0].pose
        x, y, z = first.position_m
        reach_m, middle_m = (0.01, (0.0, 0.0, 0.0)) if "hole" in name else (0.024, (x, y, z))
        hand = Hand(7 + rough, 3, reach_m, middle_m)
        stand(proxy, _point(hand))
        for journal.tick in range(TICKS):
            if rough and journal.tick in (120, 160, 161, 400):
                pose = Pose.of((x + 1e-5 * journal.tick, y, z), (1.0, 0.002 * journal.tick, -0.1, 0.05))
                journal.note("moved", proxy.move(pose))
            position_m = _point(hand)
            go(proxy, position_m)
            for field in (*READ, *RUBBED) if rough else READ:
                journal.note(f"{rough} {field}", getattr(proxy, field))
            journal.note(f"{rough} slack", slack_m(proxy, *position_m))
    return journal


def jumps(name: str) -> Journal:
    """A device that is put down anywhere, inside as well, and one that jumps a long way each tick."""
    journal = Journal()
    rng = random.Random(9)
    first = PLACES[name][0].pose
    for jumping in (False, True):
        proxy = Proxy(PLACES[name], 0.5 * jumping, 0.4 * jumping)
        for journal.tick in range(300):
            x, y, z = (0.025 * (2.0 * rng.random() - 1.0) for _ in range(3))
            (go if jumping and journal.tick else stand)(proxy, first.point((x, y, z)))
            for field in (*READ, *RUBBED):
                journal.note(f"{jumping} {field}", getattr(proxy, field))
    return journal


def _point(hand: Hand) -> tuple[float, float, float]:
    x, y, z = hand.go()
    return x, y, z


WALKS: dict[str, Callable[[], Journal]] = {
    f"{what} {name}": partial(run, name) for what, run in (("walk", walk), ("jumps", jumps)) for name in PLACES
}
