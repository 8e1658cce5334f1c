"""A mesh from a file: closed, facing outward, of a size; anything else is one line that says what is wrong."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from hapticd.errors import ConfigError

SUFFIXES = (".stl", ".obj")


@dataclass(frozen=True, slots=True)
class ClosedMesh:
    """A closed surface of triangles.

    Attributes:
        name: of its file.
        vertices_m: (N, 3) [m].
        faces: (M, 3) indices of vertices, counterclockwise seen from outside.
        solid: the same for trimesh.
    """

    name: str
    vertices_m: Any
    faces: Any
    solid: Any

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Sides of the box around it [m]."""
        x, y, z = (float(side) for side in np.ptp(self.vertices_m, axis=0))
        return x, y, z


def read_mesh(path: Path, scale: float = 1.0) -> ClosedMesh:
    """A mesh from an STL or OBJ file, in metres.

    Args:
        path: the file.
        scale: metres that one unit of the file is.

    Raises:
        ConfigError: it cannot be read, or is no closed surface of a size that faces outward.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise ConfigError(f"{path}: must end in {' or '.join(SUFFIXES)}")
    if not path.is_file():
        raise ConfigError(f"{path}: there is no such file")
    try:
        loaded: Any = trimesh.load_mesh(path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except Exception as error:  # noqa: BLE001 - a reader of anybody's files
        raise ConfigError(f"{path}: cannot be read: {error}".splitlines()[0]) from None
    if not isinstance(loaded, trimesh.Trimesh) or len(loaded.faces) == 0:
        raise ConfigError(f"{path}: has no triangles")
    loaded.merge_vertices(merge_tex=True, merge_norm=True)  # an STL knows corners only
    loaded.update_faces(loaded.nondegenerate_faces())
    loaded.remove_unreferenced_vertices()
    mesh = ClosedMesh(str(path), np.asarray(loaded.vertices, float) * scale, np.asarray(loaded.faces, np.int64), loaded)
    if len(mesh.faces) == 0 or not all(0.0 < side < np.inf for side in mesh.size_m):
        size = " x ".join(f"{side:g}" for side in mesh.size_m)
        raise ConfigError(f"{path}: is {size} m in size; a solid needs three sides")
    _check_closed(path, mesh.faces)
    if not loaded.is_winding_consistent:
        raise ConfigError(f"{path}: some faces look outward and some inward: recalculate its normals outside")
    if loaded.volume <= 0.0:
        raise ConfigError(f"{path}: its faces look inward: flip its normals")
    return mesh


def _check_closed(path: Path, faces: Any) -> None:
    """Refuse a mesh that has an edge with other than two faces."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    found = Counter(counts.tolist())
    open_edges, crossed = found[1], sum(many for faces_of, many in found.items() if faces_of > 2)
    if open_edges:
        raise ConfigError(f"{path}: has holes: {open_edges} open edge{'s' * (open_edges > 1)}; close them")
    if crossed:
        raise ConfigError(f"{path}: {crossed} edge{'s' * (crossed > 1)} with more than two faces; separate the parts")
