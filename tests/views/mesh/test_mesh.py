"""`hapticd mesh`: meshes made here, the distance fields made of them, and the errors that these state."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from hapticd.cli import main
from hapticd.shapes.field import Field
from hapticd.shapes.pose import Pose
from hapticd.shapes.solid import Part, Placed, Proxy
from hapticd.shapes.surface import distance
from hapticd_views.mesh.reading import read_mesh
from hapticd_views.mesh.sampling import distances, trilinear
from tests.shapes.walks import HERE, go, spring, stand

RADIUS_M = 0.03


def ball(faces: int = 4) -> Any:
    return trimesh.creation.icosphere(subdivisions=faces, radius=RADIUS_M)


def saved(folder: Path, mesh: Any, name: str = "mesh.stl") -> Path:
    path = folder / name
    mesh.export(path)
    return path


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    """The command's exit status and what it says."""
    with pytest.raises(SystemExit) as end:
        main(["mesh", *map(str, words)])
    said = capsys.readouterr()
    return int(end.value.code or 0), said.out, said.err


@pytest.mark.parametrize(
    ("mesh", "name", "voxel"),
    [
        (ball(), "ball.stl", 0.002),
        (trimesh.creation.box((0.04, 0.03, 0.02)), "box.obj", 0.00125),
        (trimesh.creation.torus(0.02, 0.006), "torus.stl", 0.00125),
        (trimesh.creation.annulus(0.008, 0.02, 0.01), "ring.obj", 0.001),
    ],
    ids=lambda each: each if isinstance(each, str) else "",
)
def test_the_stated_error_holds_at_points_that_were_not_looked_at(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], mesh: Any, name: str, voxel: float
) -> None:
    """Random points of the surface, on it and up to a voxel off it, by another generator and another seed."""
    path = saved(tmp_path, mesh, name)
    status, out, _ = run(capsys, path, "--voxel", voxel, "--json")
    assert status == 0
    told = json.loads(out)
    field = Field.unpack((tmp_path / name).with_suffix(".field").read_bytes())
    assert told["error_bound_m"] == field.error_m
    assert tuple(told["points"]) == field.counts
    closed = read_mesh(path)
    on, faces = trimesh.sample.sample_surface(mesh, 20_000, seed=7)
    off = np.random.default_rng(8).uniform(-voxel, voxel, len(on))[:, None] * mesh.face_normals[faces]
    points = np.concatenate([on, on + off, mesh.vertices])
    values = np.array(field.distances_m).reshape(field.counts)
    error = np.abs(trilinear(values, field.origin_m, field.spacing_m, points) - distances(closed, points))
    assert error.max() <= field.error_m
    assert error.max() >= 0.3 * field.error_m  # a bound that says something
    assert field.error_m < 0.7 * voxel


def test_a_field_that_is_there_is_replaced_when_asked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = saved(tmp_path, ball(2))
    field = path.with_suffix(".field")
    field.write_text("mine")
    status, _, said = run(capsys, path, "--voxel", 0.003)
    assert (status, said) == (2, f"hapticd: {field}: exists; add --overwrite to replace it\n")
    assert field.read_text() == "mine"
    assert run(capsys, path, "--voxel", 0.003, "--overwrite")[0] == 0
    assert Field.unpack(field.read_bytes())


def test_distances_are_those_to_the_triangles(tmp_path: Path) -> None:
    """Against the plain formula for a box, whose faces its triangles are."""
    sides = np.array([0.04, 0.03, 0.02])
    closed = read_mesh(saved(tmp_path, trimesh.creation.box(sides)))
    points = np.random.default_rng(3).uniform(-0.03, 0.03, (2000, 3))
    q = np.abs(points) - sides / 2.0
    expected = np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)
    assert np.abs(distances(closed, points) - expected).max() < 1e-8  # an STL has numbers of 32 bits


