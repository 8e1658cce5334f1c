"""Where a solid bends inwards: the proxy is pinned in the crease, and the device swings across on the full spring.

That leaks K T / 2 across as any held spring does, in a direction that the law of the normal never sees. So the channels
stay as they are while the proxy is pinned, and one along the surface, in a corner two, has what the spring has across.
A surface that turns by itself has its proxy go along: there the normal alone does, and nothing else is run.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from hapticd.shapes.pose import Vector

TURNED = 0.94
"""Cosine of the turn of a direction, 20 degrees, after which a law forgets what it found out about it.

A mass that was felt belongs to a direction: a damper that one axis bears may shake another that is five times lighter.
What the law has learnt to be its damping goes on, under the bound that it gives itself while it knows no mass.
"""

_LEAST_M = 3e-6
"""A shorter way in a tick says nothing about where the proxy goes: a mesh places it to 2 um."""

_LEANS = 0.25
"""Cosine between spring and normal, 75 degrees, beyond which channels that stayed are laid anew."""

_OFF_M = 1e-4
"""How far beyond its depth the proxy may be off the crease before the channels let go: a shallow swing crosses it."""


def grip(contact: Any, proxy: Any, way: Vector) -> Vector:
    """Find out in how many directions the proxy is pinned: `contact.grip`, none to two; the device touches.

    Of what the device goes across its spring the proxy goes all along on a plane, and nothing in a crease.

    Args:
        contact: of a solid that may crease.
        proxy: its proxy, which knows the new sample.
        way: of the device since the last sample [m].

    Returns:
        The normal for its channels.
    """
    normal, first, second = contact.channels
    nx, ny, nz = proxy.normal_x, proxy.normal_y, proxy.normal_z
    fx, fy, fz = normal.dx, normal.dy, normal.dz
    if contact.leaving:  # what fades out stays as it is
        return (nx, ny, nz) if contact.grip == 0 else (fx, fy, fz)
    depth_m = proxy.depth_m
    tx, ty, tz = depth_m * nx, depth_m * ny, depth_m * nz
    rx, ry, rz = tx - contact.to_x, ty - contact.to_y, tz - contact.to_z
    contact.to_x, contact.to_y, contact.to_z = tx, ty, tz
    if not normal.in_contact:
        contact.grip = 0
        return nx, ny, nz
    if contact.grip == 0:
        along = rx * nx + ry * ny + rz * nz
        ex, ey, ez = rx - along * nx, ry - along * ny, rz - along * nz
        left_m = sqrt(ex * ex + ey * ey + ez * ez)
        if left_m > _LEAST_M:
            ex, ey, ez = ex / left_m, ey / left_m, ez / left_m
            gone_m = (way[0] + rx) * ex + (way[1] + ry) * ey + (way[2] + rz) * ez
            if abs(gone_m) < 0.5 * left_m:
                contact.grip = 1
                contact.off_m = 0.0
                if not proxy.rough:
                    if abs(first.dx * ex + first.dy * ey + first.dz * ez) < TURNED:
                        contact.turned = True
                    first.dx, first.dy, first.dz = ex, ey, ez
        return nx, ny, nz
    contact.off_m += _gone_m(first, way, rx, ry, rz)
    leans = depth_m * (fx * nx + fy * ny + fz * nz) <= _LEANS * depth_m  # also where no depth is left
    if leans or abs(contact.off_m) > depth_m + _OFF_M:
        contact.grip = 0
        return nx, ny, nz
    if proxy.rough:
        return fx, fy, fz
    left_m = rx * second.dx + ry * second.dy + rz * second.dz
    gone_m = _gone_m(second, way, rx, ry, rz)
    if contact.grip == 2:
        if abs(gone_m) > _LEAST_M and abs(gone_m) > 0.5 * abs(gone_m - left_m):
            contact.grip = 1
    elif abs(left_m) > _LEAST_M and abs(gone_m) < 0.5 * abs(left_m):
        contact.grip = 2
    if contact.grip == 2:
        return fx, fy, fz
    # Along the crease nothing is stretched: the normal is what the spring has beside the first direction.
    across_m = tx * first.dx + ty * first.dy + tz * first.dz
    fx, fy, fz = tx - across_m * first.dx, ty - across_m * first.dy, tz - across_m * first.dz
    length_m = sqrt(fx * fx + fy * fy + fz * fz)
    return fx / length_m, fy / length_m, fz / length_m


def _gone_m(channel: Any, way: Vector, rx: float, ry: float, rz: float) -> float:
    """How far the proxy has gone along a channel [m]."""
    gone_m: float = (way[0] + rx) * channel.dx + (way[1] + ry) * channel.dy + (way[2] + rz) * channel.dz
    return gone_m
