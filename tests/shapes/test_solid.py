"""Solids: sizes that are refused, shapes that overlap, solids that move, and what is out of reach."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticd.errors import ConfigError
from hapticd.shapes.pose import Pose
from hapticd.shapes.reach import Nearby, slack_m
from hapticd.shapes.solid import Placed, Proxy, group
from hapticd.shapes.surface import distance
from hapticd.tick.space.solid import at_once
from tests.shapes.walks import ASKEW, CONVEX, FIELDS, HERE, SOLIDS, UNIONS, Point, go, minus, norm, spring, stand, walk

numbers = st.floats(-0.2, 0.2, allow_subnormal=False)
points = st.tuples(numbers, numbers, numbers)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"shape": "sphere"}, "radius_m = 0.0: a sphere must have a size above 0"),
        ({"shape": "sphere", "radius_m": float("nan")}, "radius_m = nan: a sphere must have a size above 0"),
        ({"shape": "box", "size_m": (0.1, 0.0, 0.1)}, "a box must have a size above 0"),
        ({"shape": "capsule", "radius_m": 0.1}, "length_m = 0.0: a capsule must have a size above 0"),
        ({"shape": "plane", "radius_m": 0.1}, "radius_m = 0.1: a plane has none"),
        ({"shape": "sphere", "radius_m": 0.1, "rounding_m": 0.01}, "rounding_m = 0.01: a sphere has no edges to round"),
        ({"shape": "box", "size_m": (0.1, 0.02, 0.1), "rounding_m": 0.011}, "must be from 0 to 0.01, half the least"),
        ({"shape": "cone"}, 'shape = "cone": is none of plane, sphere, box, capsule, cylinder, mesh'),
    ],
)
def test_a_shape_of_no_possible_size_is_one_clear_line(keys: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError) as error:
        Placed(pose=HERE, **keys)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("orientation", [(0.0, 0.0, 0.0, 0.0), (1.0, float("nan"), 0.0, 0.0), (1.0, 0.0, 0.0)])
def test_a_quaternion_that_is_none_is_refused(orientation: tuple[float, ...]) -> None:
    with pytest.raises(ConfigError, match="orientation = "):
        Pose.of((0.0, 0.0, 0.0), orientation)


def ball(x: float, **keys: Any) -> Placed:
    return Placed("sphere", Pose.of((x, 0.0, 0.0)), radius_m=0.01, **keys)


def test_shapes_that_overlap_and_are_alike_are_one_solid() -> None:
    shapes = [ball(0.0), ball(0.05), ball(0.015), ball(0.065), ball(0.0325)]
    assert [sorted(each) for each in at_once(group(shapes, ["a"] * 5))] == [[0, 1, 2, 3, 4]]
    assert at_once(group(shapes, ["a", "a", "b", "a", "a"])) == [[0], [1, 3, 4], [2]]
    assert at_once(group([ball(0.0), ball(0.021)], ["a", "a"])) == [[0], [1]]


def test_a_ball_that_hovers_over_a_table_is_one_by_itself_and_one_that_sinks_in_is_not() -> None:
    table = Placed("plane", HERE)
    over = Placed("sphere", Pose.of((0.0, 0.0, 0.0101)), radius_m=0.01)
    into = Placed("sphere", Pose.of((0.0, 0.0, 0.0099)), radius_m=0.01)
    assert at_once(group([table, over], ["a", "a"])) == [[0], [1]]
    assert at_once(group([table, into], ["a", "a"])) == [[0, 1]]


def test_a_seam_of_two_flush_boxes_is_not_felt() -> None:
    """Each with a proxy of its own would push sideways from under the surface, and twice where they overlap."""
    proxy = Proxy(UNIONS["flush boxes"])
    stand(proxy, (-0.01, 0.0, 0.011))
    for at in range(300):
        go(proxy, (-0.01 + 1e-4 * at, 0.0, 0.0085))
        assert spring(proxy) == pytest.approx((0.0, 0.0, 0.0015), abs=1e-12)


def test_a_corner_of_two_boxes_pushes_both_ways_and_no_harder() -> None:
    proxy = Proxy(UNIONS["corner"])
    for at in range(101):  # floor at 5 mm, wall from y = 15 mm on, in the frame of the first one
        own = (0.0, 0.012 + 4e-5 * at, 0.006 - 2e-5 * at)
        (stand if at == 0 else go)(proxy, ASKEW.point(own))
    assert proxy.shapes[0].pose.own(tuple(a + b for a, b in zip(ASKEW.position_m, spring(proxy), strict=True))) == (
        pytest.approx((0.0, -0.001, 0.001), abs=1e-9)
    )


@pytest.mark.parametrize("seed", [4, 12, 24, 45])
@pytest.mark.parametrize("pose", [HERE, ASKEW], ids=["upright", "askew"])
def test_the_notch_of_two_flush_boxes_lets_no_proxy_in_between_them(pose: Pose, seed: int) -> None:
    """One box stands on the other, half over its edge: where their faces lie against each other is no surface.

    Two or three micrometres in between them the goal was stuck, and held the hand back along the notch.
    """
    size = (0.08, 0.08, 0.08)
    boxes = [
        Placed("box", Pose(pose.point(at), pose.rotation), size_m=size)
        for at in ((0.0, 0.0, -0.04), (-0.04, 0.0, 0.04))
    ]
    proxy = Proxy(boxes)
    stand(proxy, pose.point((0.001, 0.0, 0.001)))
    draw = random.Random(seed)
    x = z = 0.001
    y = 0.0
    for _ in range(600):
        x = min(max(x + draw.gauss(0.0, 4e-4), -0.003), 0.002)
        z = min(max(z + draw.gauss(0.0, 4e-4), -0.003), 0.002)
        y = 0.5 * y + draw.gauss(0.0, 2e-4)
        go(proxy, pose.point((x, y, z)))
        free = pose.out((max(-x, 0.0), 0.0, max(-z, 0.0)))
        assert spring(proxy) == pytest.approx(free, abs=1e-5)


def test_a_stroke_along_a_valley_is_followed_at_once() -> None:
    """Two planes lean on each other; pressed into both, the nearest free point is on the crease, right at hand."""
    proxy = Proxy(UNIONS["valley"])
    leaning = UNIONS["valley"][1].pose.out((0.0, 0.0, 1.0))
    stand(proxy, (0.005, 0.0, 0.01))
    for at in range(100):
        deep = 2e-5 * min(at, 50)
        goal = (0.0, 3e-4 * at, 0.0)
        p = (-deep * leaning[0], goal[1], -deep - deep * leaning[2])
        go(proxy, p)
        if at > 0:
            assert minus(goal, p) == pytest.approx(spring(proxy), abs=1e-6)


@pytest.mark.parametrize("name", UNIONS)
@given(p=points)
def test_a_union_is_as_far_away_as_its_nearest_shape(name: str, p: Point) -> None:
    shapes = UNIONS[name]
    proxy = Proxy(shapes)
    each = [
        distance(one, one.others, one.voxels, *shape.pose.own(p))[0] for shape in shapes for one in (Proxy([shape]),)
    ]
    d, *n = distance(proxy, proxy.others, proxy.voxels, *shapes[0].pose.own(p))
    assert d == pytest.approx(min(each), abs=1e-15)
    assert norm((n[0], n[1], n[2])) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("name", SOLIDS)
@given(p=points)
def test_what_is_out_of_reach_is_farther_away_than_the_margin(name: str, p: Point) -> None:
    proxy = Proxy(SOLIDS[name], margin_m=0.004)
    x, y, z = p
    value = proxy.reach_x * x + proxy.reach_y * y + proxy.reach_z * z + proxy.reach_w * (x * x + y * y + z * z)
    d, *_ = distance(proxy, proxy.others, proxy.voxels, *proxy.shapes[0].pose.own(p))
    if value > proxy.reach_limit:
        assert d > 0.004 - 1e-12
    free_m = slack_m(proxy, x, y, z)
    if free_m > 0.0 and name not in FIELDS:  # a field says less of what is far away
        assert free_m <= d - 0.004 + 1e-12


@settings(deadline=None)
@given(seed=st.integers(0, 2**32), step=st.floats(1e-3, 4e-3))
def test_a_solid_comes_into_the_list_before_it_can_be_touched(seed: int, step: float) -> None:
    rng = random.Random(seed)
    proxies = [
        Proxy([Placed("sphere", Pose.of([rng.uniform(-0.1, 0.1) for _ in range(3)]), radius_m=rng.uniform(1e-3, 0.02))])
        for _ in range(16)
    ]
    nearby = Nearby(proxies)
    aim = [rng.gauss(0.0, 1.0) for _ in range(3)]
    size = math.hypot(*aim)
    found: list[int] = []
    looks = 0
    for at in range(round(0.3 / step)):
        p = [(step * at - 0.15) * each / size + 0.01 for each in aim]
        if nearby.moved_out(*p):
            found = nearby.look(*p)
            looks += 1
        for index, proxy in enumerate(proxies):
            if distance(proxy, (), (), *proxy.shapes[0].pose.own(p))[0] < 0.9 * proxy.margin_m:
                assert index in found
    assert looks > 0


def test_a_device_that_stays_where_it_is_looks_once() -> None:
    nearby = Nearby([Proxy([ball(0.05 * at)]) for at in range(64)])
    assert nearby.moved_out(0.0, 0.0, 0.011)
    assert nearby.look(0.0, 0.0, 0.011) == [0]
    assert not any(nearby.moved_out(0.0, 0.0, 0.011 + 1e-5 * at) for at in range(500))
    nearby.reset()
    assert nearby.moved_out(0.0, 0.0, 0.011)


@pytest.mark.parametrize("name", ["plane", "rounded box", "sphere", "cavity", "corner"])
@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_a_solid_that_moves_with_the_hand_feels_as_one_at_rest(name: str, seed: int) -> None:
    rng = random.Random(seed)
    shapes = SOLIDS[name]
    still, moving = Proxy(shapes, 0.5, 0.4), Proxy(shapes, 0.5, 0.4)
    home = shapes[0].pose
    pose = home
    for at, now in enumerate(walk(still, seed, 150)):
        own = home.own(now.p)
        if at == 0:
            stand(still, now.p)
            stand(moving, now.p)
            continue
        if at % 3 == 0:
            before = pose
            drift = [each + rng.gauss(0.0, 1e-3) for each in pose.position_m]
            pose = Pose.of(drift, [rng.gauss(0.0, 1.0) for _ in range(4)])
            touched = (moving.sx, moving.sy, moving.sz)
            way = moving.move(pose)
            expected = minus(pose.point(touched), before.point(touched)) if moving.touching else (0.0, 0.0, 0.0)
            assert way == pytest.approx(expected, abs=1e-12)
        go(moving, pose.point(own))
        assert moving.pose == pose
        assert moving.touching == still.touching
        assert spring(moving) == pytest.approx(pose.out(_own(home, spring(still))), abs=1e-9)


def _own(pose: Pose, direction: Point) -> Point:
    x, y, z = pose.position_m
    return pose.own((direction[0] + x, direction[1] + y, direction[2] + z))


def test_a_wall_that_comes_fast_meets_a_device_that_stands() -> None:
    """10 mm in a tick: the device is behind the plate then, and still held by the side that met it."""
    proxy = Proxy([Placed("box", Pose.of((0.0, 0.0, -0.02)), size_m=(0.06, 0.06, 0.001))])
    stand(proxy, (0.0, 0.0, 0.0))
    for z in (-0.01, -0.002):
        proxy.move(Pose.of((0.0, 0.0, z)))
        go(proxy, (0.0, 0.0, 0.0))
        assert not proxy.touching
    proxy.move(Pose.of((0.0, 0.0, 0.008)))
    go(proxy, (0.0, 0.0, 0.0))
    assert spring(proxy) == pytest.approx((0.0, 0.0, 0.0085), abs=1e-12)


def test_a_device_that_starts_in_a_solid_is_on_its_nearest_face() -> None:
    proxy = Proxy([CONVEX["plate"]])
    stand(proxy, (0.01, 0.0, -0.0001))
    assert spring(proxy) == pytest.approx((0.0, 0.0, -0.0004), abs=1e-15)
