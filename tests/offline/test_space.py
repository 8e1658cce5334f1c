"""Scenes in space, run offline: the omega7 model of three axes, and the shipped scenes.

A ball, the edge of a box and a plane with friction, from starts and directions of their own. The hand pushes with a
constant force, and a soft spring that damps nothing holds it where it is. Steady means what it means of a wall: over
the last half second the device spans at most 0.05 mm, here as the length of all axes' spans.
"""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from hapticd.config.loading import parse
from hapticd.errors import ConfigError
from hapticd.offline.run import Run
from hapticd.offline.simulate import simulate
from hapticd.paths import directory
from tests.offline.space_presses import KINDS, STARTS, STIFFNESSES, STILL_M, press_text

FEW = 3


def press(kind: str, stiffness: float, law: str | None, seed: int) -> Run:
    """Four seconds of a press from a start of its own."""
    return simulate(parse(press_text(kind, stiffness, law, seed), f"{kind} {stiffness:g} {law} {seed}"), 4.0)


def spans_m(kind: str, stiffness: float, law: str | None, starts: int) -> list[float]:
    return [press(kind, stiffness, law, seed).peak_to_peak_m for seed in range(starts)]


@pytest.mark.parametrize("stiffness", STIFFNESSES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_law_steadies_what_is_unsteady_without_it(kind: str, stiffness: float) -> None:
    assert max(spans_m(kind, stiffness, None, FEW)) < STILL_M
    assert max(spans_m(kind, stiffness, "none", FEW)) > 2.0 * STILL_M


def test_a_spring_along_the_surface_that_is_a_few_counts_long_is_held_as_well() -> None:
    """A law that takes the force of one place for that of another feels a tenth of the mass, and damps too little."""
    assert press("plane", 18e3, None, 59).peak_to_peak_m < STILL_M


@pytest.mark.nightly
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("stiffness", STIFFNESSES)
@pytest.mark.parametrize("kind", KINDS)
def test_from_sixty_starts_and_directions(kind: str, stiffness: float) -> None:
    assert max(spans_m(kind, stiffness, None, STARTS)) < STILL_M
    without = spans_m(kind, stiffness, "none", STARTS)
    assert sorted(without)[STARTS // 2] > STILL_M


# --- the shipped scenes -----------------------------------------------------------------------------------------------


def shipped(name: str, duration_s: float) -> Run:
    return simulate(directory("config") / f"{name}.toml", duration_s)


def test_the_ball_holds_the_device_at_the_depth_of_its_spring() -> None:
    run = shipped("ball", 3.0)
    assert run.settled
    assert run.columns["depth_m"][-1] == pytest.approx(3.0 / 12000.0, rel=0.1)


def test_the_cup_keeps_the_device_inside() -> None:
    columns = shipped("cup", 4.0).columns
    far = [math.hypot(x, y) for x, y in zip(columns["position_x_m"], columns["position_y_m"], strict=True)]
    assert max(far[1000:]) < 0.0256  # after it has arrived
    assert min(columns["position_z_m"]) > -0.031
    assert sum(touched == 0 for touched in columns["touched"][1000:]) > 2900


def test_the_hand_goes_over_the_edge_of_the_table_and_comes_back() -> None:
    run = shipped("table-edge", 8.0)
    x, z = run.columns["position_x_m"], run.columns["position_z_m"]
    assert max(x) > 0.0405
    assert min(z) < -0.002
    assert run.fault is None


def test_the_peg_goes_into_the_hole_and_stays_off_its_sides() -> None:
    columns = shipped("peg-in-hole", 4.0).columns
    inside = [at for at, z in enumerate(columns["position_z_m"]) if z < -0.001]
    assert min(columns["position_z_m"]) < -0.0195
    assert max(columns["position_x_m"][at] for at in inside) < 0.0055
    assert max(columns["position_y_m"][at] for at in inside) < 0.0055
    # Pressed into the corner, at its deepest: both sides answer.
    deepest = min(range(len(columns["t_s"])), key=lambda at: columns["position_z_m"][at])
    assert columns["force_x_n"][deepest] < -0.5
    assert columns["force_y_n"][deepest] < -0.5


def test_the_ring_is_a_mesh_that_the_device_stays_on() -> None:
    """Its field is that of a torus, off by at most 0.3 mm; the hand goes round on top of it."""
    columns = shipped("mesh", 4.0).columns
    away = [
        math.hypot(math.hypot(x, y) - 0.02, z) - 0.008
        for x, y, z in zip(*(columns[f"position_{axis}_m"][500:] for axis in "xyz"), strict=True)
    ]
    assert max(away) < 0.0003
    assert min(away) > -0.0003 - 2.5 / 10000.0
    assert min(columns["position_z_m"][500:]) > 0.006
    assert sum(touched == 0 for touched in columns["touched"][500:]) > 3400


def test_a_mesh_file_that_is_missing_or_damaged_is_one_line(tmp_path: Path) -> None:
    text = (directory("config") / "mesh.toml").read_text()
    file = tmp_path / "mesh.toml"
    file.write_text(text.replace("ring.field", "part.field"))
    with pytest.raises(ConfigError) as missing:
        simulate(file, 0.1)
    assert 'scene.objects[0] "ring": file = ' in str(missing.value)
    assert "part.field: No such file" in str(missing.value)
    (tmp_path / "part.field").write_bytes(b"no field")
    with pytest.raises(ConfigError) as damaged:
        simulate(file, 0.1)
    assert "is no distance field; make one with: hapticd mesh" in str(damaged.value)
    assert "\n" not in str(damaged.value)
