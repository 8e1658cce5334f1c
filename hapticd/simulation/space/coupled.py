"""One period of a device whose three axes share a mass matrix: arithmetic on scalar fields, interpreted or compiled."""

from __future__ import annotations

from typing import Any

from hapticd.simulation.plant.arithmetic import ROUND

WIDTH = 36
"""Numbers of one place in the table: S, P, D, R, each three by three, row by row."""


def swing(first: Any, second: Any, third: Any, table: Any, at: int, springs: Any) -> None:
    """Move three axes on by one period, under what pushes each of them.

    Args:
        first: `PlantState` of the first axis; `pushed_n` is what pushes it.
        second: the same of the second.
        third: the same of the third.
        table: `matrix.transition` of every place, one after the other.
        at: where the place's begins.
        springs: the hand's spring along each axis [N/m].
    """
    vx, vy, vz = first.v_m_per_s, second.v_m_per_s, third.v_m_per_s
    fx = first.pushed_n - springs[0] * first.x_m
    fy = second.pushed_n - springs[1] * second.x_m
    fz = third.pushed_n - springs[2] * third.x_m
    t = table
    i = at
    first.x_m += (t[i] * vx + t[i + 1] * vy + t[i + 2] * vz) + (t[i + 9] * fx + t[i + 10] * fy + t[i + 11] * fz)
    second.x_m += (t[i + 3] * vx + t[i + 4] * vy + t[i + 5] * vz) + (t[i + 12] * fx + t[i + 13] * fy + t[i + 14] * fz)
    third.x_m += (t[i + 6] * vx + t[i + 7] * vy + t[i + 8] * vz) + (t[i + 15] * fx + t[i + 16] * fy + t[i + 17] * fz)
    i = at + 18
    first.v_m_per_s = (t[i] * vx + t[i + 1] * vy + t[i + 2] * vz) + (t[i + 9] * fx + t[i + 10] * fy + t[i + 11] * fz)
    second.v_m_per_s = (t[i + 3] * vx + t[i + 4] * vy + t[i + 5] * vz) + (
        t[i + 12] * fx + t[i + 13] * fy + t[i + 14] * fz
    )
    third.v_m_per_s = (t[i + 6] * vx + t[i + 7] * vy + t[i + 8] * vz) + (
        t[i + 15] * fx + t[i + 16] * fy + t[i + 17] * fz
    )


def place_of(x_m: float, y_m: float, z_m: float, step_m: float, nx: int, ny: int, nz: int) -> int:
    """Where in the table the nearest place begins: places of a box about the origin, x slowest, z fastest.

    Args:
        x_m: where the device is [m].
        y_m: see x_m.
        z_m: see x_m.
        step_m: distance of the places [m].
        nx: how many there are along x; 1: the same everywhere.
        ny: the same along y.
        nz: the same along z.
    """
    ix = int(x_m / step_m + ROUND - ROUND) + nx // 2
    iy = int(y_m / step_m + ROUND - ROUND) + ny // 2
    iz = int(z_m / step_m + ROUND - ROUND) + nz // 2
    ix = min(max(ix, 0), nx - 1)
    iy = min(max(iy, 0), ny - 1)
    iz = min(max(iz, 0), nz - 1)
    return ((ix * ny + iy) * nz + iz) * WIDTH
