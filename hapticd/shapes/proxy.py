"""The proxy: a point that stays on the surface while the device is inside, and pulls it back by a spring.

It is traced along the device's way to where it meets the surface, slides as near to the device as it can, and stays on
its side: edges, corners and thin plates hold (Ruspini, Kolarov and Khatib, SIGGRAPH 1997). It moves only where that
brings it nearer to the device, which bounds what a tick can make of energy by k/2 |dp|^2. Where there is friction, that
is its goal, and `hapticd.shapes.friction` says how far it stays behind.

The proxy is kept in the solid's own frame: it goes with a solid that moves. Scalars alone, so that the same source
runs interpreted in the loop and compiled in studies.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

from hapticd.shapes.friction import rub
from hapticd.shapes.surface import SURFACE_M, distance, land, land_in_union, land_on_crease, trace
from hapticd.shapes.way_out import land_outside

_LEAST_M2 = 1e-16  # two places that are less than 10 nm apart are one
_SLIDES = 10
_LEAST_SHARE = 0.01
_CREASE = 0.02  # squared sine of 8 degrees: two faces that meet at less have no crease
_ONE_FACE = 0.98  # cosine of 11 degrees: two normals that differ by less are of one face
_PACE = 4.0  # in a tick the goal moves at most 4 times as far as the device; on a ball that is at 3/4 of the radius
_SAME_SIDE = 0.9  # cosine of 26 degrees
_LITTLE = 4e-4  # square of a share of the depth: a goal that goes no further than 2 % changes the force by no more
_OFF_M = (1e-4, 1e-3, 1e-2)  # before a surface that was, one that is to be may begin so far


def slide(proxy: Any, others: Any, voxels: Any, px: float, py: float, pz: float, left_m: float) -> bool:
    """Move the goal along the surface, as near to the device as it can come from where it is.

    A way that meets another face goes on along the crease of the two; one that brings it no nearer is shortened.

    Args:
        proxy: the proxy.
        others: the other shapes of its solid.
        voxels: the distances of its fields.
        px: the device, with py and pz [m].
        py: see px.
        pz: see px.
        left_m: how far it may go [m]. Without a bound it runs round a ball that the device is past the centre of,
            whatever tiny way off the axis that is, and off a rounded edge that the device is deep in, all in one tick.

    Returns:
        whether the surface there faces the device's way: else it may be free.
    """
    share = 1.0
    ex = ey = ez = 0.0
    crease = far = False
    wx = px - proxy.gx
    wy = py - proxy.gy
    wz = pz - proxy.gz
    ww = wx * wx + wy * wy + wz * wz
    nx = proxy.ux
    ny = proxy.uy
    nz = proxy.uz
    for _ in range(_SLIDES):
        # a step along the face or the crease, and where it ends
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
        wall = False
        if proxy.end_part > proxy.first_part:
            wall, d, x, y, z, mx, my, mz = land_in_union(proxy, others, voxels, tx, ty, tz)
            if d == inf:
                break
        else:
            d, x, y, z, mx, my, mz = land(proxy, others, voxels, proxy.gx + tx, proxy.gy + ty, proxy.gz + tz)
        turn = nx * mx + ny * my + nz * mz
        if -_ONE_FACE < turn < _ONE_FACE and not far:
            d, x, y, z, mx, my, mz = land_on_crease(proxy, others, voxels, px, py, pz, wall, d, x, y, z, mx, my, mz)

        # nearer: there it is
        vx = px - x
        vy = py - y
        vz = pz - z
        vv = vx * vx + vy * vy + vz * vz
        vx = x - proxy.gx
        vy = y - proxy.gy
        vz = z - proxy.gz
        if vv < ww and -SURFACE_M <= d <= SURFACE_M:
            gone_m = sqrt(vx * vx + vy * vy + vz * vz)
            if gone_m > left_m:  # that way as far as it may go: a shorter step may lead to the same far crease
                part = sqrt(0.99 * left_m / (gone_m * (wx * vx + wy * vy + wz * vz)))
                ex, ey, ez = part * vx, part * vy, part * vz
                share = 1.0
                crease = far = True
                continue
            left_m -= gone_m
            gained = ww - vv
            proxy.gx = x
            proxy.gy = y
            proxy.gz = z
            proxy.ux = nx = mx
            proxy.uy = ny = my
            proxy.uz = nz = mz
            wx = px - x
            wy = py - y
            wz = pz - z
            ww = vv
            if gained < proxy.least_m2 and turn > _ONE_FACE:
                break
            share = 1.0
            crease = far = False
            continue

        # over an edge: seen from this face it may be free
        if wx * mx + wy * my + wz * mz >= 0.0 and vx * vx + vy * vy + vz * vz < _LEAST_M2:
            proxy.ux = nx = mx
            proxy.uy = ny = my
            proxy.uz = nz = mz
            break

        # no nearer: along the crease with that face, else not as far
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
    proxy.left_m = left_m
    proxy.lx = px
    proxy.ly = py
    proxy.lz = pz
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
            turn = proxy.ux * nx + proxy.uy * ny + proxy.uz * nz
            if turn > _SAME_SIDE or proxy.sign < 0.0:
                if d >= 0.0:
                    release(proxy, x, y, z, d)
                    return
                if proxy.sign < 0.0 or in_reach(proxy, x, y, z, d, nx, ny, nz):
                    proxy.gx = x - d * nx
                    proxy.gy = y - d * ny
                    proxy.gz = z - d * nz
                    proxy.ux = nx
                    proxy.uy = ny
                    proxy.uz = nz
                    proxy.depth_m = -d
                    proxy.lx = x
                    proxy.ly = y
                    proxy.lz = z
                    if proxy.turned:
                        turn_out(proxy, nx, ny, nz)
                    else:
                        proxy.normal_x = nx
                        proxy.normal_y = ny
                        proxy.normal_z = nz
                    if proxy.rough:
                        rub(proxy, others, voxels, x, y, z)
                    return
        wx = x - proxy.lx
        wy = y - proxy.ly
        wz = z - proxy.lz
        left_m = _PACE * sqrt(wx * wx + wy * wy + wz * wz)
        if not slide(proxy, others, voxels, x, y, z, left_m) and not hold_on(proxy, others, voxels, x, y, z):
            return
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
        if proxy.d < 0.0:  # let be in it: free until it has left
            release(proxy, x, y, z, d)
            return
        if not come_in(proxy, others, voxels, x, y, z, d):
            return
    if proxy.rough:
        rub(proxy, others, voxels, x, y, z)


def in_reach(proxy: Any, x: float, y: float, z: float, d: float, nx: float, ny: float, nz: float) -> bool:
    """Whether the goal may go to the foot of the device within this tick: as far as its pace allows, or by little."""
    vx = x - d * nx - proxy.gx
    vy = y - d * ny - proxy.gy
    vz = z - d * nz - proxy.gz
    gone_m2 = vx * vx + vy * vy + vz * vz
    if gone_m2 <= _LITTLE * d * d:
        return True
    wx = x - proxy.lx
    wy = y - proxy.ly
    wz = z - proxy.lz
    near: bool = gone_m2 <= _PACE * _PACE * (wx * wx + wy * wy + wz * wz)
    return near


def hold_on(proxy: Any, others: Any, voxels: Any, x: float, y: float, z: float) -> bool:
    """Of a face that the device is in front of, go on to another one behind which it is; else let it go free."""
    hit, gx, gy, gz = trace(proxy, others, voxels, proxy.gx, proxy.gy, proxy.gz, x, y, z, True)
    if not hit:
        d, _, _, _ = distance(proxy, others, voxels, x, y, z)
        release(proxy, x, y, z, d)
        return False
    before_m = proxy.depth_m
    wx = proxy.gx
    wy = proxy.gy
    wz = proxy.gz
    meet(proxy, others, voxels, gx, gy, gz)  # where it finds no surface, the goal stays where it is
    slide(proxy, others, voxels, x, y, z, proxy.left_m)
    if proxy.depth_m > before_m:  # by less than a micrometre, so that the normal of that face is right
        proxy.gx = wx
        proxy.gy = wy
        proxy.gz = wz
        wx = x - wx
        wy = y - wy
        wz = z - wz
        read(proxy, wx, wy, wz, wx * wx + wy * wy + wz * wz)
    return True


def come_in(proxy: Any, others: Any, voxels: Any, x: float, y: float, z: float, d: float) -> bool:
    """Stop a free device at the surface that its way meets; where it meets none it stays free, d [m] away."""
    hit, gx, gy, gz = trace(proxy, others, voxels, proxy.gx, proxy.gy, proxy.gz, x, y, z, False)
    if not hit or not meet(proxy, others, voxels, gx, gy, gz):
        release(proxy, x, y, z, d)
        return False
    proxy.touching = True
    proxy.sx = proxy.gx
    proxy.sy = proxy.gy
    proxy.sz = proxy.gz
    slide(proxy, others, voxels, x, y, z, inf)
    return True


def place(proxy: Any, others: Any, voxels: Any, x: float, y: float, z: float) -> None:
    """Begin at a point of the world: free, or on the surface nearest to it; what was before is forgotten.

    Where no way out of the solid is found the device is let be, free until it has left: no force is better than one
    toward a place that is none.
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
    d, _, _, _ = distance(proxy, others, voxels, x, y, z)
    release(proxy, x, y, z, d)
    if d < 0.0 and meet(proxy, others, voxels, x, y, z):
        proxy.touching = True
        slide(proxy, others, voxels, x, y, z, inf)
        proxy.sx = proxy.gx
        proxy.sy = proxy.gy
        proxy.sz = proxy.gz


