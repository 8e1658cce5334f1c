"""The proxy: a point that stays on the surface while the device is inside, and pulls it back by a spring.

It is traced along the device's way to where it meets the surface, slides as near to the device as it can, and stays on
its side: edges, corners and thin plates hold (Ruspini, Kolarov and Khatib, SIGGRAPH 1997). It moves only where that
brings it nearer to the device, which bounds what a tick can make of energy by k/2 |dp|^2. Friction holds it within a
cone about the goal, where it would be without friction (Harwin and Melder, Eurohaptics 2002).

The proxy is kept in the solid's own frame: it goes with a solid that moves. Scalars alone, so that the same source
runs interpreted in the loop and compiled in studies.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

from hapticd.shapes.surface import SURFACE_M, ahead, buried, distance, land, passed, trace

_LEAST_M2 = 1e-16
_SLIDES = 10
_LEAST_SHARE = 0.01
_CREASE = 0.02
_ONE_FACE = 0.98
_GONE = 0.5  # a step that is held before it is half done has not passed anything
_THIN_M2 = 4e-8  # what stands on a face and is thinner than 0.2 mm may be passed
_LANDINGS = 3
_WAY_OUT = 100
_CONE = 1.02
_SAME_SIDE = 0.9


def slide(proxy: Any, others: Any, voxels: Any, px: float, py: float, pz: float) -> bool:
    """Move the goal along the surface, as near to the device as it can come from where it is.

    A way that meets another face goes on along the crease of the two; one that brings it no nearer is shortened.

    Returns:
        whether the surface there faces the device's way: else it may be free.
    """
    share = 1.0
    ex = ey = ez = 0.0
    crease = False
    wx = px - proxy.gx
    wy = py - proxy.gy
    wz = pz - proxy.gz
    ww = wx * wx + wy * wy + wz * wz
    nx = proxy.ux
    ny = proxy.uy
    nz = proxy.uz
    for _ in range(_SLIDES):
        if crease:
            along = share * (wx * ex + wy * ey + wz * ez)
            tx = along * ex
            ty = along * ey
            tz = along * ez
        else:
            along = wx * nx + wy * ny + wz * nz
            tx = share * (wx - along * nx)
            ty = share * (wy - along * ny)
            tz = share * (wz - along * nz)
        if tx * tx + ty * ty + tz * tz < proxy.least_m2:
            break
        d, x, y, z, mx, my, mz = land(proxy, others, voxels, proxy.gx + tx, proxy.gy + ty, proxy.gz + tz)
        wall = False
        if proxy.end_part > proxy.first_part:
            vx = x - proxy.gx
            vy = y - proxy.gy
            vz = z - proxy.gz
            if -SURFACE_M <= d <= SURFACE_M and buried(proxy, others, voxels, x, y, z, mx, my, mz):
                wall = True  # between two shapes that are flush: what stands there is another face
                e, ox, oy, oz = ahead(proxy, others, voxels, proxy.gx, proxy.gy, proxy.gz, nx, ny, nz, inf)
            elif vx * vx + vy * vy + vz * vz > _THIN_M2 and vx * tx + vy * ty + vz * tz > _GONE * (
                tx * tx + ty * ty + tz * tz
            ):
                e, ox, oy, oz = passed(
                    proxy, others, voxels, proxy.gx, proxy.gy, proxy.gz, nx, ny, nz, tx, ty, tz, vx, vy, vz
                )
                wall = e >= -SURFACE_M
            if wall:
                if e < -SURFACE_M:
                    break
                mx = ox
                my = oy
                mz = oz
                x = proxy.gx - e * mx
                y = proxy.gy - e * my
                z = proxy.gz - e * mz
                d = 1.0
        vx = px - x
        vy = py - y
        vz = pz - z
        vv = ww if wall else vx * vx + vy * vy + vz * vz
        turn = nx * mx + ny * my + nz * mz
        if -_ONE_FACE < turn < _ONE_FACE:  # another face: where both meet, if the device is behind both
            a = wx * nx + wy * ny + wz * nz
            b = vx * mx + vy * my + vz * mz
            both = 1.0 - turn * turn
            first = (turn * b - a) / both
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
                tx = px - qx
                ty = py - qy
                tz = pz - qz
                tt = tx * tx + ty * ty + tz * tz
                if tt < vv and -SURFACE_M <= e <= SURFACE_M:
                    d = e
                    x = qx
                    y = qy
                    z = qz
                    if not wall:  # else the normal may be that of what is hidden
                        mx = ox
                        my = oy
                        mz = oz
                    vx = tx
                    vy = ty
                    vz = tz
                    vv = tt
        if vv < ww and -SURFACE_M <= d <= SURFACE_M:
            gained = ww - vv
            proxy.gx = x
            proxy.gy = y
            proxy.gz = z
            proxy.ux = nx = mx
            proxy.uy = ny = my
            proxy.uz = nz = mz
            wx = vx
            wy = vy
            wz = vz
            ww = vv
            if gained < proxy.least_m2 and turn > _ONE_FACE:
                break
            share = 1.0
            crease = False
        else:
            if wx * mx + wy * my + wz * mz >= 0.0:
                vx = x - proxy.gx
                vy = y - proxy.gy
                vz = z - proxy.gz
                if vx * vx + vy * vy + vz * vz < _LEAST_M2:  # over an edge: seen from this face it may be free
                    proxy.ux = nx = mx
                    proxy.uy = ny = my
                    proxy.uz = nz = mz
                    break
            ex = ny * mz - nz * my
            ey = nz * mx - nx * mz
            ez = nx * my - ny * mx
            ee = ex * ex + ey * ey + ez * ez
            if ee > _CREASE and not crease:
                ee = sqrt(ee)
                ex /= ee
                ey /= ee
                ez /= ee
                crease = True
            else:
                share *= 0.25
                if share < _LEAST_SHARE:
                    break
    read(proxy, wx, wy, wz, ww)
    facing: bool = wx * nx + wy * ny + wz * nz < 0.0
    return facing


def follow(proxy: Any, others: Any, voxels: Any, x: float, y: float, z: float) -> None:
    """See where the device is now, and bring proxy and readings there.

    Args:
        proxy: the proxy.
        others: the other shapes of its solid.
        voxels: the distances of its fields.
        x: the device in the world, with y and z [m].
        y: see x.
        z: see x.
    """
    x -= proxy.px
    y -= proxy.py
    z -= proxy.pz
    if proxy.turned:
        wx = x
        wy = y
        x = proxy.xx * wx + proxy.yx * wy + proxy.zx * z
        y = proxy.xy * wx + proxy.yy * wy + proxy.zy * z
        z = proxy.xz * wx + proxy.yz * wy + proxy.zz * z
    if proxy.touching:
        if proxy.exact:
            d, nx, ny, nz = distance(proxy, others, voxels, x, y, z)
            # The nearest point of a convex solid on this side, or of all the walls of a convex room.
            if proxy.ux * nx + proxy.uy * ny + proxy.uz * nz > _SAME_SIDE or proxy.sign < 0.0:
                if d >= 0.0:
                    release(proxy, x, y, z, d)
                    return
                proxy.gx = x - d * nx
                proxy.gy = y - d * ny
                proxy.gz = z - d * nz
                proxy.ux = nx
                proxy.uy = ny
                proxy.uz = nz
                proxy.depth_m = -d
                if proxy.turned:
                    turn_out(proxy, nx, ny, nz)
                else:
                    proxy.normal_x = nx
                    proxy.normal_y = ny
                    proxy.normal_z = nz
                if proxy.rough:
                    rub(proxy, others, voxels, x, y, z)
                return
        if not slide(proxy, others, voxels, x, y, z):
            hit, gx, gy, gz = trace(proxy, others, voxels, proxy.gx, proxy.gy, proxy.gz, x, y, z, True)
            if not hit:
                d, nx, ny, nz = distance(proxy, others, voxels, x, y, z)
                release(proxy, x, y, z, d)
                return
            before_m = proxy.depth_m
            wx = proxy.gx
            wy = proxy.gy
            wz = proxy.gz
            meet(proxy, others, voxels, gx, gy, gz)
            slide(proxy, others, voxels, x, y, z)
            if proxy.depth_m > before_m:
                proxy.gx = wx
                proxy.gy = wy
                proxy.gz = wz
                wx = x - wx
                wy = y - wy
                wz = z - wz
                read(proxy, wx, wy, wz, wx * wx + wy * wy + wz * wz)
    else:
        d, nx, ny, nz = distance(proxy, others, voxels, x, y, z)
        wx = x - proxy.gx
        wy = y - proxy.gy
        wz = z - proxy.gz
        both = d + proxy.d
        if d > 0.0 and wx * wx + wy * wy + wz * wz <= both * both:
            proxy.gx = x
            proxy.gy = y
            proxy.gz = z
            proxy.d = d
            return
        hit, gx, gy, gz = trace(proxy, others, voxels, proxy.gx, proxy.gy, proxy.gz, x, y, z, False)
        if not hit:
            release(proxy, x, y, z, d)
            return
        proxy.touching = True
        meet(proxy, others, voxels, gx, gy, gz)
        proxy.sx = proxy.gx
        proxy.sy = proxy.gy
        proxy.sz = proxy.gz
        slide(proxy, others, voxels, x, y, z)
    if proxy.rough:
        rub(proxy, others, voxels, x, y, z)


def place(proxy: Any, others: Any, voxels: Any, x: float, y: float, z: float) -> None:
    """Begin at a point of the world: free, or on the surface nearest to it; what was before is forgotten."""
    x -= proxy.px
    y -= proxy.py
    z -= proxy.pz
    if proxy.turned:
        wx = x
        wy = y
        x = proxy.xx * wx + proxy.yx * wy + proxy.zx * z
        y = proxy.xy * wx + proxy.yy * wy + proxy.zy * z
        z = proxy.xz * wx + proxy.yz * wy + proxy.zz * z
    d, _, _, _ = distance(proxy, others, voxels, x, y, z)
    release(proxy, x, y, z, d)
    if d < 0.0:
        proxy.touching = True
        meet(proxy, others, voxels, x, y, z)
        slide(proxy, others, voxels, x, y, z)
        proxy.sx = proxy.gx
        proxy.sy = proxy.gy
        proxy.sz = proxy.gz


def release(proxy: Any, x: float, y: float, z: float, d: float) -> None:
    """Be free where the device is."""
    proxy.touching = False
    proxy.sliding = False
    proxy.gx = x
    proxy.gy = y
    proxy.gz = z
    proxy.d = d
    proxy.depth_m = 0.0
    proxy.stretch_x = proxy.stretch_y = proxy.stretch_z = 0.0
    proxy.lost_m2 = 0.0


def meet(proxy: Any, others: Any, voxels: Any, x: float, y: float, z: float) -> None:
    """Put the goal on the surface near a point; where two shapes send it to and fro, straight out of both."""
    d, gx, gy, gz, nx, ny, nz = land(proxy, others, voxels, x, y, z)
    if d > SURFACE_M or d < -SURFACE_M:
        d, nx, ny, nz = distance(proxy, others, voxels, x, y, z)
        ux = nx
        uy = ny
        uz = nz
        for _ in range(_WAY_OUT):
            if d > -SURFACE_M:
                break
            x -= d * ux
            y -= d * uy
            z -= d * uz
            d, nx, ny, nz = distance(proxy, others, voxels, x, y, z)
        d, gx, gy, gz, nx, ny, nz = land(proxy, others, voxels, x, y, z)
    proxy.gx = gx
    proxy.gy = gy
    proxy.gz = gz
    proxy.ux = nx
    proxy.uy = ny
    proxy.uz = nz


def read(proxy: Any, x: float, y: float, z: float, square: float) -> None:
    """Give out depth and normal, from the way that the device is away from the goal and its square."""
    proxy.depth_m = depth_m = sqrt(square)
    if depth_m > 1e-12:
        turn_out(proxy, -x / depth_m, -y / depth_m, -z / depth_m)
    else:
        turn_out(proxy, proxy.ux, proxy.uy, proxy.uz)


def turn_out(proxy: Any, x: float, y: float, z: float) -> None:
    """Give out the normal in the world's frame."""
    if proxy.turned:
        proxy.normal_x = proxy.xx * x + proxy.xy * y + proxy.xz * z
        proxy.normal_y = proxy.yx * x + proxy.yy * y + proxy.yz * z
        proxy.normal_z = proxy.zx * x + proxy.zy * y + proxy.zz * z
    else:
        proxy.normal_x = x
        proxy.normal_y = y
        proxy.normal_z = z


