"""What a scene costs, in counted instructions of the interpreter: ratios to one wall on the same device."""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from hapticd.offline.operations import count_operations, operations_by_code
from hapticd.tick.space.tick import SpaceTick
from hapticd.tick.tick import ControlTick
from tests.tick.space.rig import Rig, ball, ball_field, table

WALL = '[[scene.walls]]\naxis = "z"\nposition_m = 0.03\nstiffness_n_per_m = 5000.0\n'
ROUGH: dict[str, Any] = {"static_friction": 0.6, "dynamic_friction": 0.5}
FAR = [ball(f"far {n}", radius_m=0.005, position_m=(0.1 + 0.02 * (n % 8), 0.1, 0.02 * (n // 8))) for n in range(63)]

AROUND = [
    ball(f"near {n}", 5000.0 + n, radius_m=0.01, position_m=(0.0129 * x, 0.0129 * y, 0.042), **ROUGH)
    for n, (x, y) in enumerate((math.cos(n * math.tau / 7.0), math.sin(n * math.tau / 7.0)) for n in range(7))
]


def touching(count: int) -> str:
    """Rough balls that are no one solid, since each is a little stiffer than the one before."""
    return "".join(ball(f"ball {n}", 5000.0 + n, **ROUGH) for n in range(count))


def per_tick(scene: str, law: str = "energy-cycle", ticks: int = 32) -> float:
    """Instructions of a tick that is pressed, on the mean, step alone: what a tick has besides is the same for all."""
    rig = Rig(scene, law).start((0.0, 0.0, 0.031))
    points = [(1e-4 * math.sin(0.1 * n), 0.0, 0.0295 + 6e-4 * math.cos(0.2 * n)) for n in range(263)]
    rig.go(*points[:200])
    counts = []
    for at in points[200 : 200 + ticks]:
        rig.sample.position_m[:] = at
        rig.sample.time_ns += 1_000_000
        count = count_operations(partial(rig.tick.advance, rig.sample, 1e-3))
        if any(rig.tick.force_n):
            counts.append(count)
    assert len(counts) > 0.6 * ticks
    return sum(counts) / len(counts)


@pytest.fixture(scope="module")
def wall() -> float:
    return per_tick(WALL)


def test_a_scene_of_walls_runs_no_line_of_objects() -> None:
    rig = Rig(WALL).start((0.0, 0.0, 0.031)).to((0.0, 0.0, 0.0299), 20)
    run = operations_by_code(partial(rig.tick.advance, rig.sample, 1e-3))
    assert not [
        code.co_qualname for code in run if "/tick/space/" in code.co_filename or "/hapticd/shapes/" in code.co_filename
    ]


def test_a_ball_costs_at_most_1_6_walls(wall: float) -> None:
    assert per_tick(ball()) <= 1.6 * wall
    assert per_tick(ball(), "none") <= 1.6 * per_tick(WALL, "none")


def test_a_mesh_costs_at_most_2_5_walls(wall: float, tmp_path: Path) -> None:
    file = tmp_path / "ball.field"
    file.write_bytes(ball_field(0.03, 0.00125).pack())
    assert per_tick(table("mesh", "mesh", file=str(file))) <= 2.5 * wall


def test_a_crease_costs_its_law_across_while_the_proxy_is_pinned_and_a_tenth_of_a_wall_else(wall: float) -> None:
    """A stroke that swings across where two slabs meet, and one over a slab that meets another far off."""
    lean = (math.cos(math.pi / 8.0), 0.0, math.sin(math.pi / 8.0), 0.0)
    back = (lean[0], 0.0, -lean[2], 0.0)
    middle, aside = (0.0, 0.0, 0.03), (-0.05, 0.0, 0.03)
    left = table("left", "plane", position_m=middle, orientation=lean)
    assert per_tick(left + table("right", "plane", position_m=middle, orientation=back)) <= 5.5 * wall
    floor = table("floor", "plane", position_m=middle)
    assert per_tick(floor + table("wall", "plane", position_m=aside, orientation=lean)) <= 2.0 * wall


def test_of_64_objects_those_that_are_not_touched_cost_nothing() -> None:
    assert per_tick(ball() + "".join(FAR)) <= 2.0 * per_tick(ball())


def test_eight_objects_with_friction_cost_at_most_five_walls(wall: float) -> None:
    """The hand is in reach of all eight and presses one of them, which is what looking at eight costs."""
    scene = ball(**ROUGH) + "".join(AROUND)
    rig = Rig(scene).start((0.0, 0.0, 0.031)).to((0.0, 0.0, 0.0295), 20)
    assert len(rig.tick.awake) == 8
    assert [solid.depth_m > 0.0 for solid in rig.tick.solids] == [True] + [False] * 7
    assert per_tick(scene) <= 3.0 * wall


def test_an_edge_between_two_of_them_costs_at_most_five_walls_too(wall: float) -> None:
    """Solids that are pressed at once each have three laws; a seam between two is the most that a face leads to."""
    assert per_tick(touching(2)) <= 5.0 * wall


def test_what_is_pressed_at_once_adds_up(wall: float) -> None:
    """A corner of three, and eight at once, which takes eight different solids within each other."""
    assert per_tick(touching(3)) <= 7.5 * wall
    assert per_tick(touching(8), ticks=31) <= 18.0 * wall


def test_a_switch_to_walls_and_back_takes_the_short_tick_and_the_long_one() -> None:
    rig = Rig(WALL).start((0.0, 0.0, 0.031))
    assert rig.tick.advance == rig.tick.step
    rig.switch(WALL + ball())
    assert rig.tick.advance == rig.tick.step_in_space


def test_both_steps_begin_alike() -> None:
    """The sample, its faults and the blind ramps: written twice, since a call would cost the scene of walls."""

    def head(function: object) -> list[str]:
        body = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0].body  # type: ignore[arg-type,attr-defined]  # a method
        lines = [ast.unparse(each) for each in body[1:]]
        return lines[: lines.index("dt_s = motion.dt_s") + 1]

    assert head(ControlTick.step) == head(SpaceTick.step_in_space)
    assert len(head(ControlTick.step)) > 10
