"""Where a solid is in the world: a position and a rotation, made once from a quaternion."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, sqrt
from typing import NamedTuple

from hapticd.errors import ConfigError

Vector = tuple[float, float, float]


class Pose(NamedTuple):
    """Position [m] and rotation: the columns of `rotation` are the own axes in the frame around."""

    position_m: Vector
    rotation: tuple[Vector, Vector, Vector]

    @classmethod
    def of(cls, position_m: Sequence[float], orientation: Sequence[float] = (1.0, 0.0, 0.0, 0.0)) -> Pose:
        """A pose from a position and a quaternion w x y z of any length but 0.

        Raises:
            ConfigError: not three and four finite numbers, or a quaternion of no length.
        """
        if len(position_m) != 3 or not all(isfinite(value) for value in position_m):
            raise ConfigError(f"position_m = {list(position_m)}: must be three finite numbers")
        if len(orientation) != 4 or not all(isfinite(value) for value in orientation):
            raise ConfigError(f"orientation = {list(orientation)}: must be four finite numbers, w x y z")
        largest = max(abs(value) for value in orientation)
        if largest == 0.0:
            raise ConfigError("orientation = [0, 0, 0, 0]: a quaternion w x y z must have a length")
        w, x, y, z = (value / largest for value in orientation)
        length = sqrt(w * w + x * x + y * y + z * z)
        w, x, y, z = w / length, x / length, y / length, z / length
        rotation = (
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
            (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        )
        x, y, z = (float(value) for value in position_m)
        return cls((x, y, z), rotation)

    @property
    def turned(self) -> bool:
        """Whether it has any rotation."""
        return self.rotation != ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    def out(self, own: Sequence[float]) -> Vector:
        """A direction of the own frame in the frame around."""
        x, y, z = own
        a, b, c = self.rotation
        return (
            a[0] * x + a[1] * y + a[2] * z,
            b[0] * x + b[1] * y + b[2] * z,
            c[0] * x + c[1] * y + c[2] * z,
        )

    def point(self, own: Sequence[float]) -> Vector:
        """A point of the own frame in the frame around."""
        x, y, z = self.out(own)
        px, py, pz = self.position_m
        return x + px, y + py, z + pz

    def own(self, point: Sequence[float]) -> Vector:
        """A point of the frame around in the own frame."""
        x, y, z = (at - origin for at, origin in zip(point, self.position_m, strict=True))
        a, b, c = self.rotation
        return (
            a[0] * x + b[0] * y + c[0] * z,
            a[1] * x + b[1] * y + c[1] * z,
            a[2] * x + b[2] * y + c[2] * z,
        )

    def seen_from(self, other: Pose) -> Pose:
        """This pose in the frame of another one."""
        columns = [other.own(self.point(axis)) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
        x, y, z = other.own(self.position_m)
        rows = tuple((columns[0][at] - o, columns[1][at] - o, columns[2][at] - o) for at, o in enumerate((x, y, z)))
        return Pose((x, y, z), (rows[0], rows[1], rows[2]))
