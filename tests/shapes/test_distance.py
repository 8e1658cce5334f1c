"""Distances are exact: a convex solid's is the largest of u.p - h(u) over all directions, h its support function.

Any direction gives a bound from below, a surface point one from above; where they meet, there is nothing left to say.
"""

from __future__ import annotations

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.shapes.distance import shape_distance
from hapticd.shapes.pose import Pose
from hapticd.shapes.solid import Part, Placed
from tests.shapes.walks import CONVEX, HERE, Point, dot, norm

SOLID = {name: shape for name, shape in CONVEX.items() if name != "plane"}
near = st.floats(-0.06, 0.06, allow_subnormal=False)
points = st.tuples(near, near, near)


def own(shape: Placed) -> Part:
    return Part(shape, HERE)


def measured(shape: Placed, p: Point) -> tuple[float, Point]:
    d, nx, ny, nz = shape_distance(own(shape), (), *p)
    return d, (nx, ny, nz)


def support(shape: Placed, u: Point) -> float:
    """The largest u.q of all points q of the shape."""
    x, y, z = (abs(each) for each in u)
    if shape.shape == "sphere":
        return shape.radius_m * norm(u)
    if shape.shape == "capsule":
        return shape.radius_m * norm(u) + shape.length_m / 2.0 * z
    r = shape.rounding_m
    if shape.shape == "box":
        a, b, c = (side / 2.0 - r for side in shape.size_m)
        return a * x + b * y + c * z + r * norm(u)
    return (shape.radius_m - r) * math.hypot(x, y) + (shape.length_m / 2.0 - r) * z + r * norm(u)


@pytest.mark.parametrize("name", SOLID)
@given(p=points)
def test_no_direction_says_that_the_surface_is_farther_away(name: str, p: Point) -> None:
    shape = SOLID[name]
    d, _ = measured(shape, p)
    rng = random.Random(1)
    for _ in range(40):
        u: Point = (rng.gauss(0.0, 1.0), rng.gauss(0.0, 1.0), rng.gauss(0.0, 1.0))
        assert dot(u, p) - support(shape, u) <= norm(u) * (d + 1e-15)


@pytest.mark.parametrize("name", SOLID)
@given(p=points)
def test_the_normal_is_a_direction_that_says_just_that(name: str, p: Point) -> None:
    shape = SOLID[name]
    d, n = measured(shape, p)
    assert abs(norm(n) - 1.0) < 1e-14
    assert abs(dot(n, p) - support(shape, n) - d) < 1e-15


@pytest.mark.parametrize("name", CONVEX)
@given(p=points)
def test_the_way_against_the_normal_ends_on_the_surface(name: str, p: Point) -> None:
    shape = CONVEX[name]
    d, n = measured(shape, p)
    on = (p[0] - d * n[0], p[1] - d * n[1], p[2] - d * n[2])
    assert abs(measured(shape, on)[0]) < 1e-15


@pytest.mark.parametrize("name", CONVEX)
@given(p=points, seed=st.integers(0, 1000))
def test_the_normal_is_the_gradient(name: str, p: Point, seed: int) -> None:
    shape = CONVEX[name]
    d, n = measured(shape, p)
    rng = random.Random(seed)
    u: Point = (rng.gauss(0.0, 1.0), rng.gauss(0.0, 1.0), rng.gauss(0.0, 1.0))
    size = norm(u)
    u = (u[0] / size, u[1] / size, u[2] / size)
    step_m = 1e-6
    ahead, n_ahead = measured(shape, (p[0] + step_m * u[0], p[1] + step_m * u[1], p[2] + step_m * u[2]))
    behind, n_behind = measured(shape, (p[0] - step_m * u[0], p[1] - step_m * u[1], p[2] - step_m * u[2]))
    assert abs(ahead - behind) <= 2.0 * step_m * (1.0 + 1e-9)  # nowhere steeper than 1
    if dot(n_ahead, n) > 0.999 and dot(n_behind, n) > 0.999 and abs(d) > 1e-4:  # off edges and medial axes
        assert abs((ahead - behind) / (2.0 * step_m) - dot(n, u)) < 1e-2 * step_m / min(abs(d), 1e-3) + 2e-3


@pytest.mark.parametrize("name", CONVEX)
@given(p=points)
def test_inside_is_the_same_surface_seen_from_the_other_side(name: str, p: Point) -> None:
    shape = CONVEX[name]
    hollow = Placed(
        shape.shape,
        shape.pose,
        inside=True,
        radius_m=shape.radius_m,
        size_m=shape.size_m,
        length_m=shape.length_m,
        rounding_m=shape.rounding_m,
    )
    d, n = measured(shape, p)
    assert measured(hollow, p) == (-d, (-n[0], -n[1], -n[2]))


@pytest.mark.parametrize("name", CONVEX)
@pytest.mark.parametrize("p", [(0.0, 0.0, 0.0), (0.0, 0.0, 0.003), (0.003, 0.0, 0.0), (0.0, -0.003, 0.0)])
def test_on_a_medial_axis_the_normal_is_still_one_unit_vector(name: str, p: Point) -> None:
    d, n = measured(CONVEX[name], p)
    assert abs(norm(n) - 1.0) < 1e-15
    assert math.isfinite(d)


def test_a_quaternion_turns_as_it_should() -> None:
    quarter = Pose.of((1.0, 2.0, 3.0), (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)))  # about z
    assert quarter.out((1.0, 0.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0), abs=1e-15)
    assert quarter.point((1.0, 0.0, 0.5)) == pytest.approx((1.0, 3.0, 3.5))


@given(q=st.tuples(*[st.floats(-1e6, 1e6)] * 4).filter(lambda q: max(map(abs, q)) > 1e-6), p=points)
def test_a_point_comes_back_from_a_frame(q: tuple[float, float, float, float], p: Point) -> None:
    pose = Pose.of((0.1, -0.2, 0.05), q)
    assert pose.own(pose.point(p)) == pytest.approx(p, abs=1e-15)
    other = Pose.of((0.3, 0.1, 0.0), (0.5, 0.1, -0.4, 0.2))
    seen = pose.seen_from(other)
    assert other.point(seen.point(p)) == pytest.approx(pose.point(p), abs=1e-15)
