"""The surface of a solid, which is one shape or the union of several: distance, landing on it, tracing to it."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

from hapticd.shapes.distance import shape_distance

SURFACE_M = 1e-6
"""A point this near is on the surface; what is left is corrected to first order."""

_STEPS = 48
_BEYOND_M = 4.0 * SURFACE_M
_AGAINST = -0.9
_FACE = 0.98
_BEHIND = 0.04  # a landing 11 degrees behind a shape's face is not on its near side, round as it may be
_LANDINGS = 4
_GONE = 0.5  # a step that is held before it is half done has not passed anything
_THIN_M2 = 4e-8  # what stands on a face and is thinner than 0.2 mm may be passed


def distance(proxy: Any, others: Any, voxels: Any, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance and normal of a solid: of the nearest of its shapes, in the frame of the first one."""
    d, nx, ny, nz = shape_distance(proxy, voxels, x, y, z)
    for at in range(proxy.first_part, proxy.end_part):
        part = others[at]
        if part.bound_m >= 0.0:
            bx = x - part.bound_x
            by = y - part.bound_y
            bz = z - part.bound_z
            far = d + part.bound_m
            if far < 0.0 or bx * bx + by * by + bz * bz >= far * far:
                continue
        bx = x - part.px
        by = y - part.py
        bz = z - part.pz
        if part.turned:
            qx = part.xx * bx + part.yx * by + part.zx * bz
            qy = part.xy * bx + part.yy * by + part.zy * bz
            qz = part.xz * bx + part.yz * by + part.zz * bz
            e, qx, qy, qz = shape_distance(part, voxels, qx, qy, qz)
            if e < d:
                d = e
                nx = part.xx * qx + part.xy * qy + part.xz * qz
                ny = part.yx * qx + part.yy * qy + part.yz * qz
                nz = part.zx * qx + part.zy * qy + part.zz * qz
        else:
            e, qx, qy, qz = shape_distance(part, voxels, bx, by, bz)
            if e < d:
                d = e
                nx = qx
                ny = qy
                nz = qz
    return d, nx, ny, nz


def land(
    proxy: Any, others: Any, voxels: Any, x: float, y: float, z: float
) -> tuple[float, float, float, float, float, float, float]:
    """The surface near a point, by Newton's steps: distance left before the last one, point, normal."""
    d, nx, ny, nz = distance(proxy, others, voxels, x, y, z)
    x -= d * nx
    y -= d * ny
    z -= d * nz
    tries = 0
    while (d > SURFACE_M or d < -SURFACE_M) and tries < _LANDINGS:
        tries += 1
        if proxy.exact:
            return 0.0, x, y, z, nx, ny, nz
        d, nx, ny, nz = distance(proxy, others, voxels, x, y, z)
        x -= d * nx
        y -= d * ny
        z -= d * nz
    return d, x, y, z, nx, ny, nz


def land_in_union(
    proxy: Any, others: Any, voxels: Any, tx: float, ty: float, tz: float
) -> tuple[bool, float, float, float, float, float, float, float]:
    """Where a step of the goal ends among several shapes: on their surface, or before a face that stands in the way.

    Args:
        proxy: the proxy.
        others: the other shapes of its solid.
        voxels: the distances of its fields.
        tx: the step, with ty and tz, not 0 [m].
        ty: see tx.
        tz: see tx.

    Returns:
        Whether a face stands in the way; distance left, point and normal as of `land`, of that face the foot of the
        goal on it and a distance that is off the surface. An endless distance: it has ended out of sight of any face.
    """
    gx = proxy.gx
    gy = proxy.gy
    gz = proxy.gz
    d, x, y, z, mx, my, mz = land(proxy, others, voxels, gx + tx, gy + ty, gz + tz)
    if -SURFACE_M <= d <= SURFACE_M and buried(proxy, others, voxels, x, y, z, mx, my, mz):
        # between two shapes that are flush: what stands there is another face
        e, ox, oy, oz = ahead(proxy, others, voxels, gx, gy, gz, proxy.ux, proxy.uy, proxy.uz, inf)
        if e < -_BEYOND_M:
            return False, inf, x, y, z, mx, my, mz
    else:
        vx = x - gx
        vy = y - gy
        vz = z - gz
        if not (
            vx * vx + vy * vy + vz * vz > _THIN_M2
            and vx * tx + vy * ty + vz * tz > _GONE * (tx * tx + ty * ty + tz * tz)
        ):
            return False, d, x, y, z, mx, my, mz
        e, ox, oy, oz = passed(proxy, others, voxels, tx, ty, tz, vx, vy, vz)
        if e < -_BEYOND_M:
            return False, d, x, y, z, mx, my, mz
    return True, 1.0, gx - e * ox, gy - e * oy, gz - e * oz, ox, oy, oz


