"""A distance field: signed distances on a grid, read between its points with eight fetches.

It takes the place of a mesh. As a file it is a header and the distances, without numpy: the loop's process reads it.
"""

from __future__ import annotations

import struct
import sys
import zlib
from array import array
from dataclasses import dataclass, field
from math import isfinite, sqrt
from typing import Any

from hapticd.errors import ConfigError

MOST_POINTS = 1 << 24
"""Points of the largest grid: 64 MiB."""

_MAGIC = b"hapticd field\n\x1a\0"
_VERSION = 1
_HEADER = struct.Struct("<16sIIII3ddddI")  # ..., CRC of the distances; behind it the CRC of all that
_CHECK = struct.Struct("<I")
_TOP = 1.0 + 1e-9  # less than the last point, which has no neighbour beyond it
_LEAST = 1e-100  # what is shorter has no direction: the square of a much shorter length is 0
_EDGE = -_LEAST  # in spacings: what is that little before the first point is on it


@dataclass(frozen=True, slots=True)
class Field:
    """Signed distances to a surface on a grid of points; the surface is all inside.

    Attributes:
        counts: points along x, y and z.
        origin_m: the first one [m].
        spacing_m: between two neighbours [m].
        margin_m: from the surface to the edge of the grid, at least [m].
        error_m: largest error of the distance between the points, near the surface [m].
        distances_m: negative inside, z running fastest; float32 [m].
        check: a number that the file of another field differs in; 0 for one that was not read from a file.
    """

    counts: tuple[int, int, int]
    origin_m: tuple[float, float, float]
    spacing_m: float
    margin_m: float
    error_m: float
    distances_m: array[float]
    check: int = field(default=0, compare=False)

    def pack(self) -> bytes:
        """The field as the content of a file."""
        content = _little(self.distances_m).tobytes()
        numbers = (*self.origin_m, self.spacing_m, self.margin_m, self.error_m)
        header = _HEADER.pack(_MAGIC, _VERSION, *self.counts, *numbers, zlib.crc32(content))
        return header + _CHECK.pack(zlib.crc32(header)) + content

    @classmethod
    def unpack(cls, content: bytes) -> Field:
        """The field in the content of a file.

        Raises:
            ConfigError: it is none, of another version, or damaged.
        """
        if content[: len(_MAGIC)] != _MAGIC:
            raise ConfigError("is no distance field; make one with: hapticd mesh FILE.stl --output FILE.field")
        start = _HEADER.size + _CHECK.size
        if len(content) < start:
            raise ConfigError("is damaged: it ends within its header")
        _, version, nx, ny, nz, *numbers, check = _HEADER.unpack_from(content)
        if version != _VERSION:
            raise ConfigError(f"is a distance field of version {version}; this hapticd reads version {_VERSION}")
        whole = zlib.crc32(content[: _HEADER.size])  # the check of the distances is in it
        if whole != _CHECK.unpack_from(content, _HEADER.size)[0]:
            raise ConfigError("is damaged: its header is not what was written")
        body = content[start:]
        if len(body) != 4 * nx * ny * nz or zlib.crc32(body) != check:
            raise ConfigError("is damaged: its distances are not what was written")
        ox, oy, oz, spacing_m, margin_m, error_m = numbers
        if min(nx, ny, nz) < 2 or nx * ny * nz > MOST_POINTS or not all(map(isfinite, numbers)) or spacing_m <= 0.0:
            raise ConfigError("is no possible distance field")
        distances_m = array("f")
        distances_m.frombytes(body)
        return cls((nx, ny, nz), (ox, oy, oz), spacing_m, margin_m, error_m, _little(distances_m), whole)

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Sides of the grid [m]."""
        x, y, z = ((count - 1) * self.spacing_m for count in self.counts)
        return x, y, z

    @property
    def centre_m(self) -> tuple[float, float, float]:
        """Middle of the grid [m]."""
        x, y, z = (start + size / 2.0 for start, size in zip(self.origin_m, self.size_m, strict=True))
        return x, y, z

    def scalars(self) -> dict[str, float | int]:
        """The scalars by which the arithmetic knows the grid."""
        nx, ny, nz = self.counts
        ox, oy, oz = self.origin_m
        return {
            "ox": ox,
            "oy": oy,
            "oz": oz,
            "per_m": 1.0 / self.spacing_m,
            "tx": nx - _TOP,
            "ty": ny - _TOP,
            "tz": nz - _TOP,
            "row": nz,
            "sheet": ny * nz,
            "margin": self.margin_m,
        }


def field_distance(shape: Any, voxels: Any, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance and normal of a field: trilinear between the points of its grid.

    Outside the grid it is what is certain, the way to the grid and the grid's margin: the surface is farther away.

    Args:
        shape: `ox`, `oy`, `oz` the first point of the grid [m], `per_m` points a metre, `tx`, `ty`, `tz` how far the
            grid goes in spacings, `row` and `sheet` how many values are between neighbours along y and x, `offset`
            where its first value is, `margin` between surface and edge of the grid [m].
        voxels: distances [m], z running fastest.
        x: the point in the field's own frame, with y and z [m].
        y: see x.
        z: see x.
    """
    u = (x - shape.ox) * shape.per_m
    v = (y - shape.oy) * shape.per_m
    w = (z - shape.oz) * shape.per_m
    if not (_EDGE <= u <= shape.tx and _EDGE <= v <= shape.ty and _EDGE <= w <= shape.tz):
        if _EDGE <= u <= shape.tx:
            u = 0.0
        elif u > 0.0:
            u -= shape.tx
        if _EDGE <= v <= shape.ty:
            v = 0.0
        elif v > 0.0:
            v -= shape.ty
        if _EDGE <= w <= shape.tz:
            w = 0.0
        elif w > 0.0:
            w -= shape.tz
        length = sqrt(u * u + v * v + w * w)
        return length / shape.per_m + shape.margin, u / length, v / length, w / length
    i = int(u)
    j = int(v)
    k = int(w)
    u -= i
    v -= j
    w -= k
    row = shape.row
    at = shape.offset + i * shape.sheet + j * row + k
    a = voxels[at]
    da = voxels[at + 1] - a
    a += w * da
    b = voxels[at + row]
    db = voxels[at + row + 1] - b
    b += w * db
    at += shape.sheet
    c = voxels[at]
    dc = voxels[at + 1] - c
    c += w * dc
    d = voxels[at + row]
    dd = voxels[at + row + 1] - d
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
    if length < _LEAST:
        return a + u * c, 0.0, 0.0, 1.0
    return a + u * c, gx / length, gy / length, gz / length


def _little(values: array[float]) -> array[float]:
    """The values in the byte order of a file, or back; the same ones on almost any computer."""
    if sys.byteorder == "little":
        return values
    values = values[:]
    values.byteswap()
    return values
