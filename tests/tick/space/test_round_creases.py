"""How far a proxy has to be kept back to count as pinned: a crease that is round keeps it for a part of the way.

In a hollow edge of radius r the proxy of a device that is d behind it goes r / (r + d) of the device's way, and r / d
of what it is left behind.
"""

from __future__ import annotations

import math

import pytest

from tests.tick.space.rig import Point, Rig, length, table

RADIUS_M = 0.0003
HALF_M = 0.05
STEP = 0.02  # of the angle in a tick


class Corner:
    """A hollow corner, round by a radius, and a device that swings behind it."""

    def __init__(self, law: str = "none", radius_m: float = RADIUS_M) -> None:
        self.radius_m = radius_m
        keys = {"inside": True, "size_m": (2.0 * HALF_M,) * 3, "rounding_m": radius_m}
        self.rig = Rig(table("room", "box", 5000.0, **keys), law).start((0.049, 0.049, 0.049))
        self.solid = self.rig.tick.solids[0]

    def at(self, depth_m: float, tilt: float = 0.0, towards: float = 0.0) -> Point:
        """A point so far behind the corner, tilted off its middle by an angle towards a direction [rad]."""
        cos, sin, up = math.cos(towards), math.sin(towards), math.sqrt(1.0 / 3.0)
        across, along = (math.sqrt(0.5), -math.sqrt(0.5), 0.0), (math.sqrt(1 / 6), math.sqrt(1 / 6), -math.sqrt(2 / 3))
        way = [up + math.tan(tilt) * (cos * a + sin * b) for a, b in zip(across, along, strict=True)]
        scale = (self.radius_m + depth_m) / length(way)
        x, y, z = (HALF_M - self.radius_m + scale * each for each in way)
        return (x, y, z)

    def press(self, depth_m: float) -> Corner:
        """Straight in, or out."""
        self.rig.to(self.at(depth_m), 40)
        return self

    def swing(self, depth_m: float, towards: float = 0.0, step: float = STEP) -> int:
        """To and fro; in how many directions it is pinned then."""
        for n in (1, 2, 3, 2, 1, 0, -1, -2, -1, 0):
            self.rig.go(self.at(depth_m, n * step, towards))
        return self.solid.grip


@pytest.mark.parametrize(("ratio", "pinned"), [(0.2, True), (0.45, True), (0.55, False), (0.9, False)])
def test_it_is_pinned_where_it_goes_less_than_half_of_what_it_is_left_behind(ratio: float, pinned: bool) -> None:
    depth_m = RADIUS_M / ratio
    corner = Corner().press(depth_m)
    assert corner.swing(depth_m) == (1 if pinned else 0)
    assert corner.swing(depth_m, math.pi / 2.0) == (2 if pinned else 0)


def test_the_second_direction_is_pinned_by_the_same_measure_as_the_first() -> None:
    corner = Corner().press(RADIUS_M / 0.4)
    assert corner.swing(RADIUS_M / 0.4) == 1
    assert corner.press(RADIUS_M / 0.6).swing(RADIUS_M / 0.6, math.pi / 2.0) == 1
    assert corner.press(RADIUS_M / 0.45).swing(RADIUS_M / 0.45, math.pi / 2.0) == 2


def test_the_second_direction_is_free_once_the_proxy_goes_more_than_half_of_the_way() -> None:
    deep_m, less_m, least_m = RADIUS_M / 0.3, RADIUS_M * 6.0 / 4.0, RADIUS_M * 4.0 / 6.0
    corner = Corner().press(deep_m)
    corner.swing(deep_m)
    assert corner.swing(deep_m, math.pi / 2.0) == 2
    assert corner.press(less_m).swing(less_m, math.pi / 2.0) == 2  # it goes 0.4 of the way
    assert corner.press(least_m).swing(least_m, math.pi / 2.0) == 1  # and now 0.6 of it


@pytest.mark.parametrize(("left_m", "pinned"), [(2.5e-6, 0), (4e-6, 1)])
def test_a_proxy_that_is_left_by_two_micrometres_may_be_there_by_chance(left_m: float, pinned: int) -> None:
    corner = Corner(radius_m=0.0).press(1e-3)
    assert corner.swing(1e-3, step=left_m / 1e-3) == pinned


@pytest.mark.parametrize("base", [0.2, 1.3, 2.4, 4.1])
@pytest.mark.parametrize(("by_deg", "anew"), [(15.0, False), (165.0, False), (25.0, True), (155.0, True), (90.0, True)])
def test_laws_begin_anew_where_it_is_pinned_across_another_direction(base: float, by_deg: float, anew: bool) -> None:
    corner = Corner("energy-cycle", radius_m=0.0).press(1e-3)
    assert corner.swing(1e-3, base) == 1
    corner.rig.go(corner.at(-1e-5), corner.at(1e-3))
    assert corner.solid.grip == 0
    law = corner.solid.channels[1].law
    law.state.felt_mass_kg = 2.0
    assert corner.swing(1e-3, base + math.radians(by_deg)) == 1
    assert (law.state.felt_mass_kg == 0.0) is anew