def land_on_crease(
    proxy: Any,
    others: Any,
    voxels: Any,
    px: float,
    py: float,
    pz: float,
    wall: bool,
    d: float,
    x: float,
    y: float,
    z: float,
    mx: float,
    my: float,
    mz: float,
) -> tuple[float, float, float, float, float, float, float]:
    """The nearest point to the device where the goal's face and another meet, if it is behind both and nearer there.

    Args:
        proxy: the proxy.
        others: the other shapes of its solid.
        voxels: the distances of its fields.
        px: the device, with py and pz [m].
        py: see px.
        pz: see px.
        wall: whether the other face stands in the way of the goal, which has not come to it.
        d: how far off the surface the place on the other face is [m].
        x: that place, with y and z [m].
        y: see x.
        z: see x.
        mx: the normal there, with my and mz.
        my: see mx.
        mz: see mx.

    Returns:
        Distance left, point and normal as of `land`; else the place on the other face as it came.
    """
    nx = proxy.ux
    ny = proxy.uy
    nz = proxy.uz
    wx = px - proxy.gx
    wy = py - proxy.gy
    wz = pz - proxy.gz
    vx = px - x
    vy = py - y
    vz = pz - z
    turn = nx * mx + ny * my + nz * mz
    a = wx * nx + wy * ny + wz * nz  # the device off either face, < 0 behind it
    b = vx * mx + vy * my + vz * mz
    both = 1.0 - turn * turn
    first = (turn * b - a) / both  # how far along either normal from the device to where the faces meet
    second = (turn * a - b) / both
    if wall and not first > 0.0:  # up on the other face
        first = 0.0
        second = -b
    if (first > 0.0 or wall) and second > 0.0:
        e, qx, qy, qz, ox, oy, oz = land(
            proxy,
            others,
            voxels,
            px + first * nx + second * mx,
            py + first * ny + second * my,
            pz + first * nz + second * mz,
        )
        most = wx * wx + wy * wy + wz * wz if wall else vx * vx + vy * vy + vz * vz
        vx = px - qx
        vy = py - qy
        vz = pz - qz
        if vx * vx + vy * vy + vz * vz < most and -SURFACE_M <= e <= SURFACE_M:
            if wall:  # there the normal may be that of what is hidden
                return e, qx, qy, qz, mx, my, mz
            return e, qx, qy, qz, ox, oy, oz
    return d, x, y, z, mx, my, mz


def buried(proxy: Any, others: Any, voxels: Any, x: float, y: float, z: float, nx: float, ny: float, nz: float) -> bool:
    """Whether a point at distance 0 is none of the surface: there two flush shapes lie against each other."""
    d, mx, my, mz = distance(proxy, others, voxels, x + _BEYOND_M * nx, y + _BEYOND_M * ny, z + _BEYOND_M * nz)
    return d < -SURFACE_M and nx * mx + ny * my + nz * mz < _AGAINST


def ahead(
    proxy: Any, others: Any, voxels: Any, x: float, y: float, z: float, nx: float, ny: float, nz: float, reach: float
) -> tuple[float, float, float, float]:
    """Of the shapes of a union, distance and normal of the nearest that stands up from a face.

    Args:
        proxy: the proxy.
        others: the other shapes of its solid.
        voxels: the distances of its fields.
        x: a point on the face, with y and z [m].
        y: see x.
        z: see x.
        nx: the face's normal, with ny and nz.
        ny: see nx.
        nz: see nx.
        reach: what is further away does not count [m].

    Returns:
        Less than `-_BEYOND_M` where there is none; in one that is less deep the point is in the seam below it.
    """
    x += _BEYOND_M * nx
    y += _BEYOND_M * ny
    z += _BEYOND_M * nz
    d, mx, my, mz = shape_distance(proxy, voxels, x, y, z)
    turn = nx * mx + ny * my + nz * mz
    if d < -_BEYOND_M or turn > _FACE or turn < _AGAINST:
        d = -1.0
    for at in range(proxy.first_part, proxy.end_part):
        part = others[at]
        if part.bound_m >= 0.0:
            bx = x - part.bound_x
            by = y - part.bound_y
            bz = z - part.bound_z
            far = reach + part.bound_m
            if bx * bx + by * by + bz * bz > far * far:
                continue
        bx = x - part.px
        by = y - part.py
        bz = z - part.pz
        qx = part.xx * bx + part.yx * by + part.zx * bz
        qy = part.xy * bx + part.yy * by + part.zy * bz
        qz = part.xz * bx + part.yz * by + part.zz * bz
        e, qx, qy, qz = shape_distance(part, voxels, qx, qy, qz)
        if e >= -_BEYOND_M and (d < -_BEYOND_M or e < d):
            bx = part.xx * qx + part.xy * qy + part.xz * qz
            by = part.yx * qx + part.yy * qy + part.yz * qz
            bz = part.zx * qx + part.zy * qy + part.zz * qz
            turn = nx * bx + ny * by + nz * bz
            if _AGAINST <= turn <= _FACE:
                d = e
                mx = bx
                my = by
                mz = bz
    return d, mx, my, mz


