"""Where the device is, as another program's device would say it: three axes, a quaternion, buttons."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

AXES = ("x", "y", "z")

UPRIGHT = (1.0, 0.0, 0.0, 0.0)


class Cursor(NamedTuple):
    """One tick of the device.

    Attributes:
        seq: of the tick.
        position_m, velocity_m_per_s: x, y, z; 0 on an axis that the device does not have.
        orientation: w x y z, a unit quaternion; upright without a wrist.
        buttons: bit i is button i.
    """

    seq: int
    position_m: tuple[float, float, float]
    velocity_m_per_s: tuple[float, float, float]
    orientation: tuple[float, float, float, float] = UPRIGHT
    buttons: int = 0


def in_space(values: Sequence[float], axes: Sequence[str]) -> tuple[float, float, float]:
    """The x, y and z of what has one element an axis of the device.

    Args:
        values: one an axis.
        axes: their names.
    """
    of = dict(zip(axes, values, strict=False))  # a daemon that came back may have another device
    return (of.get("x", 0.0), of.get("y", 0.0), of.get("z", 0.0))


def on_axes(vector: Sequence[float], axes: Sequence[str]) -> list[float]:
    """What has x, y and z, one element an axis of the device; what it has no axis for is left out.

    Args:
        vector: x, y, z.
        axes: names of the device's axes.
    """
    return [vector[AXES.index(axis)] for axis in axes]


def quaternion(matrix: Sequence[float]) -> tuple[float, float, float, float]:
    """A rotation matrix, row by row, as w x y z; upright for an empty one.

    The largest of the four is found first, since the others are divided by it (Shepperd, J. Guidance and Control 1(3),
    1978).
    """
    if not matrix:
        return UPRIGHT
    xx, xy, xz, yx, yy, yz, zx, zy, zz = matrix
    squares = (1.0 + xx + yy + zz, 1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz)
    largest = squares.index(max(squares))
    products = (
        (squares[0], zy - yz, xz - zx, yx - xy),
        (zy - yz, squares[1], xy + yx, xz + zx),
        (xz - zx, xy + yx, squares[2], yz + zy),
        (yx - xy, xz + zx, yz + zy, squares[3]),
    )[largest]
    length = math.hypot(*products)
    w, x, y, z = (value / length for value in products)
    return (w, x, y, z)
