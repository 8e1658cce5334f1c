"""Friction: it holds the proxy within a cone about its goal, where it would be without it.

Harwin and Melder, Eurohaptics 2002.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from hapticd.shapes.surface import SURFACE_M, land

_LEAST_M2 = 1e-16  # two places that are less than 10 nm apart are one
_LANDINGS = 6
_NEARER = 0.9
_CONE = 1.02


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
        wx = proxy.sx - px
        wy = proxy.sy - py
        wz = proxy.sz - pz
        ww = wx * wx + wy * wy + wz * wz
        x = proxy.gx + share * ex
        y = proxy.gy + share * ey
        z = proxy.gz + share * ez
        for _ in range(_LANDINGS):
            d, x, y, z, _, _, _ = land(proxy, others, voxels, x, y, z)
            if d < -SURFACE_M or d > SURFACE_M:  # to and fro between the faces of a crease: from there again
                continue
            wx = x - proxy.gx
            wy = y - proxy.gy
            wz = z - proxy.gz
            ee = wx * wx + wy * wy + wz * wz
            wx = x - px
            wy = y - py
            wz = z - pz
            vv = wx * wx + wy * wy + wz * wz
            if ee <= _CONE * free_m * free_m + _LEAST_M2 and vv <= ww:
                break
            share *= _NEARER
            if ee > free_m * free_m:  # round a corner the way along the surface is longer than the straight one
                share *= free_m / sqrt(ee)
            x = proxy.gx + share * ex
            y = proxy.gy + share * ey
            z = proxy.gz + share * ez
        else:  # no place found: it goes to the goal
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
