"""A surface that turns by 20 degrees under a hand: a law forgets the mass that it has felt, and no force steps."""

from __future__ import annotations

import dataclasses
import itertools
import math

import pytest

from hapticd import plugins
from tests.tick.space.rig import INFO, Rig, ball, table

REAL = dataclasses.replace(INFO, simulated=False, host_silence_ms=20.0)
CLIMB_RAD = 1e-3
ROUGH = table("box", "box", 2000.0, size_m=[0.8, 0.8, 0.02], position_m=[0.0, 0.0, -0.01], static_friction=0.5)


@pytest.mark.parametrize("stiffness_n_per_m", [1000.0, 9000.0])
@pytest.mark.parametrize("law", plugins.names(plugins.CONTROLLERS))
def test_no_law_steps_where_a_hand_slides_round_a_ball(law: str, stiffness_n_per_m: float) -> None:
    """With some the force vanished at 20 degrees, with one it went from 12 N to -12 N and back in each tick."""
    rig = Rig(ball(stiffness=stiffness_n_per_m), law, info=REAL).start((0.0, 0.0, 0.0305))
    rig.to((0.0, 0.0, 0.029), 75).go(*(150 * [(0.0, 0.0, 0.029)]))
    still = len(rig.forces)
    angles = [CLIMB_RAD * n for n in range(1, 1001)]
    rig.go(*((0.029 * math.sin(angle), 0.0, 0.029 * math.cos(angle)) for angle in angles))
    sliding = rig.forces[still - 1 :]
    largest_n = max(math.hypot(*force_n) for force_n in sliding)
    assert math.degrees(angles[-1]) > 40.0
    # A damper that begins as the hand does, and the turn of the force itself.
    assert max(map(math.dist, sliding, sliding[1:])) <= 2.0 * CLIMB_RAD * largest_n + 0.01


@pytest.mark.parametrize(("way_m", "stroke_m", "most_n"), [(2e-5, 3e-5, 0.1), (3e-5, 5e-5, 0.3)])
def test_the_brake_on_arrival_goes_on_where_a_hand_slides_round_a_ball(
    way_m: float, stroke_m: float, most_n: float
) -> None:
    """The law began anew at 20 degrees, and the brake of the arrival was gone in one tick: from 3.5 to 2.4 N."""
    rig = (
        Rig(ball(stiffness=2000.0, radius_m=0.005), "ring-damping", info=REAL)
        .start((0.0, 0.0, 0.007))
        .go(*(60 * [(0, 0, 0.007)]))
    )
    touch = round(2e-3 / way_m)
    rig.go(*((stroke_m * max(0, n - touch), 0.0, 0.007 - way_m * n) for n in range(1, touch + 60)))
    assert math.hypot(*rig.force) > 1.0
    assert max(map(math.dist, rig.forces, rig.forces[1:])) < most_n


@pytest.mark.parametrize("law", plugins.names(plugins.CONTROLLERS))
def test_friction_holds_alike_to_all_sides(law: str) -> None:
    """A spring along the surface is stretched either way; two laws had none where it was stretched to one side."""
    box = "size_m = [0.2, 0.2, 0.02]\nposition_m = [0.0, 0.0, -0.01]\nstatic_friction = 0.8\ndynamic_friction = 0.6\n"
    scene = f'[[scene.objects]]\nname = "box"\nshape = "box"\nstiffness_n_per_m = 2000.0\n{box}'
    held = []
    for x, y in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)):
        rig = Rig(scene, law, info=REAL).start((0.0, 0.0, 0.001)).to((0.0, 0.0, -0.002), 300).to((0.0, 0.0, -0.002), 50)
        rig.to((1e-3 * x, 1e-3 * y, -0.002), 200).to((1e-3 * x, 1e-3 * y, -0.002), 200)
        held.append(-(x * rig.force[0] + y * rig.force[1]))
    assert held == pytest.approx([held[0]] * 4, abs=1e-6)
    assert held[0] > 1.0


@pytest.mark.parametrize("law", plugins.names(plugins.CONTROLLERS))
@pytest.mark.parametrize("way_m", [1e-4, -1e-4, -3e-4])
def test_a_stroke_over_a_rough_surface_meets_its_cone_and_no_more_from_the_touch_on(way_m: float, law: str) -> None:
    """Laws damped it by the speed of the hand: under the default one, one way, with 9.2 N where friction allows 1.5."""
    rig = Rig(f"{ROUGH}dynamic_friction = 0.4\n", law, info=REAL).start((0.0, 0.0, 0.002)).to((0.0, 0.0, 0.001), 60)
    for n in range(200):
        z_m = max(0.001 - 3e-5 * n, -0.0015)
        rig.go((way_m * n, 0.0, z_m))
        assert abs(rig.force[0]) <= 0.5 * 2000.0 * max(-z_m, 0.0) + 1e-9, n
    assert abs(rig.force[0]) > 0.5


