"""Distances to a mesh on a grid, by libigl, and how far trilinear reading is off between the points."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import igl
import numpy as np

from hapticd.errors import ConfigError
from hapticd.shapes.field import MOST_POINTS, Field
from hapticd_views.mesh.reading import ClosedMesh

MARGIN = 2.5
"""Spacings of grid around the surface."""

SAMPLES = 200_000
"""Points at which the error is looked at, before those along edges."""

ERROR_MARGIN = 1.1
"""The stated bound over the largest error that was found."""

_SHARP_RAD = math.radians(5.0)
_CHUNK = 1 << 16

Advance = Callable[..., None]


@dataclass(frozen=True, slots=True)
class FieldError:
    """How far a field is off near its surface.

    Attributes:
        largest_m: of all points looked at [m].
        typical_m: root mean square over points on the surface and up to a spacing to both sides [m].
        points: how many were looked at.
    """

    largest_m: float
    typical_m: float
    points: int


def sample(mesh: ClosedMesh, spacing_m: float, advance: Advance = lambda **_: None) -> tuple[Field, FieldError]:
    """A distance field of a mesh.

    Args:
        mesh: the closed surface.
        spacing_m: between points of the grid [m].
        advance: is told `completed=`, a share of the work.

    Raises:
        ConfigError: more points than a field may have, or a surface too thin for the spacing.
    """
    counts = grid_counts(mesh, spacing_m)
    low = mesh.vertices_m.min(axis=0)
    size = mesh.vertices_m.max(axis=0) - low
    origin = low - 0.5 * ((np.array(counts) - 1) * spacing_m - size)
    axes = [start + spacing_m * np.arange(count) for start, count in zip(origin, counts, strict=True)]
    values = np.empty(counts, np.float32)
    slab = max(1, _CHUNK // (counts[1] * counts[2]))
    for first in range(0, counts[0], slab):
        part = axes[0][first : first + slab]
        points = np.stack(np.meshgrid(part, axes[1], axes[2], indexing="ij"), axis=-1).reshape(-1, 3)
        values[first : first + slab] = distances(mesh, points).reshape(len(part), counts[1], counts[2])
        advance(completed=0.9 * (first + len(part)) / counts[0])
    error = measure_error(mesh, values, origin, spacing_m)
    advance(completed=1.0)
    distances_m = array("f")
    distances_m.frombytes(values.tobytes())
    ox, oy, oz = (float(each) for each in origin)
    bound_m = ERROR_MARGIN * error.largest_m
    field = Field(counts, (ox, oy, oz), spacing_m, (MARGIN - 0.5) * spacing_m, bound_m, distances_m)
    if float(values.min()) > -0.5 * spacing_m:
        raise ConfigError(
            f"{mesh.name}: is nowhere thicker than {2.0 * -min(0.0, float(values.min())):.3g} m: a spacing of "
            f"{spacing_m:g} m does not see it; give a smaller --voxel"
        )
    return field, error


def grid_counts(mesh: ClosedMesh, spacing_m: float) -> tuple[int, int, int]:
    """Points of the grid along each axis.

    Raises:
        ConfigError: more than a field may have.
    """
    sides = mesh.size_m
    nx, ny, nz = (math.ceil(side / spacing_m + 2.0 * MARGIN) + 1 for side in sides)
    if nx * ny * nz > MOST_POINTS:
        least_m = spacing_m
        while math.prod(side / least_m + 2.0 * MARGIN + 2.0 for side in sides) > MOST_POINTS:
            least_m *= 1.02
        size = " x ".join(f"{side:.3g}" for side in sides)
        raise ConfigError(
            f"{mesh.name}: is {size} m: {nx} x {ny} x {nz} points, at most {MOST_POINTS} fit; give --voxel "
            f"{least_m:.2g} or more, or --scale 0.001 if the file is in millimetres"
        )
    return nx, ny, nz


def distances(mesh: ClosedMesh, points: Any) -> Any:
    """Signed distances of points to a mesh, negative inside [m]."""
    found = igl.signed_distance(np.ascontiguousarray(points), mesh.vertices_m, mesh.faces)
    return np.asarray(found[0])


def trilinear(values: Any, origin: Any, spacing_m: float, points: Any) -> Any:
    """A field's distances at points inside its grid, as `field_distance` reads them [m]."""
    at = (points - origin) / spacing_m
    cell = np.minimum(at.astype(np.int64), np.array(values.shape) - 2)
    u, v, w = (at - cell).T
    i, j, k = cell.T
    grid = values.astype(float)
    total = np.zeros(len(points))
    for a, along_x in ((0, 1.0 - u), (1, u)):
        for b, along_y in ((0, 1.0 - v), (1, v)):
            for c, along_z in ((0, 1.0 - w), (1, w)):
                total += along_x * along_y * along_z * grid[i + a, j + b, k + c]
    return total


def measure_error(mesh: ClosedMesh, values: Any, origin: Any, spacing_m: float) -> FieldError:
    """How far a field is off, at random points of the surface and near it, and along all sharp edges."""
    rng = np.random.default_rng(1)
    corners = mesh.vertices_m[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across, axis=1)
    normals = across / np.maximum(area, 1e-300)[:, None]
    chosen = rng.choice(len(area), SAMPLES, p=area / area.sum())
    a, b = rng.random((2, SAMPLES))
    over = a + b > 1.0
    a[over], b[over] = 1.0 - a[over], 1.0 - b[over]
    where = corners[chosen]
    on = where[:, 0] + a[:, None] * (where[:, 1] - where[:, 0]) + b[:, None] * (where[:, 2] - where[:, 0])
    off = spacing_m * rng.uniform(-1.0, 1.0, SAMPLES)
    off[::2] = 0.0
    near = on + off[:, None] * normals[chosen]
    errors = np.abs(trilinear(values, origin, spacing_m, near) - distances(mesh, near))
    along = _along_edges(mesh, spacing_m)
    at_edges = np.abs(trilinear(values, origin, spacing_m, along))  # the surface is there
    largest = float(max(errors.max(), at_edges.max(initial=0.0)))
    return FieldError(largest, float(np.sqrt(np.mean(errors**2))), len(near) + len(along))


def _along_edges(mesh: ClosedMesh, spacing_m: float) -> Any:
    """Points along edges that are sharp, eight a spacing or as many as there is room for, and all vertices."""
    solid = mesh.solid
    sharp = solid.face_adjacency_edges[solid.face_adjacency_angles > _SHARP_RAD]
    if len(sharp) == 0:
        return mesh.vertices_m
    ends = mesh.vertices_m[sharp]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    step_m = max(spacing_m / 8.0, float(length.sum()) / SAMPLES)
    points = [mesh.vertices_m]
    for (start, end), long in zip(ends, length, strict=True):
        share = np.linspace(0.0, 1.0, math.ceil(long / step_m) + 1)[:, None]
        points.append(start + share * (end - start))
    return np.concatenate(points)
