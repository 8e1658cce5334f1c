"""The way out of a solid for a point so deep in several of its shapes that the nearest face of one is in another.

Straight out of the first shape, and where that leads into another one, along the sum of the normals of all the faces
that were in the way: sooner or later it faces each of them. What they were tells where they meet, which is nearer.
Where all that ends nowhere, the shortest of some straight ways.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

from hapticd.shapes.surface import SURFACE_M, distance, land

_STEPS = 60
_FACED = 0.01  # sine of half a degree: what opens by less than a degree is shut
_ONE_FACE = 0.98  # cosine of 11 degrees: two normals that differ by less are of one face
_SHUT = 1e-4  # squared sine of half a degree: two faces that meet at less, or face each other, have no crease
_FLAT = 0.01  # three normals that span less than this lie in a plane, and their faces meet nowhere
_RAY_STEPS = 16
_STEEP = 0.2


def land_outside(
    proxy: Any, others: Any, voxels: Any, px: float, py: float, pz: float
) -> tuple[float, float, float, float, float, float, float]:
    """The surface where a way out of all shapes ends: distance left, point and normal as of `land`."""
    d, x, y, z, nx, ny, nz = land_past_faces(proxy, others, voxels, px, py, pz)
    if -SURFACE_M <= d <= SURFACE_M:
        return d, x, y, z, nx, ny, nz
    return land_by_rays(proxy, others, voxels, px, py, pz)


def land_past_faces(
    proxy: Any, others: Any, voxels: Any, px: float, py: float, pz: float
) -> tuple[float, float, float, float, float, float, float]:
    """Go along the sum of the normals that were met: the nearest of where that ends and where their faces meet."""
    d, nx, ny, nz = distance(proxy, others, voxels, px, py, pz)
    a = b = c = d  # of the first, the last but one and the last face: how far the device is off its plane
    ax = bx = cx = sx = ux = nx
    ay = by = cy = sy = uy = ny
    az = bz = cz = sz = uz = nz
    x = px
    y = py
    z = pz
    for _ in range(_STEPS):
        if d > -SURFACE_M:
            break
        if ax * nx + ay * ny + az * nz < _ONE_FACE:
            if cx * nx + cy * ny + cz * nz < _ONE_FACE:
                b = c
                bx = cx
                by = cy
                bz = cz
            c = d + nx * (px - x) + ny * (py - y) + nz * (pz - z)
            cx = nx
            cy = ny
            cz = nz
        along = ux * nx + uy * ny + uz * nz
        if along < _FACED:
            sx += nx
            sy += ny
            sz += nz
            length = sqrt(sx * sx + sy * sy + sz * sz)
            if length < _FACED:
                break
            ux = sx / length
            uy = sy / length
            uz = sz / length
        else:
            x -= d / along * ux
            y -= d / along * uy
            z -= d / along * uz
            d, nx, ny, nz = distance(proxy, others, voxels, x, y, z)
    e, gx, gy, gz, mx, my, mz = land(proxy, others, voxels, x, y, z)

    # where two of the faces meet, and all three
    for _ in range(3):
        turn = ax * bx + ay * by + az * bz
        both = 1.0 - turn * turn
        if both > _SHUT:
            s = (turn * b - a) / both
            t = (turn * a - b) / both
            x = px + s * ax + t * bx
            y = py + s * ay + t * by
            z = pz + s * az + t * bz
            e, gx, gy, gz, mx, my, mz = nearer(proxy, others, voxels, px, py, pz, x, y, z, e, gx, gy, gz, mx, my, mz)
        a, b, c = b, c, a
        ax, bx, cx = bx, cx, ax
        ay, by, cy = by, cy, ay
        az, bz, cz = bz, cz, az
    kx = by * cz - bz * cy
    ky = bz * cx - bx * cz
    kz = bx * cy - by * cx
    span = ax * kx + ay * ky + az * kz
    if span < -_FLAT or span > _FLAT:
        x = px - (a * kx + b * (cy * az - cz * ay) + c * (ay * bz - az * by)) / span
        y = py - (a * ky + b * (cz * ax - cx * az) + c * (az * bx - ax * bz)) / span
        z = pz - (a * kz + b * (cx * ay - cy * ax) + c * (ax * by - ay * bx)) / span
        return nearer(proxy, others, voxels, px, py, pz, x, y, z, e, gx, gy, gz, mx, my, mz)
    return e, gx, gy, gz, mx, my, mz


def nearer(
    proxy: Any,
    others: Any,
    voxels: Any,
    px: float,
    py: float,
    pz: float,
    x: float,
    y: float,
    z: float,
    d: float,
    gx: float,
    gy: float,
    gz: float,
    nx: float,
    ny: float,
    nz: float,
) -> tuple[float, float, float, float, float, float, float]:
    """Of a place and where a point lands, the one on the surface that is nearer to the device."""
    e, x, y, z, mx, my, mz = land(proxy, others, voxels, x, y, z)
    if -SURFACE_M <= e <= SURFACE_M:
        wx = gx - px
        wy = gy - py
        wz = gz - pz
        vx = x - px
        vy = y - py
        vz = z - pz
        if vx * vx + vy * vy + vz * vz < wx * wx + wy * wy + wz * wz or d > SURFACE_M or d < -SURFACE_M:
            return e, x, y, z, mx, my, mz
    return d, gx, gy, gz, nx, ny, nz


def land_by_rays(
    proxy: Any, others: Any, voxels: Any, px: float, py: float, pz: float
) -> tuple[float, float, float, float, float, float, float]:
    """Of the straight ways along the axes of the solid's frame and between three, where the shortest ends."""
    shortest = inf
    x = px
    y = py
    z = pz
    for ray in range(27):
        ux = ray % 3 - 1.0
        uy = ray // 3 % 3 - 1.0
        uz = ray // 9 - 1.0
        square = ux * ux + uy * uy + uz * uz
        if square == 0.0 or square == 2.0:
            continue
        length = sqrt(square)
        ux /= length
        uy /= length
        uz /= length
        gone = 0.0
        for _ in range(_RAY_STEPS):
            d, nx, ny, nz = distance(proxy, others, voxels, px + gone * ux, py + gone * uy, pz + gone * uz)
            if d > -SURFACE_M:
                shortest = gone
                x = px + gone * ux
                y = py + gone * uy
                z = pz + gone * uz
                break
            along = ux * nx + uy * ny + uz * nz
            gone -= d / along if along > _STEEP else d
            if gone >= shortest:
                break
    return land(proxy, others, voxels, x, y, z)
