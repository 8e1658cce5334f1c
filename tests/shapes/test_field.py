"""A distance field reads as trilinear interpolation says, says how far away it is outside, and survives its file."""

from __future__ import annotations

import itertools
import math
from array import array
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator

from hapticd.errors import ConfigError
from hapticd.shapes.field import Field, field_distance
from hapticd.shapes.pose import Pose
from hapticd.shapes.solid import Part, Placed, Proxy
from tests.shapes.walks import HERE, TORUS, Point, field_of, go, norm, spring, stand, torus

inside = st.floats(-0.0244, 0.0244)
anywhere = st.floats(-0.1, 0.1)
PART = Part(Placed("mesh", HERE, field=TORUS), HERE)


def measured(p: Point) -> tuple[float, Point]:
    d, x, y, z = field_distance(PART, TORUS.distances_m, *p)
    return d, (x, y, z)


@cache
def reference() -> RegularGridInterpolator:
    axis = [TORUS.origin_m[0] + TORUS.spacing_m * at for at in range(TORUS.counts[0])]
    return RegularGridInterpolator((axis,) * 3, np.array(TORUS.distances_m, float).reshape(TORUS.counts))


@given(p=st.tuples(inside, inside, inside))
def test_between_points_it_is_trilinear(p: Point) -> None:
    assert measured(p)[0] == pytest.approx(float(reference()([p])[0]), abs=1e-16)


@given(p=st.tuples(inside, inside, inside))
def test_its_normal_is_the_gradient_of_what_it_reads(p: Point) -> None:
    cell = TORUS.spacing_m
    at = [(each - start) / cell for each, start in zip(p, TORUS.origin_m, strict=True)]
    if any(not 0.01 < each - math.floor(each) < 0.99 for each in at):
        return  # over the face of a cell it turns
    step = 1e-3 * cell
    slope = []
    for axis in range(3):
        ahead, behind = list(p), list(p)
        ahead[axis] += step
        behind[axis] -= step
        slope.append(float(reference()([ahead])[0] - reference()([behind])[0]) / (2.0 * step))
    size = math.hypot(*slope)
    _, n = measured(p)
    assert norm(n) == pytest.approx(1.0, abs=1e-14)
    if size > 0.1:
        assert n == pytest.approx([each / size for each in slope], abs=1e-9)


@given(p=st.tuples(anywhere, anywhere, anywhere))
def test_outside_the_grid_the_surface_is_at_least_as_far_as_it_says(p: Point) -> None:
    d, n = measured(p)
    edge = 0.0245
    if any(abs(each) > edge for each in p):
        assert 0.0 < d <= torus(*p)
        assert norm(n) == pytest.approx(1.0, abs=1e-14)


def test_a_smooth_surface_is_met_as_truly_as_the_square_of_the_spacing() -> None:
    """A ball of 12 mm: h^2/4R and less, in distance; and less of it with a finer grid."""

    def ball(x: float, y: float, z: float) -> float:
        return math.sqrt(x * x + y * y + z * z) - 0.012

    worst = []
    for spacing_m in (2e-3, 1e-3):
        proxy = Proxy([Placed("mesh", HERE, field=field_of(ball, 0.018, spacing_m))])
        off = 0.0
        for a, b in itertools.product(range(24), range(24)):
            u = (
                math.sin(0.131 * a) * math.cos(0.262 * b),
                math.sin(0.131 * a) * math.sin(0.262 * b),
                math.cos(0.131 * a),
            )
            stand(proxy, (0.013 * u[0], 0.013 * u[1], 0.013 * u[2]))
            for depth_m in (2e-4, 1e-3):
                r = 0.012 - depth_m
                go(proxy, (r * u[0], r * u[1], r * u[2]))
            off = max(off, abs(norm(spring(proxy)) - 1e-3))
        worst.append(off)
        assert off <= spacing_m * spacing_m / (4.0 * 0.012) * 1.05
    assert worst[1] < 0.35 * worst[0]


def test_a_field_comes_back_from_its_file() -> None:
    assert Field.unpack(TORUS.pack()) == TORUS


@given(at=st.integers(0, 400), bit=st.integers(0, 7))
def test_one_flipped_bit_anywhere_is_noticed(at: int, bit: int) -> None:
    content = bytearray(SMALL)
    content[at % len(content)] ^= 1 << bit
    with pytest.raises(ConfigError):
        Field.unpack(bytes(content))


@given(length=st.integers(0, 400))
def test_a_file_that_is_cut_off_is_noticed(length: int) -> None:
    with pytest.raises(ConfigError):
        Field.unpack(SMALL[: min(length, len(SMALL) - 1)])


def test_a_file_of_another_kind_says_how_one_is_made() -> None:
    with pytest.raises(ConfigError, match="is no distance field; make one with: hapticd mesh"):
        Field.unpack(b"solid cube\n")


@pytest.mark.parametrize(
    "changed",
    [
        {"spacing_m": 0.0},
        {"spacing_m": math.nan},
        {"origin_m": (math.inf, 0.0, 0.0)},
        {"counts": (1, 3, 9)},
    ],
)
def test_a_field_that_cannot_be_is_refused(changed: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match="is no possible distance field"):
        Field.unpack(replace(CUBE, **changed).pack())  # type: ignore[arg-type]  # as a field of any kind


def test_the_smallest_field_is_read_from_corner_to_corner() -> None:
    """Two points a side: none of them has a neighbour beyond the last."""
    least = replace(CUBE, counts=(2, 2, 2), distances_m=array("f", [float(at) for at in range(8)]))
    part = Part(Placed("mesh", HERE, field=Field.unpack(least.pack())), HERE)
    edges = (-0.1, -0.0999, -0.05, -1e-9, 0.0, 1e-12)
    for x, y, z in itertools.product(edges, repeat=3):
        d, *n = field_distance(part, least.distances_m, x, y, z)
        within = 10.0 * (4.0 * (x + 0.1) + 2.0 * (y + 0.1) + z + 0.1)
        assert d == pytest.approx(within, abs=1e-12) or (max(x, y, z) >= 0.0 and 0.05 <= d < 0.0501)
        assert norm((n[0], n[1], n[2])) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize(("shape", "field"), [("mesh", None), ("sphere", TORUS)])
def test_a_mesh_has_a_field_and_nothing_else_has(shape: str, field: Field | None) -> None:
    with pytest.raises(ConfigError, match="field"):
        Placed(shape, HERE, field=field, radius_m=0.0 if shape == "mesh" else 0.01)


def test_two_meshes_of_a_union_each_read_their_own_field() -> None:
    small = field_of(lambda x, y, z: math.sqrt(x * x + y * y + z * z) - 0.004, 0.007, 1e-3)
    at = Pose.of((0.0, 0.0, 0.02))
    proxy = Proxy([Placed("mesh", HERE, field=TORUS), Placed("mesh", at, field=small)])
    stand(proxy, (0.0, 0.0, 0.026))
    go(proxy, (0.0, 0.0, 0.0235))
    assert spring(proxy) == pytest.approx((0.0, 0.0, 0.0005), abs=1e-4)
    stand(proxy, (0.015, 0.0, 0.008))
    go(proxy, (0.015, 0.0, 0.0055))
    assert spring(proxy) == pytest.approx((0.0, 0.0, 0.0005), abs=1e-4)


CUBE = Field((3, 3, 3), (-0.1, -0.1, -0.1), 0.1, 0.05, 1e-3, array("f", [float(at) for at in range(27)]))
SMALL = CUBE.pack()
