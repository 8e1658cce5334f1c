"""A wall that stands on a floor holds on its own side, thin as it is, however deep the device is pressed beside it."""

from __future__ import annotations

import pytest

from hapticd.shapes.pose import Pose
from hapticd.shapes.solid import Placed, Proxy
from tests.shapes.walks import Point, go, norm, spring, stand

FACE_M = 0.002
"""Of the wall, from its middle; the floor ends at z = 0."""

FLOOR = Placed("box", Pose.of((0.0, 0.0, -0.007)), size_m=(0.03, 0.03, 0.014))
WALL = Placed("box", Pose.of((0.0, 0.0, 0.002)), size_m=(0.03, 2.0 * FACE_M, 0.024))
OUTSIDE: Point = (0.0, -0.008, 0.006)
DEEP: Point = (0.0, 0.008, -0.006)
ALONG: Point = (0.008, 0.008, -0.006)


def towards(start: Point, end: Point, ticks: int) -> list[Point]:
    """A point a tick."""
    (x, y, z), (u, v, w) = start, end
    shares = [(tick + 1) / ticks for tick in range(ticks)]
    return [(x + share * (u - x), y + share * (v - y), z + share * (w - z)) for share in shares]


@pytest.mark.parametrize("friction", [(0.0, 0.0), (0.8, 0.3)])
@pytest.mark.parametrize("ticks", [10, 200])
@pytest.mark.parametrize("shapes", [[FLOOR, WALL], [WALL, FLOOR]], ids=["floor first", "wall first"])
def test_no_press_comes_out_on_the_other_side(shapes: list[Placed], ticks: int, friction: tuple[float, float]) -> None:
    """Past its middle, and past its back: the nearest surface there is that of the other side."""
    proxy = Proxy(shapes, *friction)
    stand(proxy, OUTSIDE)
    deepest_m = 0.0
    for at in towards(OUTSIDE, DEEP, ticks):
        go(proxy, at)
        _, y, z = spring(proxy)
        assert y <= 1e-6
        assert z >= -1e-6 or friction[0] > 0.0
        assert norm(spring(proxy)) >= deepest_m - 1e-6
        deepest_m = norm(spring(proxy))
    for at in towards(DEEP, ALONG, ticks):
        go(proxy, at)
        assert spring(proxy)[1] < 0.0
    if friction[0] == 0.0:
        assert spring(proxy) == pytest.approx((0.0, -FACE_M - DEEP[1], -DEEP[2]), abs=1e-5)
    for at in towards(ALONG, OUTSIDE, ticks):
        go(proxy, at)
    assert spring(proxy) == (0.0, 0.0, 0.0)