def place_before(proxy: Any, others: Any, voxels: Any, held: Any, x: float, y: float, z: float) -> bool:
    """Begin before the surface on which another solid has held the device, as one that has yet to come in from there.

    Args:
        proxy: of the solid that is to be.
        others: its other shapes.
        voxels: the distances of its fields.
        held: the proxy of the solid that was.
        x: the device in the world, with y and z [m].
        y: see x.
        z: see x.

    Returns:
        whether that is outside: else the solid that is to be is there, and its nearest surface has been found.
    """
    for off_m in _OFF_M:
        reach_m = held.depth_m + off_m
        place(
            proxy,
            others,
            voxels,
            x + reach_m * held.normal_x,
            y + reach_m * held.normal_y,
            z + reach_m * held.normal_z,
        )
        if not proxy.touching and proxy.d >= 0.0:
            return True
    return False


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


def meet(proxy: Any, others: Any, voxels: Any, x: float, y: float, z: float) -> bool:
    """Put the goal on the surface near a point; where shapes send it to and fro, straight out of all of them.

    Returns:
        whether that was found; else the goal is as it was.
    """
    d, gx, gy, gz, nx, ny, nz = land(proxy, others, voxels, x, y, z)
    if d > SURFACE_M or d < -SURFACE_M:
        d, gx, gy, gz, nx, ny, nz = land_outside(proxy, others, voxels, x, y, z)
        if d > SURFACE_M or d < -SURFACE_M:
            return False
    proxy.gx = gx
    proxy.gy = gy
    proxy.gz = gz
    proxy.ux = nx
    proxy.uy = ny
    proxy.uz = nz
    return True


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
