"""A device that knows its place anew has no past: what it does then is felt as on a tick that has just been made."""

from __future__ import annotations

import math

import pytest

from tests.tick.space.course import Moment, of_objects
from tests.tick.space.rig import Point, Rig, ball, table
from tests.tick.space.test_creases import notch

ROUGH = "static_friction = 0.5\ndynamic_friction = 0.4\n"
ROOM = table("room", "box", inside=True, size_m=(0.02, 0.02, 0.02), position_m=(0.0099, 0.0099, 0.0099))
SCENES = {
    "notch": notch(),
    "rough notch": notch(keys=ROUGH),
    "room": ROOM,
    "rough room": ROOM + ROUGH,
    "ball": ball(position_m=(0.0, 0.0, -0.03)),
    "rough ball": ball(position_m=(0.0, 0.0, -0.03)) + ROUGH,
    "wall and a ball": '[[scene.walls]]\naxis = "z"\nstiffness_n_per_m = 900.0\n' + ball(position_m=(0.02, 0.0, 0.0)),
    "rough plane and a ball": table("plane", "plane") + ROUGH + ball(position_m=(0.02, 0.0, 0.0)),
}
FREE: Point = (0.002, 0.0, 0.002)
INSIDE: Point = (-0.0004, 0.0002, -0.0007)


def swung(rig: Rig) -> Rig:
    """Into it and about there, in and out of the crease, where there is one."""
    return rig.start(FREE).to((-5e-4, 0.0, -5e-4), 30).go(*swings(60))


def swings(count: int) -> list[Point]:
    across = [2e-4 * math.sin(0.3 * n) for n in range(count)]
    return [(a - 5e-4, 2e-6 * n, -a - 5e-4) for n, a in enumerate(across)]


@pytest.mark.parametrize(
    ("name", "at"),
    [*((name, INSIDE) for name in SCENES), ("notch", FREE), ("rough room", FREE), ("rough ball", FREE)],
)
def test_a_device_that_stands_anew_is_treated_as_at_first(name: str, at: Point) -> None:
    runs: list[list[Moment]] = []
    for past in (False, True):
        rig = Rig(SCENES[name], "none")
        if past:
            swung(rig)
            rig.tick.release()
            rig.to((-5e-4, 0.0, -6e-4), 60)
        rig.start(at)
        runs.append([])
        for n in range(150):
            x, y, z = at
            rig.go((x - 1.3e-3 * math.sin(0.05 * n), y + 3e-4 * math.sin(0.17 * n), z - 3e-3 * math.sin(0.021 * n)))
            runs[-1].append(of_objects(rig))
    first, anew = runs
    for number, (one, other) in enumerate(zip(first, anew, strict=True)):
        assert other == pytest.approx(one, rel=1e-9, abs=1e-12), number
    assert any(any(moment[:3]) for moment in first)