@pytest.mark.parametrize("law", plugins.names(plugins.CONTROLLERS))
@pytest.mark.parametrize("way_m", [1.5e-4, -1.5e-4])
def test_nor_does_a_stroke_over_rough_objects_that_are_one(way_m: float, law: str) -> None:
    """With an inner edge somewhere there was no bound: 9.6 N for 40 ms at 0.15 m/s, which then ended in one tick."""
    other = table("other", "box", 2000.0, size_m=[0.1, 0.8, 0.2], position_m=[-0.45, 0.0, 0.0], static_friction=0.5)
    scene = f"{ROUGH}dynamic_friction = 0.4\n{other}dynamic_friction = 0.4\n"
    rig = Rig(scene, law, info=REAL).start((0.0, 0.0, 0.002)).to((0.0, 0.0, 0.001), 60)
    for n in range(200):
        z_m = max(0.001 - 3e-5 * n, -0.0015)
        rig.go((way_m * n, 0.0, z_m))
        assert abs(rig.force[0]) <= 2000.0 * (0.5 * max(-z_m, 0.0) + 1.1 * abs(way_m)), n
    assert abs(rig.force[0]) > 0.5


@pytest.mark.parametrize(("friction", "way_m"), [(0.3, 3e-5), (0.3, 2e-4), (0.6, 1e-4)])
@pytest.mark.parametrize("angle", [250, 270, 290, 310, 340])
def test_what_slips_along_a_bent_inner_edge_keeps_its_friction(angle: int, friction: float, way_m: float) -> None:
    """No place was found beside the cone's edge, and the friction was gone in one tick: up to 6.7 N."""
    keys = {"radius_m": 0.015, "length_m": 0.2, "static_friction": friction, "dynamic_friction": 0.8 * friction}
    lying = table("a", "capsule", 2000.0, position_m=[-0.014, 0, 0], orientation=[1.0, 1.0, 0.0, 0.0], **keys)
    askew = table("b", "capsule", 2000.0, position_m=[0.014, 0, 0], orientation=[1.0, 0.7, 0.5, 0.0], **keys)
    rig = Rig(lying + askew, "none", info=REAL).start((0.0, 0.0, 0.0084)).to((0.0, 0.0, 0.0014), 200)
    still, x, y, deepest_m = len(rig.forces), 0.0, 0.0, 0.0
    for n in range(150):
        x += min(1.0, n / 20) * way_m * math.cos(math.radians(angle))
        y += min(1.0, n / 20) * way_m * math.sin(math.radians(angle))
        if abs(x) < 0.014:
            rig.go((x, y, 0.0014))
            deepest_m = max(deepest_m, rig.tick.solids[0].depth_m)
    felt = rig.forces[still - 1 :]
    sticks_n = 0.2 * friction * 2000.0 * deepest_m  # what static friction holds more than dynamic
    assert max(map(math.dist, felt, felt[1:])) < sticks_n + 2.0 * 2000.0 * way_m + 0.1


@pytest.mark.parametrize("law", plugins.names(plugins.CONTROLLERS))
@pytest.mark.parametrize("way_m", [5e-5, 3e-4])
def test_no_law_steps_where_a_stroke_to_and_fro_begins_to_slip(way_m: float, law: str) -> None:
    """A damper that saw the slip's own speed would let go of 50 N s/m times the hand's in one tick."""
    rig = Rig(f"{ROUGH}dynamic_friction = 0.5\n", law, info=REAL).start((0.0, 0.0, 0.002)).to((0.0, 0.0, -0.0015), 300)
    strokes = [way_m * math.sin(2.0 * math.pi * n / 300.0) for n in range(900)]
    rig.go(*((x_m, 0.0, -0.0015) for x_m in itertools.accumulate(strokes)))
    assert max(abs(x) for x, _, _ in rig.forces[400:]) <= 1.5 + 1e-9
    assert max(map(math.dist, rig.forces[400:], rig.forces[401:])) <= 0.1 + 2200.0 * way_m


def test_a_fading_object_does_not_come_back_where_a_lost_position_is_known_again() -> None:
    """It was taken off while the hand pressed it with 4 N; armed before that was known again it stepped to 3.3 N."""
    at = (0.0, 0.0, 0.0292)
    rig = Rig(ball(), "none", info=REAL).start((0.0, 0.0, 0.031)).to(at, 60).go(*(5 * [at]))
    rig.switch("").go(*(10 * [at]))
    assert rig.force[2] == pytest.approx(3.28)
    rig.go(*(40 * [(math.nan, math.nan, math.nan)]))
    assert rig.force == (0.0, 0.0, 0.0)
    rig.tick.fault = 0
    rig.tick.guard.clear()
    assert rig.tick.arm()
    seen = len(rig.forces)
    rig.go(*(100 * [at]))
    assert set(itertools.chain(*rig.forces[seen:])) == {0.0}
    assert not rig.tick.fading
