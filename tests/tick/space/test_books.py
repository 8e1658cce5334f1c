"""The books of objects balance for any way of the device: what flowed in is stored, dissipated, or was made."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.tick.space.rig import Point, Rig, ball, table

SHAPES = {
    "sphere": ball(),
    "cavity": ball(inside=True, position_m=(0.0, 0.0, 0.05)),
    "box": table("box", "box", size_m=(0.05, 0.06, 0.04), rounding_m=0.002, orientation=(1.0, 0.2, -0.1, 0.3)),
    "capsule": table("capsule", "capsule", radius_m=0.02, length_m=0.03, orientation=(1.0, 1.0, 0.0, 0.0)),
    "cylinder": table("cylinder", "cylinder", radius_m=0.025, length_m=0.04, rounding_m=0.001),
    "plane": table("plane", "plane", position_m=(0.0, 0.0, 0.028), orientation=(1.0, 0.1, 0.2, 0.0)),
    "room": table("room", "box", inside=True, size_m=(0.004, 0.004, 0.03), position_m=(0.005, 0.002, 0.03)),
    "two": ball("left", position_m=(-0.02, 0.0, 0.0)) + ball("right", 8000.0, position_m=(0.02, 0.0, 0.0)),
}
ROUGH = "static_friction = 0.7\ndynamic_friction = 0.5\n"
LAWS = ("energy-cycle", "none", "tdpa", "ring-damping", "damper")


def wander(seed: int, ticks: int, start: Point) -> list[Point]:
    """A way about the origin whose speed and direction wander, 0.2 m/s on the mean."""
    draw = random.Random(seed)
    at = list(start)
    way = [0.0, 0.0, 0.0]
    points = []
    for _ in range(ticks):
        for axis in range(3):
            way[axis] += draw.gauss(0.0, 3e-5) - 0.05 * way[axis] - 1e-3 * (at[axis] - 0.4 * start[axis])
            at[axis] += way[axis]
        points.append((at[0], at[1], at[2]))
    return points


@pytest.mark.parametrize("rough", [False, True], ids=["smooth", "rough"])
@pytest.mark.parametrize("shape", SHAPES)
def test_the_books_balance_whatever_the_way(shape: str, rough: bool) -> None:
    scene = SHAPES[shape]
    if rough:
        scene = scene.replace("stiffness_n_per_m", f"{ROUGH}stiffness_n_per_m")

    @examples(4)
    @given(seed=st.integers(0, 10**6), law=st.sampled_from(LAWS))
    def balance(seed: int, law: str) -> None:
        start = (0.0, 0.0, 0.03) if shape == "cavity" else (0.005, 0.002, 0.04)
        rig = Rig(scene, law).start(start)
        worst = 0.0
        for at in wander(seed, 400, start):
            rig.go(at)
            worst = max(worst, rig.unbalanced_j())
        assert worst < 1e-12 * max(1.0, rig.totals.ledger.dissipated_j + rig.totals.ledger.generated_j)
        assert rig.totals.ledger.generated_j >= 0.0
        touched.append(any(map(any, rig.forces)))

    touched: list[bool] = []
    balance()
    assert any(touched), "no way has touched anything"


def test_a_release_and_a_limit_stand_in_the_books_too() -> None:
    rig = Rig(ball(stiffness=20000.0), safety="max_force_n = 3.0").start((0.0, 0.0, 0.031)).to((0.001, 0.0, 0.029), 30)
    assert math.hypot(*rig.force) == pytest.approx(3.0)
    rig.tick.release()
    rig.to((0.002, 0.001, 0.0295), 100)
    assert rig.force == (0.0, 0.0, 0.0)
    assert rig.unbalanced_j() < 1e-14


def test_sliding_on_a_ball_leaks_as_the_sampled_spring_does_and_no_more() -> None:
    """Per tick k/2 (dn^2 - depth/R dt^2) on a convex surface: the work of the held vector, however the normal turns."""
    rig = Rig(ball(stiffness=5000.0), "none").start((0.0, 0.0, 0.031)).to((0.0, 0.0, 0.0292), 20)
    before = rig.totals.ledger
    points = [(0.0292 * math.sin(a), 0.0, 0.0292 * math.cos(a)) for a in (n * 0.2e-3 / 0.0292 for n in range(1, 1001))]
    rig.go(*points)
    after = rig.totals.ledger
    # At constant depth the chord is all there is: F . dp = k depth (1 - cos(da)) r towards the surface.
    lost_j = 1000 * 5000.0 * 0.0008 * 0.0292 * (1.0 - math.cos(0.2e-3 / 0.0292))
    assert after.dissipated_j - before.dissipated_j == pytest.approx(lost_j, rel=1e-4)
    assert after.generated_j == pytest.approx(before.generated_j)


def test_friction_takes_what_slipping_takes_and_holds_what_sticks() -> None:
    scene = table("table", "plane", static_friction=0.8, dynamic_friction=0.5)
    rig = Rig(scene, "none").start((0.0, 0.0, 0.001)).to((0.0, 0.0, -0.0004), 40)
    rig.to((0.0003, 0.0, -0.0004), 100)  # 0.3 mm of 0.32 mm that stick
    assert rig.totals.friction_j == 0.0
    assert rig.force == pytest.approx((-1.5, 0.0, 2.0), abs=1e-9)
    assert rig.totals.friction_stored_j == pytest.approx(0.5 * 5000.0 * 0.0003**2)
    before_j = rig.energy_j
    rig.to((0.0103, 0.0, -0.0004), 1000)  # slips on at 0.5 of 2 N
    assert rig.force == pytest.approx((-1.0, 0.0, 2.0), abs=1e-6)
    assert rig.totals.friction_j == pytest.approx(rig.energy_j - before_j, rel=0.1)
    assert rig.totals.friction_j == pytest.approx(1.0 * 0.01, rel=0.05)  # and what it had stored in sticking
    assert rig.unbalanced_j() < 1e-14


@pytest.mark.parametrize("law", ["none", "energy-cycle", "ring-damping"])
@pytest.mark.parametrize("depth_m", [0.002, 0.005])
def test_pressed_beyond_the_limit_friction_takes_what_the_hand_gives(depth_m: float, law: str) -> None:
    """The spring is flat there, and so is what a slip takes off it: 1.18 J were told of 0.22."""
    scene = table("floor", "plane", 12000.0, static_friction=0.5, dynamic_friction=0.4)
    rig = Rig(scene, law).start((0.0, 0.0, 0.001)).to((0.0, 0.0, -depth_m), 300)
    gave_j, took_j = rig.energy_j, rig.totals.friction_j
    for at in range(1, 501):
        rig.go((1e-4 * at, 0.0, -depth_m))
        totals = rig.totals
        assert 0.0 < totals.friction_stored_j < totals.ledger.stored_j
    assert math.hypot(*rig.force) == pytest.approx(12.0)
    assert totals.friction_j - took_j == pytest.approx(rig.energy_j - gave_j, rel=0.05)
    assert rig.unbalanced_j() < 1e-13


def test_a_slip_that_begins_beyond_the_limit_and_ends_below_takes_what_the_flat_spring_held() -> None:
    """11.5 N of depth alone, and along the surface more than the rest of 12 N."""
    scene = table("floor", "plane", 10000.0, static_friction=0.6, dynamic_friction=0.1)
    rig = Rig(scene, "none").start((0.0, 0.0, 0.001)).to((0.0, 0.0, -0.00115), 300)
    rig.to((0.00068, 0.0, -0.00115), 100)
    stuck = rig.totals
    assert stuck.friction_j == 0.0
    assert math.hypot(*rig.force) == pytest.approx(12.0)
    share = 0.00068**2 / (0.00068**2 + 0.00115**2)
    assert stuck.friction_stored_j == pytest.approx(share * stuck.ledger.stored_j)
    rig.go((0.0007, 0.0, -0.00115))
    assert 11.5 < math.hypot(*rig.force) < 12.0
    whole_m, left_m = math.hypot(0.0007, 0.00115), math.hypot(0.1 * 0.00115, 0.00115)
    held_j = 12.0 * (whole_m - 0.5 * 12.0 / 10000.0)
    assert rig.totals.friction_j == pytest.approx(held_j - 0.5 * 10000.0 * left_m**2)
    assert rig.unbalanced_j() < 1e-15


@pytest.mark.parametrize("stretch_m", [0.003, 0.0005])
def test_what_sticks_holds_a_part_of_what_is_stored_beyond_the_limit_and_below(stretch_m: float) -> None:
    """54 mJ were told of 37."""
    scene = table("floor", "plane", 12000.0, static_friction=2.0, dynamic_friction=1.5)
    depth_m = 0.6 * stretch_m
    rig = Rig(scene, "none").start((0.0, 0.0, 0.001)).to((0.0, 0.0, -depth_m), 300).to((stretch_m, 0.0, -depth_m), 300)
    totals = rig.totals
    assert totals.friction_j == 0.0
    assert totals.friction_stored_j == pytest.approx(totals.ledger.stored_j / 1.36)


@pytest.mark.parametrize("remote", [False, True], ids=["still", "remote"])
def test_a_reload_that_takes_friction_away_or_softens_it_leaves_none_of_its_spring_in_the_books(remote: bool) -> None:
    """It stood there for ever, even once the object was gone."""
    rough = table("floor", "plane", 12000.0, static_friction=0.9, dynamic_friction=0.8, remote=remote)
    at = (0.0006, 0.0, -0.0008)
    rig = Rig(rough, "none").start((0.0, 0.0, 0.001)).to((0.0, 0.0, -0.0008), 300).to(at, 100)
    assert rig.totals.friction_stored_j == pytest.approx(0.5 * 12000.0 * 0.0006**2)
    rig.switch(rough.replace("12000.0", "6000.0"))
    if not remote:  # of which the surface goes there by a ramp
        assert rig.totals.friction_stored_j == pytest.approx(0.5 * 6000.0 * 0.0006**2)
    for _ in range(100):
        rig.go(at)
        assert rig.totals.friction_stored_j == pytest.approx(0.36 * rig.totals.ledger.stored_j)
    rig.switch(table("floor", "plane", 6000.0, remote=remote))
    assert rig.totals.friction_stored_j == 0.0
    rig.to(at, 100)
    assert rig.totals.friction_stored_j == 0.0
    assert rig.unbalanced_j() < 1e-15


@pytest.mark.parametrize("rough", [False, True], ids=["smooth", "rough"])
def test_what_the_spring_holds_is_out_of_the_books_once_it_is_left_or_the_device_stands_anew(rough: bool) -> None:
    keys: dict[str, Any] = {"static_friction": 0.5, "dynamic_friction": 0.4} if rough else {}
    rig = Rig(ball(**keys), "none").start((0.0, 0.0, 0.0295)).to((0.0, 0.0, 0.0294), 10)
    assert rig.totals.ledger.stored_j == pytest.approx(0.5 * 5000.0 * 6e-4**2)
    rig.to((0.0, 0.0, 0.031), 20)
    assert rig.totals.ledger.stored_j == 0.0
    rig.to((0.0, 0.0, 0.0295), 20).start((0.0, 0.0, 0.031))
    rig.force = (0.0, 0.0, 0.0)
    assert rig.go((0.0, 0.0, 0.031)).totals.ledger.stored_j == 0.0
    assert rig.unbalanced_j() < 1e-15