def test_what_the_tick_reads_is_what_was_sampled(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The loop's plain arithmetic against the sampling's own, on points all over the grid."""
    path = saved(tmp_path, ball(2))
    assert run(capsys, path, "--voxel", 0.003)[0] == 0
    field = Field.unpack(path.with_suffix(".field").read_bytes())
    part = Placed("mesh", HERE, field=field)
    proxy = Proxy([part])
    low, size = np.array(field.origin_m), np.array(field.size_m)
    points = low + size * np.random.default_rng(4).uniform(0.0, 1.0, (500, 3))
    sampled = trilinear(np.array(field.distances_m).reshape(field.counts), low, field.spacing_m, points)
    for point, expected in zip(points, sampled, strict=True):
        assert distance(proxy, (), proxy.voxels, *map(float, point))[0] == pytest.approx(expected, abs=1e-15)
    assert Part(part, HERE).bound_m > RADIUS_M - 1e-3


def test_a_pressed_mesh_pushes_back_like_the_shape_it_is_of(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = saved(tmp_path, ball(4))
    assert run(capsys, path, "--voxel", 0.0025)[0] == 0
    field = Field.unpack(path.with_suffix(".field").read_bytes())
    proxy = Proxy([Placed("mesh", Pose.of((0.1, 0.0, 0.0), (0.3, 0.1, 0.5, 0.2)), field=field)])
    rng = np.random.default_rng(5)
    for _ in range(50):
        u = rng.normal(size=3)
        u /= np.linalg.norm(u)
        for r in (0.032, 0.0298, 0.029):
            (stand if r > RADIUS_M else go)(proxy, (0.1 + r * u[0], r * u[1], r * u[2]))
        assert np.linalg.norm(spring(proxy)) == pytest.approx(1e-3, abs=field.error_m + 1e-4)
        assert np.dot(spring(proxy), u) / np.linalg.norm(spring(proxy)) > 0.998  # 3.6 degrees


def holed() -> Any:
    mesh = ball(2)
    mesh.update_faces(np.arange(len(mesh.faces)) >= 3)
    return mesh


def turned_in() -> Any:
    mesh = ball(2)
    mesh.invert()
    return mesh


def one_face_turned() -> Any:
    mesh = trimesh.creation.box((0.04, 0.03, 0.02))
    faces = mesh.faces.copy()
    faces[0] = faces[0][::-1]
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


def flat() -> Any:
    return trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [2, 1, 0]], process=False)


def touching() -> Any:
    """Two boxes that share an edge, with four faces on it."""
    one = trimesh.creation.box((0.02, 0.02, 0.02))
    two = one.copy()
    two.apply_translation((0.02, 0.02, 0.0))
    return trimesh.util.concatenate([one, two])


@pytest.mark.parametrize(
    ("mesh", "options", "said"),
    [
        (holed(), (), "has holes: 9 open edges; close them"),
        (turned_in(), (), "its faces look inward: flip its normals"),
        (one_face_turned(), (), "some faces look outward and some inward: recalculate its normals outside"),
        (flat(), (), "m in size; a solid needs three sides"),
        (touching(), (), "1 edge with more than two faces; separate the parts"),
        (ball(2), ("--voxel", 1e-5), "points, at most 16777216 fit; give --voxel 0.00024 or more"),
        (trimesh.creation.box((0.04, 0.04, 0.001)), ("--voxel", 0.004), "a spacing of 0.004 m does not see it"),
        (ball(1), ("--voxel", 0), "--voxel 0: must be above 0"),
        (ball(1), ("--scale", "nan"), "--scale nan: must be above 0"),
    ],
)
def test_a_mesh_that_cannot_be_used_is_one_clear_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], mesh: Any, options: tuple[object, ...], said: str
) -> None:
    path = saved(tmp_path, mesh)
    status, out, err = run(capsys, path, *options)
    assert (status, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1
    assert not path.with_suffix(".field").exists()


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("gone.stl", None, "there is no such file"),
        ("mesh.ply", b"ply", "must end in .stl or .obj"),
        ("noise.stl", b"\x00\x01garbage" * 40, ""),
        ("empty.obj", b"", "has no triangles"),
    ],
)
def test_a_file_that_is_no_mesh_is_one_clear_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, content: bytes | None, said: str
) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    status, out, err = run(capsys, path)
    assert (status, out) == (2, "")
    assert said in err
    assert str(path) in err
    assert err.count("\n") == 1


def test_a_folder_is_no_mesh(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, Path())[::2] == (2, "hapticd: .: must end in .stl or .obj\n")


def test_a_scale_makes_metres_of_millimetres(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = saved(tmp_path, trimesh.creation.box((40.0, 30.0, 20.0)))
    status, out, _ = run(capsys, path, "--scale", 0.001, "--json")
    assert status == 0
    assert json.loads(out)["size_m"] == pytest.approx([0.04, 0.03, 0.02])
