"""Scenes in space, run offline: the omega7 model of three axes, and the shipped scenes.

A ball, the edge of a box and a plane with friction, from starts and directions of their own. The hand pushes with a
constant force, and a soft spring that damps nothing holds it where it is. Steady means what it means of a wall: over
the last half second the device spans at most 0.05 mm, here as the length of all axes' spans.
"""

from __future__ import annotations

import math
import random
from pathlib import Path

import pytest

from hapticd.config.loading import parse
from hapticd.errors import ConfigError
from hapticd.offline.run import Run
from hapticd.offline.simulate import simulate
from hapticd.paths import directory
from tests.tick.space.rig import ball_field

KINDS = ("ball", "edge", "plane")
STIFFNESSES = (12e3, 18e3, 20e3)
STARTS = 60
FEW = 3
STILL_M = 5e-5


def unit(draw: random.Random) -> list[float]:
    """A direction, all alike likely."""
    while True:
        vector = [draw.gauss(0.0, 1.0) for _ in range(3)]
        length = math.hypot(*vector)
        if length > 0.1:
            return [value / length for value in vector]


def scene(kind: str, seed: int) -> tuple[str, list[float], list[float]]:
    """An object, a point on it, and from which direction the hand comes."""
    draw = random.Random(seed)
    if kind == "ball":
        n = unit(draw)
        centre = [draw.uniform(-0.01, 0.01) for _ in range(3)]
        at = [c + 0.03 * along for c, along in zip(centre, n, strict=True)]
        return f'shape = "sphere"\nradius_m = 0.03\nposition_m = {centre}\n', at, n
    if kind == "edge":
        angle = draw.uniform(math.radians(15.0), math.radians(75.0))
        at = [0.02, draw.uniform(-0.01, 0.01), 0.02]
        return 'shape = "box"\nsize_m = [0.04, 0.06, 0.04]\n', at, [math.cos(angle), 0.0, math.sin(angle)]
    n = unit(draw)
    t = unit(draw)
    off = sum(a * b for a, b in zip(t, n, strict=True))
    t = [a - off * b for a, b in zip(t, n, strict=True)]
    lean = draw.uniform(0.0, 0.5) / math.hypot(*t)
    d = [a + lean * b for a, b in zip(n, t, strict=True)]
    turn = [1.0 + n[2], -n[1], n[0], 0.0]
    friction = "static_friction = 0.8\ndynamic_friction = 0.6\n"
    return f'shape = "plane"\norientation = {turn}\n{friction}', [0.0] * 3, [a / math.hypot(*d) for a in d]


def press(kind: str, stiffness: float, law: str, seed: int) -> Run:
    """Four seconds of a press from a start of its own."""
    what, at, d = scene(kind, seed)
    draw = random.Random(seed + 10_000)
    newton = draw.choice([1.0, 3.0, 6.0])
    height = draw.choice([0.0, 0.0005, 0.001, 0.003]) + 1e-5
    start = [a + height * b for a, b in zip(at, d, strict=True)]
    text = f"""
        [device.options]
        model = "omega7"
        axes = 3
        [device.options.space]
        linkage = "delta"
        position_m = {start}
        [device.options.space.hand]
        force = {{ profile = "constant", newton = {[-newton * a for a in d]} }}
        aim = {{ path = "hold", at_m = {at} }}
        stiffness_n_per_m = [400.0, 400.0, 400.0]
        [[scene.objects]]
        name = "{kind}"
        stiffness_n_per_m = {stiffness}
        {what}
        [controller]
        law = "{law}"
    """
    return simulate(parse(text.replace("\n        ", "\n"), f"{kind} {stiffness:g} {law} {seed}"), 4.0)


def spans_m(kind: str, stiffness: float, law: str, starts: int) -> list[float]:
    return [press(kind, stiffness, law, seed).peak_to_peak_m for seed in range(starts)]


@pytest.mark.parametrize("stiffness", STIFFNESSES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_law_steadies_what_is_unsteady_without_it(kind: str, stiffness: float) -> None:
    assert max(spans_m(kind, stiffness, "energy-cycle", FEW)) < STILL_M
    assert max(spans_m(kind, stiffness, "none", FEW)) > 2.0 * STILL_M


@pytest.mark.nightly
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("stiffness", STIFFNESSES)
@pytest.mark.parametrize("kind", KINDS)
def test_from_sixty_starts_and_directions(kind: str, stiffness: float) -> None:
    assert max(spans_m(kind, stiffness, "energy-cycle", STARTS)) < STILL_M
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


def test_a_mesh_is_rendered_from_the_field_that_lies_beside_the_configuration(tmp_path: Path) -> None:
    (tmp_path / "part.field").write_bytes(ball_field(0.05, 0.0025).pack())
    (tmp_path / "mesh.toml").write_text((directory("config") / "mesh.toml").read_text())
    columns = simulate(tmp_path / "mesh.toml", 4.0).columns
    # A ball of 50 mm whose field is off by at most spacing^2 / 4R = 0.03 mm, pressed by 2 N into 10 kN/m.
    away = [
        math.hypot(x, y, z) for x, y, z in zip(*(columns[f"position_{axis}_m"][1000:] for axis in "xyz"), strict=True)
    ]
    assert max(away) < 0.05 + 5e-5
    assert min(away) > 0.05 - 4e-4
    assert max(columns["touched"]) == 0


def test_a_mesh_file_that_is_missing_or_damaged_is_one_line(tmp_path: Path) -> None:
    text = (directory("config") / "mesh.toml").read_text()
    file = tmp_path / "mesh.toml"
    file.write_text(text)
    with pytest.raises(ConfigError) as missing:
        simulate(file, 0.1)
    assert 'scene.objects[0] "part": file = ' in str(missing.value)
    assert "part.field: No such file" in str(missing.value)
    (tmp_path / "part.field").write_bytes(b"no field")
    with pytest.raises(ConfigError) as damaged:
        simulate(file, 0.1)
    assert "is no distance field; make one with: hapticd mesh" in str(damaged.value)
    assert "\n" not in str(damaged.value)