def rub(proxy: Any, others: Any, voxels: Any, px: float, py: float, pz: float) -> None:
    """Hold the proxy within the cone of friction about its goal: it sticks, or slips to the cone's edge."""
    proxy.lost_m2 = 0.0
    ex = proxy.sx - proxy.gx
    ey = proxy.sy - proxy.gy
    ez = proxy.sz - proxy.gz
    ee = ex * ex + ey * ey + ez * ez
    friction = proxy.dynamic_friction if proxy.sliding else proxy.static_friction
    free_m = friction * proxy.depth_m
    if ee <= free_m * free_m:
        proxy.sliding = False
    else:
        proxy.sliding = True
        free_m = proxy.dynamic_friction * proxy.depth_m
        share = free_m / sqrt(ee)
        for _ in range(_LANDINGS):  # round a corner the way along the surface is longer than the straight one
            d, x, y, z, _, _, _ = land(
                proxy, others, voxels, proxy.gx + share * ex, proxy.gy + share * ey, proxy.gz + share * ez
            )
            wx = x - proxy.gx
            wy = y - proxy.gy
            wz = z - proxy.gz
            vv = wx * wx + wy * wy + wz * wz
            if vv <= _CONE * free_m * free_m + _LEAST_M2:
                break
            share *= 0.9 * free_m / sqrt(vv)
        else:
            d = 1.0  # no place found: it goes to the goal
        wx = proxy.sx - px
        wy = proxy.sy - py
        wz = proxy.sz - pz
        ww = wx * wx + wy * wy + wz * wz
        wx = x - px
        wy = y - py
        wz = z - pz
        vv = wx * wx + wy * wy + wz * wz
        if not (vv <= ww and -SURFACE_M <= d <= SURFACE_M):
            x = proxy.gx
            y = proxy.gy
            z = proxy.gz
            vv = proxy.depth_m * proxy.depth_m
        if vv <= ww:
            proxy.lost_m2 = 0.5 * (ww - vv)
            proxy.sx = x
            proxy.sy = y
            proxy.sz = z
            ex = x - proxy.gx
            ey = y - proxy.gy
            ez = z - proxy.gz
    if proxy.turned:
        proxy.stretch_x = proxy.xx * ex + proxy.xy * ey + proxy.xz * ez
        proxy.stretch_y = proxy.yx * ex + proxy.yy * ey + proxy.yz * ez
        proxy.stretch_z = proxy.zx * ex + proxy.zy * ey + proxy.zz * ez
    else:
        proxy.stretch_x = ex
        proxy.stretch_y = ey
        proxy.stretch_z = ez
