"""How far away the surface of a shape is, and which way it faces: every shape in its own frame, by floats alone.

A distance is negative inside; the normal is its gradient, a unit vector that points away from the solid. Where it
jumps (a centre, an axis, the diagonals of a box) one of the nearest faces is taken. The same source runs interpreted
in the loop and compiled in studies: `shape` is anything that has the fields of `hapticd.shapes.scalars.ShapeScalars`.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from hapticd.shapes.field import field_distance

PLANE = 0
SPHERE = 1
BOX = 2
CAPSULE = 3
CYLINDER = 4
FIELD = 5

_POINT_M = 1e-100  # what is shorter is a point and has no direction: the square of a much shorter length is 0


def plane_distance(x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """The plane z = 0, solid below."""
    return z, 0.0, 0.0, 1.0


def sphere_distance(x: float, y: float, z: float, radius: float) -> tuple[float, float, float, float]:
    """A ball about the origin [m]."""
    length = sqrt(x * x + y * y + z * z)
    if length < _POINT_M:
        return -radius, 0.0, 0.0, 1.0
    return length - radius, x / length, y / length, z / length


def box_distance(
    x: float, y: float, z: float, a: float, b: float, c: float, rounding: float
) -> tuple[float, float, float, float]:
    """A box about the origin: half its sides less the rounding of its edges, and the rounding [m]."""
    sx = sy = sz = 1.0
    if x < 0.0:
        x = -x
        sx = -1.0
    if y < 0.0:
        y = -y
        sy = -1.0
    if z < 0.0:
        z = -z
        sz = -1.0
    x -= a
    y -= b
    z -= c
    if x <= _POINT_M and y <= _POINT_M and z <= _POINT_M:
        if x >= y and x >= z:
            return x - rounding, sx, 0.0, 0.0
        if y >= z:
            return y - rounding, 0.0, sy, 0.0
        return z - rounding, 0.0, 0.0, sz
    if x < 0.0:
        x = 0.0
    if y < 0.0:
        y = 0.0
    if z < 0.0:
        z = 0.0
    length = sqrt(x * x + y * y + z * z)
    return length - rounding, sx * (x / length), sy * (y / length), sz * (z / length)


def capsule_distance(
    x: float, y: float, z: float, radius: float, half_length: float
) -> tuple[float, float, float, float]:
    """All points within a radius of a piece of the z axis, which reaches half a length to both sides [m]."""
    if z > half_length:
        z -= half_length
    elif z < -half_length:
        z += half_length
    else:
        z = 0.0
    length = sqrt(x * x + y * y + z * z)
    if length < _POINT_M:
        return -radius, 1.0, 0.0, 0.0
    return length - radius, x / length, y / length, z / length


def cylinder_distance(
    x: float, y: float, z: float, radius: float, half_length: float, rounding: float
) -> tuple[float, float, float, float]:
    """A cylinder about the z axis: radius and half its length less the rounding of its rims, and the rounding [m]."""
    across = sqrt(x * x + y * y)
    ux = 1.0
    uy = 0.0
    if across > _POINT_M:
        ux = x / across
        uy = y / across
    sz = 1.0
    if z < 0.0:
        z = -z
        sz = -1.0
    q = across - radius
    h = z - half_length
    if q <= _POINT_M and h <= _POINT_M:
        if q >= h:
            return q - rounding, ux, uy, 0.0
        return h - rounding, 0.0, 0.0, sz
    if q <= 0.0:
        return h - rounding, 0.0, 0.0, sz
    if h <= 0.0:
        return q - rounding, ux, uy, 0.0
    length = sqrt(q * q + h * h)
    q /= length
    return length - rounding, ux * q, uy * q, sz * (h / length)


def shape_distance(shape: Any, voxels: Any, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance and normal of any shape.

    Args:
        shape: its kind, sides, and whether it is solid (`sign` 1) or hollow (-1).
        voxels: the distances of all fields, for a shape that is one.
        x: the point in the shape's own frame, with y and z [m].
        y: see x.
        z: see x.
    """
    kind = shape.kind
    if kind == 1:
        d, nx, ny, nz = sphere_distance(x, y, z, shape.a)
    elif kind == 5:
        d, nx, ny, nz = field_distance(shape, voxels, x, y, z)
    elif kind == 0:
        d, nx, ny, nz = plane_distance(x, y, z)
    elif kind == 2:
        d, nx, ny, nz = box_distance(x, y, z, shape.a, shape.b, shape.c, shape.r)
    elif kind == 3:
        d, nx, ny, nz = capsule_distance(x, y, z, shape.a, shape.b)
    else:
        d, nx, ny, nz = cylinder_distance(x, y, z, shape.a, shape.b, shape.r)
    if shape.sign < 0.0:
        return -d, -nx, -ny, -nz
    return d, nx, ny, nz
