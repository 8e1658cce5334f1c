"""A distance field: signed distances on a grid, read between its points with eight fetches."""

from __future__ import annotations

from math import sqrt
from typing import Any


def field_distance(shape: Any, voxels: Any, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance and normal of a field: trilinear between the points of its grid.

    Outside the grid it is what is certain, the way to the grid and the grid's margin: the surface is farther away.

    Args:
        shape: `ox`, `oy`, `oz` the first point of the grid [m], `per_m` points a metre, `nx`, `ny`, `nz` how many
            points there are, `offset` where its first value is, `margin` between surface and edge of the grid [m].
        voxels: distances [m], z running fastest.
        x: the point in the field's own frame, with y and z [m].
        y: see x.
        z: see x.
    """
    u = (x - shape.ox) * shape.per_m
    v = (y - shape.oy) * shape.per_m
    w = (z - shape.oz) * shape.per_m
    ny = shape.ny
    nz = shape.nz
    du = dv = dw = 0.0
    top = shape.nx - 1.000001
    if u < 0.0:
        du = u
    elif u > top:
        du = u - top
    top = ny - 1.000001
    if v < 0.0:
        dv = v
    elif v > top:
        dv = v - top
    top = nz - 1.000001
    if w < 0.0:
        dw = w
    elif w > top:
        dw = w - top
    if du != 0.0 or dv != 0.0 or dw != 0.0:
        length = sqrt(du * du + dv * dv + dw * dw)
        return length / shape.per_m + shape.margin, du / length, dv / length, dw / length
    i = int(u)
    j = int(v)
    k = int(w)
    u -= i
    v -= j
    w -= k
    at = shape.offset + (i * ny + j) * nz + k
    a = voxels[at]
    da = voxels[at + 1] - a
    a += w * da
    b = voxels[at + nz]
    db = voxels[at + nz + 1] - b
    b += w * db
    at += ny * nz
    c = voxels[at]
    dc = voxels[at + 1] - c
    c += w * dc
    d = voxels[at + nz]
    dd = voxels[at + nz + 1] - d
    d += w * dd
    b -= a  # along y, at x = 0 and 1
    d -= c
    a += v * b
    c += v * d
    c -= a  # along x
    gx = c
    gy = b + u * (d - b)
    gz = da + v * (db - da)
    gz += u * (dc + v * (dd - dc) - gz)
    length = sqrt(gx * gx + gy * gy + gz * gz)
    if length == 0.0:
        return a + u * c, 0.0, 0.0, 1.0
    return a + u * c, gx / length, gy / length, gz / length