def passed(
    proxy: Any, others: Any, voxels: Any, tx: float, ty: float, tz: float, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Of the shapes of a union, distance and normal of one that stands in the way of a step of the goal.

    Args:
        proxy: the proxy; its goal is on a face.
        others: the other shapes of its solid.
        voxels: the distances of its fields.
        tx: the step along the face, with ty and tz, not 0 [m].
        ty: see tx.
        tz: see tx.
        x: from the goal to where the step has landed on the surface, with y and z [m].
        y: see x.
        z: see x.

    Returns:
        Less than `-_BEYOND_M` where none does, or the step has ended before it.
    """
    nx = proxy.ux
    ny = proxy.uy
    nz = proxy.uz
    gx = proxy.gx
    gy = proxy.gy
    gz = proxy.gz
    length = sqrt(tx * tx + ty * ty + tz * tz)
    tx /= length
    ty /= length
    tz /= length
    gone = 0.0
    for _ in range(_STEPS):
        d, mx, my, mz = ahead(
            proxy, others, voxels, gx + gone * tx, gy + gone * ty, gz + gone * tz, nx, ny, nz, length - gone
        )
        if d < -_BEYOND_M:
            break
        against = tx * mx + ty * my + tz * mz
        if d < SURFACE_M and against < 0.0:
            x -= gone * tx
            y -= gone * ty
            z -= gone * tz
            behind = -(x * mx + y * my + z * mz)
            if behind > SURFACE_M and behind * behind > _BEHIND * (x * x + y * y + z * z):
                return -gone * against, mx, my, mz
            break
        gone += d if d > SURFACE_M else SURFACE_M
        if gone >= length:
            break
    return -1.0, nx, ny, nz


def trace(
    proxy: Any, others: Any, voxels: Any, x: float, y: float, z: float, px: float, py: float, pz: float, on: bool
) -> tuple[bool, float, float, float]:
    """Go from a point toward the device until the surface is met: whether it is, and where.

    Args:
        proxy: the proxy.
        others: the other shapes of its solid.
        voxels: the distances of its fields.
        x: where to start, with y and z [m].
        y: see x.
        z: see x.
        px: the device, with py and pz [m].
        py: see px.
        pz: see px.
        on: whether the start is on the surface; then only the way ahead counts.
    """
    wx = px - x
    wy = py - y
    wz = pz - z
    length = sqrt(wx * wx + wy * wy + wz * wz)
    if length > 0.0:
        wx /= length
        wy /= length
        wz /= length
    gone = SURFACE_M if on else 0.0
    nx = ny = nz = 0.0
    for _ in range(_STEPS):
        if gone >= length:
            d, nx, ny, nz = distance(proxy, others, voxels, px, py, pz)
            return d < 0.0, px, py, pz
        d, nx, ny, nz = distance(proxy, others, voxels, x + gone * wx, y + gone * wy, z + gone * wz)
        if d < SURFACE_M:
            if wx * nx + wy * ny + wz * nz < 0.0:
                break
            d = SURFACE_M
        gone += d
    else:  # a way along a surface: over it if the device is on the same side of it
        d, ex, ey, ez = distance(proxy, others, voxels, px, py, pz)
        if d >= 0.0 and nx * ex + ny * ey + nz * ez > 0.0:
            return False, px, py, pz
    return True, x + gone * wx, y + gone * wy, z + gone * wz
