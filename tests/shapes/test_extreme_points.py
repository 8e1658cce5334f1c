"""Where floats are extreme, on edges and in centres, every distance is finite and every normal is still a direction."""

from __future__ import annotations

import itertools
import math
from array import array

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.shapes.distance import shape_distance
from hapticd.shapes.field import Field
from hapticd.shapes.solid import Part, Placed, Proxy
from hapticd.tick.motion import MOST_M
from tests.shapes.walks import CONVEX, FIELDS, HERE, HOLLOW, SOLIDS, Point, go, spring, stand


def field_at_zero(*distances: float) -> Placed:
    """A mesh whose grid is one cell, with its first point in the origin."""
    return Placed("mesh", HERE, field=Field((2, 2, 2), (0.0, 0.0, 0.0), 1e-3, 1e-3, 1e-3, array("f", distances)))


ROUNDED = {
    "cube that is a ball": Placed("box", HERE, size_m=(0.04, 0.04, 0.04), rounding_m=0.02),
    "bar that is a capsule": Placed("box", HERE, size_m=(0.02, 0.06, 0.02), rounding_m=0.01),
    "plate that is all edge": Placed("box", HERE, size_m=(0.02, 0.06, 0.05), rounding_m=0.01),
    "cylinder that is a ball": Placed("cylinder", HERE, radius_m=0.02, length_m=0.04, rounding_m=0.02),
    "cylinder that is a capsule": Placed("cylinder", HERE, radius_m=0.01, length_m=0.04, rounding_m=0.01),
    "disc that is all rim": Placed("cylinder", HERE, radius_m=0.03, length_m=0.01, rounding_m=0.005),
}
TINY = {
    f"{shape} of {size_m:g} m": Placed(
        shape,
        HERE,
        radius_m=0.0 if shape == "box" else size_m,
        size_m=(size_m,) * 3 if shape == "box" else (0.0,) * 3,
        length_m=size_m if shape in ("capsule", "cylinder") else 0.0,
    )
    for shape in ("sphere", "box", "capsule", "cylinder")
    for size_m in (5e-324, 1e-160)
}
GRIDS = {
    "torus": FIELDS["torus"][0],
    "hollow torus": FIELDS["hollow torus"][0],
    "slope": field_at_zero(0.0, 0.0, 1e-3, 1e-3, 0.0, 0.0, 1e-3, 1e-3),
    "saddle": field_at_zero(0.0, 0.0, 0.0, 1e-3, 0.0, 1e-3, 1e-3, 2e-3),
    "flat": field_at_zero(*[1e-3] * 8),
    "corner": field_at_zero(*[0.0] * 7, 1e-3),
}
TOUCHED = SOLIDS | {name: [shape] for name, shape in (ROUNDED | GRIDS).items()}
SHAPES = CONVEX | HOLLOW | ROUNDED | TINY | GRIDS

TINIEST_M = (0.0, 5e-324, 2.3e-308, 1e-200, 1e-170, 1e-162, 1e-160, 1e-155, 1e-150, 1e-100, 2e-100, 1e-60)
NEXT_TO_NOTHING = sorted({sign * size_m for sign in (-1.0, 1.0) for size_m in TINIEST_M})


def places(part: Part, shape: Placed) -> list[float]:
    """Coordinates at which something ends or is as small as it can be [m]."""
    ends = {part.a, part.b, part.c, part.r, part.a + part.r, part.b + part.r, part.c + part.r}
    if shape.field is not None:
        for first, size_m in zip(shape.field.origin_m, shape.field.size_m, strict=True):
            ends |= {first, first + size_m, first + shape.field.spacing_m}
    beside = {math.nextafter(end, way) for end in ends for way in (-math.inf, math.inf)}
    found = {abs(each) for each in ends | beside} | set(TINIEST_M)
    return sorted(found | {-each for each in found})


def points(part: Part, shape: Placed) -> st.SearchStrategy[Point]:
    coordinate = st.sampled_from(places(part, shape)) | st.floats(-1e-100, 1e-100) | st.floats(-MOST_M, MOST_M)
    return st.tuples(coordinate, coordinate, coordinate)


PARTS = {name: Part(shape, HERE) for name, shape in SHAPES.items()}
POINTS = {name: points(PARTS[name], shape) for name, shape in SHAPES.items()}


def says_how_far_and_which_way(name: str, p: Point) -> bool:
    field = SHAPES[name].field
    d, *normal = shape_distance(PARTS[name], field.distances_m if field else (), *p)
    return math.isfinite(d) and abs(math.hypot(*normal) - 1.0) <= 1e-9


@pytest.mark.parametrize("name", SHAPES)
def test_next_to_its_centre_a_shape_has_a_surface_to_go_to(name: str) -> None:
    """A box that was all rounding divided by 0 there, and so did a grid that begins there, on the outside of it."""
    near = itertools.product(NEXT_TO_NOTHING, NEXT_TO_NOTHING, NEXT_TO_NOTHING)
    assert [p for p in near if not says_how_far_and_which_way(name, p)] == []


@pytest.mark.parametrize("name", SHAPES)
@given(data=st.data())
def test_so_has_it_wherever_a_device_can_be(name: str, data: st.DataObject) -> None:
    assert says_how_far_and_which_way(name, data.draw(POINTS[name]))


@pytest.mark.parametrize("name", TOUCHED)
@given(data=st.data())
def test_a_proxy_holds_its_device_wherever_that_goes(name: str, data: st.DataObject) -> None:
    proxy = Proxy(TOUCHED[name], 0.5, 0.4)
    coordinate = st.sampled_from(NEXT_TO_NOTHING) | st.floats(-0.1, 0.1) | st.floats(-MOST_M, MOST_M)
    stand(proxy, data.draw(st.tuples(coordinate, coordinate, coordinate)))
    for _ in range(3):
        go(proxy, data.draw(st.tuples(coordinate, coordinate, coordinate)))
        assert all(map(math.isfinite, spring(proxy)))
        assert abs(math.hypot(proxy.normal_x, proxy.normal_y, proxy.normal_z) - 1.0) <= 1e-9
