"""In a notch between shapes, however acute, a device that begins in it is held by a surface that is near.

Held against straight ways out of it in hundreds of directions, the shortest refined: slow, and with nothing in common.
"""

from __future__ import annotations

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.shapes.pose import Pose
from hapticd.shapes.proxy import place
from hapticd.shapes.scalars import PROXY_KINDS
from hapticd.shapes.solid import Placed, Proxy
from hapticd.shapes.surface import SURFACE_M, distance
from tests.examples import examples
from tests.shapes.test_compiled_shapes import compiled, records, voxels_of
from tests.shapes.walks import HERE, TORUS, Point, dot, go, norm, spring, stand

FLAT = ("plane", "box")
ROUND = ("plane", "box", "sphere", "cylinder", "capsule", "mesh")
DEEP_M = {"plane": 0.0, "box": 0.02, "sphere": 0.03, "cylinder": 0.01, "capsule": 0.01, "mesh": 0.006}

seeds = st.integers(0, 2**32)
openings = st.floats(10.0, 170.0)
faces = st.sampled_from([2, 3])


def unit(rng: random.Random) -> Point:
    x, y, z = (rng.gauss(0.0, 1.0) for _ in range(3))
    size = norm((x, y, z))
    return x / size, y / size, z / size


def along(n: Point, rng: random.Random) -> tuple[Point, Point, Point]:
    """A random rotation, row by row, that takes z to a unit vector."""
    a = unit(rng)
    x = tuple(a[i] - dot(a, n) * n[i] for i in range(3))
    x = tuple(each / math.hypot(*x) for each in x)
    y = (n[1] * x[2] - n[2] * x[1], n[2] * x[0] - n[0] * x[2], n[0] * x[1] - n[1] * x[0])
    return (x[0], y[0], n[0]), (x[1], y[1], n[1]), (x[2], y[2], n[2])


def turned(row: Point) -> Point:
    """A row of a rotation that takes z to where x went."""
    return row[1], row[2], row[0]


def placed(kind: str, n: Point, rng: random.Random) -> Placed:
    """A shape whose surface goes through the origin and faces along a unit vector there."""
    deep_m = DEEP_M[kind]
    first, second, third = rows = along(n, rng)
    if kind == "capsule":  # which lies along z
        rows = turned(first), turned(second), turned(third)
    pose = Pose((-deep_m * n[0], -deep_m * n[1], -deep_m * n[2]), rows)
    match kind:
        case "box":
            return Placed(kind, pose, size_m=(0.1, 0.08, 2.0 * deep_m))
        case "sphere":
            return Placed(kind, pose, radius_m=deep_m)
        case "cylinder":
            return Placed(kind, pose, radius_m=0.05, length_m=2.0 * deep_m)
        case "capsule":
            return Placed(kind, pose, radius_m=deep_m, length_m=0.06)
        case "mesh":  # a ring: its upper side
            at = pose.point((0.015, 0.0, 0.0))
            x, y, z = (2.0 * p - q for p, q in zip(pose.position_m, at, strict=True))
            return Placed(kind, Pose((x, y, z), rows), field=TORUS)
    return Placed(kind, pose)


def notch(count: int, opening_deg: float, kinds: tuple[str, ...], rng: random.Random) -> Proxy:
    """Shapes whose surfaces meet in the origin, evenly about an axis, and open by an angle."""
    rows = along(unit(rng), rng)
    lean = math.radians(90.0 - 0.5 * opening_deg)
    shapes = []
    for at in range(count):
        turn = math.tau * at / count
        own = (math.sin(lean) * math.cos(turn), math.sin(lean) * math.sin(turn), math.cos(lean))
        shapes.append(placed(rng.choice(kinds), (dot(rows[0], own), dot(rows[1], own), dot(rows[2], own)), rng))
    return Proxy(shapes)


def way_out_m(proxy: Proxy, p: Point, u: Point, most_m: float) -> float:
    """How far it is out of a solid in a straight line, by steps that pass no surface; inf: more than `most_m`."""
    gone = 0.0
    for _ in range(300):
        at = (p[0] + gone * u[0], p[1] + gone * u[1], p[2] + gone * u[2])
        d, _, _, _ = distance(proxy, proxy.others, proxy.voxels, *at)
        if d > -SURFACE_M:
            return gone
        gone -= d
        if gone > most_m:
            break
    return math.inf


def nearest_m(proxy: Proxy, p: Point) -> float:
    """How far the surface is from a point inside, no less than it is [m]."""
    best_m, best = math.inf, (0.0, 0.0, 1.0)
    for at in range(200):
        z = 1.0 - (2 * at + 1) / 200
        around = 2.399963 * at  # the golden angle
        u = (math.sqrt(1.0 - z * z) * math.cos(around), math.sqrt(1.0 - z * z) * math.sin(around), z)
        far_m = way_out_m(proxy, p, u, best_m)
        if far_m < best_m:
            best_m, best = far_m, u
    rng = random.Random(0)
    wide = 0.2
    while wide > 0.01:
        for _ in range(6):
            x, y, z = (of + wide * to for of, to in zip(best, unit(rng), strict=True))
            size = norm((x, y, z))
            u = (x / size, y / size, z / size)
            far_m = way_out_m(proxy, p, u, best_m)
            if far_m < best_m:
                best_m, best = far_m, u
                break
        else:
            wide *= 0.5
    return best_m


def begun(proxy: Proxy, p: Point) -> float:
    """Begin at a point; how deep it is in the solid [m]."""
    stand(proxy, p)
    d, _, _, _ = distance(proxy, proxy.others, proxy.voxels, *proxy.shapes[0].pose.own(p))
    return -d


