"""When a proxy that was pinned counts as free, and a solid that is gone while it is pinned."""

from __future__ import annotations

import math

import pytest

from tests.tick.space.rig import Point, Rig, ball, length
from tests.tick.space.test_creases import DEEP_M, notch, pressed, swings

ROUGH = "static_friction = 0.5\ndynamic_friction = 0.4\n"


def behind(radius_m: float, angle_deg: float) -> Point:
    """Behind the crease of the notch, by an angle from the floor's normal on."""
    angle = math.radians(angle_deg)
    return (-radius_m * math.sin(angle), 0.0, -radius_m * math.cos(angle))


def outward(rig: Rig) -> Point:
    """The direction of the force."""
    x, y, z = (each / length(rig.force) for each in rig.force)
    return (x, y, z)


@pytest.mark.parametrize("axis", [0, 2], ids=["on the floor", "on the wall"])
def test_it_is_free_once_it_is_a_tenth_of_a_millimetre_further_across_than_the_device_is_deep(axis: int) -> None:
    rig = pressed("none")
    rig.go(*swings(50))
    at = [-DEEP_M, 0.0, -DEEP_M]
    at[axis] = 0.0
    rig.to((at[0], at[1], at[2]), 20)
    solid = rig.tick.solids[0]
    first = solid.channels[1]
    across = abs((first.dx, first.dy, first.dz)[axis])
    while solid.grip == 1 and at[axis] < 0.002:
        at[axis] += 1e-5
        rig.go((at[0], at[1], at[2]))
    assert across * at[axis] == pytest.approx(DEEP_M + 1e-4, abs=1.2e-5)


def test_where_it_is_rough_channels_that_stayed_are_laid_anew_once_the_spring_leans_by_75_degrees() -> None:
    rig = Rig(notch(keys=ROUGH), "none").start((0.001, 0.0, 0.001))
    rig.to((0.001, 0.0, -6e-4), 20).to((0.0, 0.0, -6e-4), 40)
    normal = rig.tick.solids[0].normal
    leans_deg = []
    for angle_deg in range(1, 90):
        rig.go(behind(6e-4, angle_deg))
        leans_deg.append(angle_deg - math.degrees(math.atan2(normal.dx, normal.dz)))
    assert max(leans_deg) == pytest.approx(75.0, abs=1.1)
    assert min(leans_deg[leans_deg.index(max(leans_deg)) :]) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("pinned", [False, True], ids=["free", "pinned"])
def test_what_fades_out_stays_as_it_is(pinned: bool) -> None:
    """Pinned, it pulls where it pulled; free, away from the surface: the one becomes not the other on the way."""
    rig = pressed("none")
    if pinned:
        rig.go(*swings(50))
    solid = rig.tick.solids[0]
    before = outward(rig)
    rig.switch(ball("far", position_m=(0.5, 0.5, 0.5)))
    for at in swings(30):
        rig.go(at)
        assert solid.grip == (1 if pinned else 0)
        away = (-at[0] / length(at), 0.0, -at[2] / length(at))
        assert outward(rig) == pytest.approx(before if pinned else away, abs=1e-6)
    assert rig.unbalanced_j() < 1e-12
