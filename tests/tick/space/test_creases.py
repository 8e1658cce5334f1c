"""Where the proxy is pinned in a crease: laws across, as long as it is, and nowhere else."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import pytest

from tests.tick.space.rig import Point, Rig, apart, ball, ball_field, table

STIFFNESS = 5000.0
DEEP_M = 0.0005


def notch(stiffness: float = STIFFNESS, keys: str = "") -> str:
    """A floor and a wall that meet along y, free above and to the right."""
    floor = table("floor", "box", stiffness, size_m=(0.1, 0.1, 0.04), position_m=(0.0, 0.0, -0.02))
    return floor + keys + table("wall", "box", stiffness, size_m=(0.04, 0.1, 0.1), position_m=(-0.02, 0.0, 0.0)) + keys


def pressed(law: str, scene: str = "") -> Rig:
    """Into the notch, straight between its sides."""
    rig = Rig(scene or notch(), law).start((0.001, 0.0, 0.001))
    return rig.to((-DEEP_M, 0.0, -DEEP_M), 40)


def swings(count: int, along_m: float = 0.0) -> list[Point]:
    """Across the notch by 0.28 mm each way, and a little on along it every tick."""
    across = [2e-4 * math.sin(0.3 * (n + 1)) for n in range(count)]
    return [(a - DEEP_M, along_m * n, -a - DEEP_M) for n, a in enumerate(across)]


@pytest.mark.parametrize("keys", ["", "static_friction = 0.5\ndynamic_friction = 0.4\n"], ids=["smooth", "rough"])
def test_a_swing_across_stretches_a_spring_of_its_own(keys: str) -> None:
    rig = pressed("none", notch(keys=keys))
    normal, first, _ = rig.tick.solids[0].channels
    kept, seen_m = set(), []
    for at in swings(100):
        rig.go(at)
        off_n = 0.01 if keys else 1e-9  # where it is rough, coming in has pulled the proxy off the crease
        assert rig.force == pytest.approx((-STIFFNESS * at[0], 0.0, -STIFFNESS * at[2]), abs=off_n)
        kept.add((round(normal.dx, 9), round(normal.dy, 9), round(normal.dz, 9)))
        seen_m.append(first.x_of_law_m)
        assert rig.unbalanced_j() < 1e-14
    assert len(kept) <= 2  # the one at the first swing, and from then on another
    if not keys:
        assert max(seen_m) - min(seen_m) == pytest.approx(2.0 * 2e-4 * math.sqrt(2.0), rel=0.02)


def test_what_the_swing_leaks_is_half_of_k_times_the_square_of_each_step() -> None:
    rig = pressed("none")
    before_j = rig.totals.ledger.generated_j
    points = [(-DEEP_M, 0.0, -DEEP_M), *swings(100)]
    rig.go(*points[1:])
    leak_j = sum(0.5 * STIFFNESS * apart(to, of) ** 2 for of, to in pairwise(points))
    assert rig.totals.ledger.generated_j - before_j == pytest.approx(leak_j, rel=1e-9)


@pytest.mark.parametrize("law", ["ring-damping", "energy-cycle"])
def test_a_law_takes_across_what_is_made_there_and_nothing_along(law: str) -> None:
    rig = pressed(law)
    rig.go(*swings(200))
    before = rig.totals.ledger
    before_j = before.dissipated_j - before.generated_j
    rig.go(*((x, y, z) for x, y, z in swings(200, along_m=1e-4)))
    after = rig.totals.ledger
    assert rig.tick.solids[0].channels[1].damping_n_s_per_m >= 0.5 * STIFFNESS * 1e-3
    assert after.dissipated_j - after.generated_j >= before_j
    assert max(abs(force[1]) for force in rig.forces) < 1e-9
    assert rig.unbalanced_j() < 1e-14


def test_off_the_crease_the_normal_alone_is_left() -> None:
    rig = pressed("ring-damping")
    rig.go(*swings(50))
    solid = rig.tick.solids[0]
    assert solid.sides == 2
    rig.to((0.0, 0.0, -DEEP_M), 10).to((0.003, 0.0, -DEEP_M), 60)
    assert (solid.grip, solid.sides) == (0, 1)
    assert [channel.applied_n for channel in solid.channels[1:]] == [0.0, 0.0]
    assert rig.unbalanced_j() < 1e-14


def test_a_corner_of_three_faces_holds_both_ways() -> None:
    at_m = 0.0505
    room = table("room", "box", STIFFNESS, inside=True, size_m=(0.1, 0.1, 0.1))
    rig = Rig(room, "none").start((0.049, 0.049, 0.049)).to((at_m, at_m, at_m), 40)
    solid = rig.tick.solids[0]
    for n in range(100):
        a, b = 2e-4 * math.sin(0.3 * n), 1e-4 * math.sin(0.2 * n)
        at = (at_m + a + b, at_m - a + b, at_m - 2.0 * b)
        rig.go(at)
        assert rig.force == pytest.approx([STIFFNESS * (0.05 - value) for value in at], abs=1e-9)
        assert rig.unbalanced_j() < 1e-14
    assert (solid.grip, solid.sides) == (2, 3)


@pytest.mark.parametrize("law", ["damper", "ring-damping"])
def test_out_of_a_corner_along_an_edge_no_law_brakes(law: str) -> None:
    """It swings in the corner across the edge first, so that what holds it along the edge is the second direction."""
    at_m = 0.0505
    rig = Rig(table("room", "box", STIFFNESS, inside=True, size_m=(0.1, 0.1, 0.1)), law)
    rig.start((0.049, 0.049, 0.049)).to((at_m, at_m, at_m), 40)
    for n in range(1, 60):
        a, b = 1e-4 * math.sin(0.3 * n), 1e-4 * math.sin(0.2 * n) if n > 20 else 0.0
        rig.go((at_m - 2.0 * b, at_m + a + b, at_m - a + b))
    solid = rig.tick.solids[0]
    assert solid.grip == 2
    rig.to((0.05, at_m, at_m), 100)
    assert solid.grip == 2
    for n in range(1, 100):
        across_m = 1e-4 * math.sin(0.3 * n)
        rig.go((0.05 - 5e-5 * n, at_m + across_m, at_m - across_m))
        assert solid.grip == 1
        assert abs(rig.force[0]) < 0.1
    assert rig.unbalanced_j() < 1e-13


def test_where_it_is_rough_the_directions_stay_as_they_are_while_the_proxy_is_pinned() -> None:
    """Friction has a channel for each way across already."""
    at_m = 0.0505
    room = table("room", "box", STIFFNESS, inside=True, size_m=(0.1, 0.1, 0.1))
    rig = Rig(room + "static_friction = 0.5\ndynamic_friction = 0.4\n", "none")
    rig.start((0.049, 0.049, 0.049)).to((at_m, at_m, at_m), 40)
    normal, *_ = rig.tick.solids[0].channels
    kept = set()
    for n in range(100):
        a, b = 2e-4 * math.sin(0.3 * n), 1e-4 * math.sin(0.2 * n)
        rig.go((at_m + a + b, at_m - a + b, at_m - 2.0 * b))
        kept.add((round(normal.dx, 9), round(normal.dy, 9), round(normal.dz, 9)))
    assert len(kept) <= 2
    assert rig.tick.solids[0].grip == 1
    assert rig.unbalanced_j() < 1e-13


def test_another_scene_in_the_middle_of_a_swing_brings_no_step_of_force() -> None:
    rig = pressed("none")
    rig.go(*swings(33))
    before = rig.force
    rig.switch(notch(stiffness=8000.0))
    x, y, z = rig.sample.position_m
    rig.go((x, y, z))
    assert apart(rig.force, before) < 0.1
    rig.to((-DEEP_M, 0.0, -DEEP_M), 600)
    assert rig.force == pytest.approx((4.0, 0.0, 4.0), abs=1e-6)
    assert rig.unbalanced_j() < 1e-12
    rig.switch(ball("far", position_m=(0.5, 0.5, 0.5)))
    rig.to((-DEEP_M, 1e-4, -DEEP_M), 600)
    assert rig.force == (0.0, 0.0, 0.0)
    assert rig.unbalanced_j() < 1e-12


def test_where_nothing_pins_the_proxy_no_law_across_runs(tmp_path: Path) -> None:
    """On a face of the notch, over a ball and its mesh, in a cup: strokes that turn the normal as the surface does."""
    file = tmp_path / "ball.field"
    file.write_bytes(ball_field(0.03, 0.00125).pack())
    bent = [(0.0292 * math.sin(a), 0.0, 0.0292 * math.cos(a)) for a in (0.004 * n for n in range(100))]
    cup = [(0.0305 * math.sin(a), 0.0, -0.0305 * math.cos(a)) for a in (0.004 * n for n in range(100))]
    face = [(0.01 + 1e-4 * n, 5e-5 * n, 2e-4 * math.sin(0.3 * n) - DEEP_M) for n in range(100)]
    for scene, off, points in (
        (notch(), (0.01, 0.0, 0.001), face),
        (ball(), (0.0, 0.0, 0.031), bent),
        (table("mesh", "mesh", file=str(file)), (0.0, 0.0, 0.031), bent),
        (ball(inside=True), (0.0, 0.0, -0.029), cup),
    ):
        rig = Rig(scene, "ring-damping").start(off).to(points[0], 20)
        for at in points:
            rig.go(at)
            assert rig.tick.solids[0].depth_m > 0.0
            assert rig.tick.solids[0].sides == 1