def near(rng: random.Random) -> Point:
    return rng.uniform(-8e-3, 8e-3), rng.uniform(-8e-3, 8e-3), rng.uniform(-8e-3, 8e-3)


@examples(80)
@given(seed=seeds, opening_deg=openings, count=faces, kinds=st.sampled_from([FLAT, ROUND]))
def test_what_begins_in_a_notch_is_held_by_a_surface_that_is_near(
    seed: int, opening_deg: float, count: int, kinds: tuple[str, ...]
) -> None:
    """In one of 80 degrees or less of two planes it was up to 1e25 m away, and the force all that the limit allows."""
    rng = random.Random(seed)
    proxy = notch(count, opening_deg, kinds, rng)
    p = near(rng)
    deep_m = begun(proxy, p)
    if deep_m <= 1e-5:
        return
    assert proxy.touching
    d, _, _, _ = distance(proxy, proxy.others, proxy.voxels, proxy.gx, proxy.gy, proxy.gz)
    assert abs(d) <= 2.0 * SURFACE_M
    most = 1.25 if kinds == FLAT else 8.0
    assert proxy.depth_m <= most * nearest_m(proxy, proxy.shapes[0].pose.own(p)) + SURFACE_M


@examples(60)
@given(seed=seeds, opening_deg=openings)
def test_of_two_planes_it_is_the_nearest_point(seed: int, opening_deg: float) -> None:
    rng = random.Random(seed)
    proxy = notch(2, opening_deg, ("plane",), rng)
    p = near(rng)
    if begun(proxy, p) <= 1e-5:
        return
    one, two = (shape.pose.rotation for shape in proxy.shapes)
    n, m = ((rows[0][2], rows[1][2], rows[2][2]) for rows in (one, two))
    a, b, c = dot(n, p), dot(m, p), dot(n, m)
    if a < 0.0 and b >= a * c:  # the foot on the one plane is in front of the other
        true_m = -a
    elif b < 0.0 and a >= b * c:
        true_m = -b
    else:
        true_m = math.sqrt((a * a + b * b - 2.0 * a * b * c) / (1.0 - c * c))
    assert proxy.depth_m == pytest.approx(true_m, rel=0.01, abs=2.0 * SURFACE_M)


@pytest.mark.parametrize("deep_m", [0.0022, 0.0028, 0.0048])
def test_where_the_nearest_faces_look_at_each_other_it_goes_another_way(deep_m: float) -> None:
    """Slabs that lie half in each other, in which straight out of the one is straight into the other."""
    slabs = [Placed("box", Pose.of((0.0, 0.0, 0.005 * at)), size_m=(0.04, 0.04, 0.01)) for at in range(3)]
    proxy = Proxy(slabs)
    p = (0.001, 0.002, deep_m)
    begun(proxy, p)
    assert proxy.touching
    assert proxy.depth_m <= 2.0 * nearest_m(proxy, p)


FILLED = {
    "a room that is filled": [
        Placed("sphere", HERE, inside=True, radius_m=0.02),
        Placed("box", HERE, size_m=(0.03, 0.03, 0.03)),
        Placed("plane", Pose.of((0.0, 0.0, 0.012))),
        Placed("plane", Pose.of((0.0, 0.0, 0.011), (0.0, 1.0, 0.0, 0.0))),
    ],
    "planes that face each other": [
        Placed("plane", HERE),
        Placed("plane", Pose.of((0.0, 0.0, -0.01), (0.0, 1.0, 0.0, 0.0))),
    ],
}


@pytest.mark.parametrize("name", FILLED)
@pytest.mark.parametrize("friction", [(0.0, 0.0), (0.6, 0.4)])
def test_a_device_for_which_there_is_no_way_out_is_let_be(name: str, friction: tuple[float, float]) -> None:
    proxy = Proxy(FILLED[name], *friction)
    stand(proxy, (0.001, 0.002, -0.003))
    for at in range(50):
        assert not proxy.touching
        assert spring(proxy) == (0.0, 0.0, 0.0)
        go(proxy, (0.001 + 1e-4 * at, 0.002, -0.003 - 1e-4 * at))


def test_one_that_was_let_be_is_held_again_once_it_has_left_and_come_back() -> None:
    """As if its solid had grown about it and been taken away: the distance that says so is set here."""
    proxy = Proxy([Placed("plane", HERE), Placed("sphere", HERE, radius_m=0.01)])
    stand(proxy, (0.02, 0.0, 1e-3))
    proxy.gz = -2e-3
    proxy.d = -2e-3
    for at in range(21):
        assert not proxy.touching
        go(proxy, (0.02, 0.0, -2e-3 + 1e-4 * at))
    assert proxy.d >= 0.0
    go(proxy, (0.02, 0.0, 1e-4))
    go(proxy, (0.02, 0.0, -1e-3))
    assert spring(proxy) == pytest.approx((0.0, 0.0, 1e-3), abs=2e-6)


def test_compiled_it_comes_to_the_same_place() -> None:
    step = compiled(place)
    rng = random.Random(3)
    for _ in range(60):
        proxy = notch(rng.choice((2, 3)), rng.uniform(10.0, 170.0), ROUND, rng)
        p = near(rng)
        one, others = records(proxy)
        stand(proxy, p)
        step(one, others, voxels_of(proxy), *p)
        for field in PROXY_KINDS:
            assert one[0][field] == getattr(proxy, field), field
