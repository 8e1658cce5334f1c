"""The proxy holds at edges and corners, on thin plates, in valleys, past the centre; a tick makes at most k dp^2/2.

Lengths are what a spring of 1 N/m would have as force; a stiffness is a factor and changes nothing of what is said.
"""

from __future__ import annotations

import itertools
import math
import random
from copy import copy
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticd.shapes.pose import Pose
from hapticd.shapes.solid import Placed, Proxy
from hapticd.shapes.surface import SURFACE_M, distance
from tests.shapes.walks import (
    ASKEW,
    CONVEX,
    FIELDS,
    HERE,
    HOLLOW,
    SOLIDS,
    Point,
    dot,
    go,
    minus,
    norm,
    spring,
    stand,
    walk,
)

STIFFNESS_N_PER_M = 12e3

seeds = st.integers(0, 2**32)
speeds = st.sampled_from([0.02, 0.3, 2.0])
pulls = st.sampled_from([5.0, 30.0, 300.0])
frictions = st.sampled_from([(0.0, 0.0), (0.5, 0.5), (0.8, 0.3)])


@pytest.mark.parametrize("name", SOLIDS)
@settings(max_examples=6, deadline=None)
@given(seed=seeds, speed=speeds, pull=pulls, friction=frictions)
def test_a_tick_makes_no_more_energy_than_the_hold_alone(
    name: str, seed: int, speed: float, pull: float, friction: tuple[float, float]
) -> None:
    """G = U(n) - U(n-1) + F(n-1).dp <= k/2 |dp|^2, whatever the surface does under the device."""
    last: Point | None = None
    for now in walk(Proxy(SOLIDS[name], *friction), seed, 200, speed, pull):
        if last is not None:
            made = 0.5 * (dot(now.spring, now.spring) - dot(last, last)) + dot(last, now.dp)
            assert STIFFNESS_N_PER_M * (made - 0.5 * dot(now.dp, now.dp)) < 1e-11
        last = now.spring


@pytest.mark.parametrize("name", SOLIDS)
@settings(max_examples=4, deadline=None)
@given(seed=seeds, speed=speeds, pull=pulls, friction=frictions)
def test_no_force_grows_by_more_than_the_device_moved(
    name: str, seed: int, speed: float, pull: float, friction: tuple[float, float]
) -> None:
    """A touch is found within a micrometre before the surface, and that much may stand from the first tick on."""
    last: Point | None = None
    for now in walk(Proxy(SOLIDS[name], *friction), seed, 200, speed, pull):
        if last is not None:
            assert norm(now.spring) <= norm(last) + norm(now.dp) + SURFACE_M
        last = now.spring


@pytest.mark.parametrize("name", [*HOLLOW, "plane"])
@settings(max_examples=6, deadline=None)
@given(seed=seeds, speed=speeds, pull=pulls)
def test_in_a_convex_room_no_force_changes_by_more_than_the_device_moved(
    name: str, seed: int, speed: float, pull: float
) -> None:
    """The way to a convex set is nonexpansive, corners included; 1 % and a micrometre for what is not yet slid."""
    last: Point | None = None
    for now in walk(Proxy(SOLIDS[name]), seed, 200, speed, pull, reach_m=0.02):
        if last is not None:
            assert norm(minus(now.spring, last)) <= 1.01 * norm(now.dp) + SURFACE_M
        last = now.spring


@settings(max_examples=15, deadline=None)
@given(seed=seeds, speed=speeds)
def test_on_a_ball_a_force_turns_no_faster_than_its_curvature_says(seed: int, speed: float) -> None:
    """Deeper than 3/4 of the radius, and until the goal has come round after that, by no more than 5 times the move.

    What turns by a degree in a tick does so in any case.
    """
    shape = CONVEX["sphere"]
    last: Point | None = None
    depth_m = 0.0
    behind = False
    for now in walk(Proxy([shape]), seed, 400, speed, reach_m=0.012):
        deepest = max(depth_m, now.proxy.depth_m) + norm(now.dp)
        if last is not None:
            behind = behind or deepest >= 0.74 * shape.radius_m
            turning = 5.0 if behind else max(1.0, deepest / (shape.radius_m - deepest))
            steady = 0.021 * shape.radius_m if behind else 0.0
            assert norm(minus(now.spring, last)) <= max(turning * norm(now.dp), steady) + norm(now.dp) + SURFACE_M
            behind = now.proxy.touching and (behind and norm(now.spring) > 0.3 * shape.radius_m)
        last, depth_m = now.spring, now.proxy.depth_m


BALLS = {
    "a ball": Placed("sphere", HERE, radius_m=0.005),
    "a capsule": Placed("capsule", Pose.of((0.0, 0.0, 0.0), (1.0, 1.0, 0.0, 0.0)), radius_m=0.005, length_m=0.04),
    "a cylinder": Placed("cylinder", Pose.of((0.0, 0.0, 0.0), (1.0, 1.0, 0.0, 0.0)), radius_m=0.005, length_m=0.04),
}
IN_A_UNION = [Placed("plane", Pose.of((0.0, 0.0, -0.1)))]


@pytest.mark.parametrize("more", [[], IN_A_UNION], ids=["alone", "in a union"])
@pytest.mark.parametrize("noise_m", [1e-6, 2e-6, 2e-5])
@pytest.mark.parametrize("name", BALLS)
def test_past_the_centre_the_side_turns_no_faster_than_the_device_shakes(
    name: str, noise_m: float, more: list[Placed]
) -> None:
    """Off the axis by next to nothing, it had run round within 10 ticks of standing there, by 2 mm in one of them."""
    rng = random.Random(3)
    proxy = Proxy([BALLS[name], *more])
    stand(proxy, (0.0, 0.0, 0.006))
    for at in range(350):
        go(proxy, (0.0, 0.0, 0.006 - 2e-5 * at))  # to 1 mm past the centre
    last, before = spring(proxy), (0.0, 0.0, -0.00098)
    for tick in range(100):
        p = (rng.gauss(0.0, noise_m), rng.gauss(0.0, noise_m), -0.001 + rng.gauss(0.0, noise_m))
        go(proxy, p)
        moved_m = norm(minus(p, before))
        assert norm(minus(spring(proxy), last)) <= max(5.0 * moved_m, 1.1e-4) + SURFACE_M, tick
        last, before = spring(proxy), p
        if tick < 100 * 2e-6 / noise_m:
            assert spring(proxy)[2] > 0.0, tick


@pytest.mark.parametrize("more", [[], IN_A_UNION], ids=["alone", "in a union"])
@pytest.mark.parametrize("way_m", [2e-5, 1e-4, 4e-4])
@pytest.mark.parametrize("depths", [0.5, 1.2, 3.0])
@pytest.mark.parametrize("name", ["rounded box", "rounded cylinder"])
def test_drawn_over_a_rounded_edge_a_force_turns_no_faster_than_the_device_moves(
    name: str, depths: float, way_m: float, more: list[Placed]
) -> None:
    """Held one and a half roundings deep, it had come round in one tick, by 24 times the device's way."""
    edge = replace(CONVEX[name], pose=HERE)
    half_x, half_z = (0.02, 0.01) if name == "rounded box" else (0.02, 0.015)
    proxy = Proxy([edge, *more])
    x, z = half_x - 2.0 * edge.rounding_m, half_z + 1e-3
    stand(proxy, (x, 0.0, z))
    while z > half_z - depths * edge.rounding_m:
        z -= 1e-4
        go(proxy, (x, 0.0, z))
    last = spring(proxy)
    while x < half_x - 1e-3:
        x += way_m
        go(proxy, (x, 0.0, z))
        assert norm(minus(spring(proxy), last)) <= max(5.0 * way_m, 0.021 * norm(last)) + SURFACE_M
        last = spring(proxy)
    assert 1e-4 < proxy.depth_m < edge.rounding_m  # by then it has come round


@pytest.mark.parametrize("name", CONVEX)
@settings(max_examples=6, deadline=None)
@given(seed=seeds, speed=speeds, pull=pulls)
def test_while_a_device_is_held_its_force_turns_no_faster_than_it_moves(
    name: str, seed: int, speed: float, pull: float
) -> None:
    last: Point | None = None
    for now in walk(Proxy(SOLIDS[name]), seed, 300, speed, pull, reach_m=0.02):
        if last is not None and now.proxy.touching:
            bound = max(5.0 * norm(now.dp), 0.021 * norm(last)) + SURFACE_M
            assert norm(minus(now.spring, last)) <= bound
        last = now.spring


@pytest.mark.parametrize(
    ("seed", "name"), [(0, "ball"), (26, "ball"), (31, "peg"), (2, "two balls"), (43, "two balls")]
)
def test_along_an_inner_edge_the_goal_goes_on_however_slow_the_device_is(seed: int, name: str) -> None:
    """Where the nearest point of the edge was further than the bound, every step led there, and the goal was stuck."""
    peg = Placed("cylinder", HERE, radius_m=0.005, length_m=0.03)
    balls = [
        Placed("sphere", Pose.of((x, 0.0, z)), radius_m=0.005) for x, z in ((0.0, 0.0), (0.0, 0.002), (0.006, 0.0))
    ]
    table = Placed("plane", HERE)
    union = {"peg": [table, peg], "ball": [table, balls[1]], "two balls": [balls[0], balls[2]]}[name]
    rng = random.Random(seed)
    speed, pull, reach_m = rng.choice([0.02, 0.1]), rng.choice([3.0, 30.0]), rng.choice([0.003, 0.006])
    for tick, now in enumerate(walk(Proxy(union), seed, 300, speed, pull, reach_m)):
        if tick % 10 == 9 and now.proxy.touching:
            slow, fast = copy(now.proxy), copy(now.proxy)
            x, y, z = now.p
            for tremble in range(400):
                go(slow, (x, y, z + 1e-5 * (tremble % 2)))
            for tremble in range(40):
                go(fast, (x, y, z + 1e-4 * (tremble % 2)))
            go(fast, now.p)
            if fast.touching:
                assert slow.depth_m < 1.1 * fast.depth_m + 1e-4, tick


@pytest.mark.parametrize("name", SOLIDS)
@settings(max_examples=4, deadline=None)
@given(seed=seeds, speed=speeds, pull=pulls)
def test_the_goal_is_on_the_surface_while_the_device_is_held(name: str, seed: int, speed: float, pull: float) -> None:
    proxy = Proxy(SOLIDS[name])
    for _ in walk(proxy, seed, 200, speed, pull):
        if proxy.touching:
            d, _, _, _ = distance(proxy, proxy.others, proxy.voxels, proxy.gx, proxy.gy, proxy.gz)
            assert abs(d) <= 2.0 * SURFACE_M  # in a valley, landing on one face leaves the other by as much
        else:
            assert spring(proxy) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("name", SOLIDS)
@settings(max_examples=4, deadline=None)
@given(seed=seeds, speed=speeds, pull=pulls)
def test_a_device_in_a_solid_is_always_held(name: str, seed: int, speed: float, pull: float) -> None:
    proxy = Proxy(SOLIDS[name])
    for now in walk(proxy, seed, 200, speed, pull):
        d, _, _, _ = distance(proxy, proxy.others, proxy.voxels, *proxy.shapes[0].pose.own(now.p))
        if d < 0.0:
            assert proxy.touching
            if name not in FIELDS:  # whose distances are no more than nearly that
                assert proxy.depth_m >= -d * (1.0 - 1e-9) - SURFACE_M  # the nearest surface, or one farther away


@given(
    direction=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda u: norm(u) > 0.1), depth_m=st.floats(1e-9, 0.0119)
)
def test_a_press_into_a_ball_is_the_analytic_one(direction: Point, depth_m: float) -> None:
    size = norm(direction)
    u = (direction[0] / size, direction[1] / size, direction[2] / size)
    centre = (0.01, -0.02, 0.015)
    proxy = Proxy([Placed("sphere", ASKEW, radius_m=0.012)])
    stand(proxy, tuple(c + 0.013 * e for c, e in zip(centre, u, strict=True)))  # type: ignore[arg-type]  # three numbers
    for share in (0.25, 0.5, 0.75, 1.0):
        r = 0.012 - share * depth_m
        go(proxy, (centre[0] + r * u[0], centre[1] + r * u[1], centre[2] + r * u[2]))
        force = [STIFFNESS_N_PER_M * each for each in spring(proxy)]
        assert force == pytest.approx([STIFFNESS_N_PER_M * share * depth_m * each for each in u], abs=1e-9)


@pytest.mark.parametrize("speed_m_per_s", [0.02, 0.5, 2.0, 4.0])
@pytest.mark.parametrize("thickness_m", [1e-3, 1e-4])
def test_a_thin_plate_stops_whatever_comes_fast(speed_m_per_s: float, thickness_m: float) -> None:
    """At 2 m/s a device is through a plate of 1 mm within one tick; the trace finds the face that it met."""
    proxy = Proxy([Placed("box", HERE, size_m=(0.06, 0.06, thickness_m))])
    z = 0.0107
    stand(proxy, (0.0, 0.0, z))
    while z > -0.02:
        go(proxy, (0.0, 0.0, z))
        if z < 0.5 * thickness_m:
            assert spring(proxy) == pytest.approx((0.0, 0.0, 0.5 * thickness_m - z), abs=1e-15)
        z -= 1e-3 * speed_m_per_s


def test_a_device_that_is_pulled_back_out_of_a_plate_is_free_on_the_side_it_came_from() -> None:
    proxy = Proxy([Placed("box", HERE, size_m=(0.06, 0.06, 0.001))])
    stand(proxy, (0.0, 0.0, 0.002))
    for z in (0.0003, -0.003, -0.006, -0.003, 0.0003):
        go(proxy, (0.001, 0.0, z))
        assert proxy.touching
        assert proxy.normal_z == pytest.approx(1.0)
    go(proxy, (0.001, 0.0, 0.0006))
    assert not proxy.touching


def test_off_the_edge_of_a_plate_the_device_is_free() -> None:
    proxy = Proxy([Placed("box", HERE, size_m=(0.06, 0.06, 0.001))])
    stand(proxy, (0.02801, 0.0, 0.002))
    for at in range(100):
        go(proxy, (0.02801 + 5e-5 * at, 0.0, -0.0015))
        assert proxy.touching == (0.02801 + 5e-5 * at < 0.03), at


def test_past_the_centre_of_a_ball_the_side_that_was_met_still_pushes_back() -> None:
    proxy = Proxy([CONVEX["sphere"]])
    stand(proxy, (0.0, 0.0, 0.013))
    for at in range(130):
        go(proxy, (0.0, 0.0, 0.013 - 1.5e-4 * at))
    assert spring(proxy)[2] == pytest.approx(0.012 - (0.013 - 1.5e-4 * 129), abs=1e-9)


def test_a_corner_of_a_room_holds_three_ways_at_once() -> None:
    proxy = Proxy([Placed("box", HERE, inside=True, size_m=(0.04, 0.03, 0.02))])
    stand(proxy, (0.0, 0.0, 0.0))
    for at in range(100):
        go(proxy, (0.0003 * at, 0.0002 * at, 0.00015 * at))
    assert spring(proxy) == pytest.approx((0.02 - 0.0297, 0.015 - 0.0198, 0.01 - 0.01485), abs=1e-12)


def test_a_stroke_over_a_rounded_edge_turns_the_force_steadily() -> None:
    """From the top to the side of a box, 1 mm deep along its surface: steps no larger than the turn a tick."""
    r, rounding_m, depth_m = 0.02, 0.004, 0.001
    proxy = Proxy([Placed("box", HERE, size_m=(2 * r, 2 * r, 2 * r), rounding_m=rounding_m)])
    stand(proxy, (0.0, 0.0, 0.021))
    path = [(1e-4 * at, 0.0, r - depth_m) for at in range(160)]
    centre = r - rounding_m
    turn = [0.5 * math.pi * at / 100 for at in range(101)]
    path += [
        (centre + (rounding_m - depth_m) * math.sin(a), 0.0, centre + (rounding_m - depth_m) * math.cos(a))
        for a in turn
    ]
    forces = []
    for p in path:
        go(proxy, p)
        forces.append(spring(proxy))
    assert all(norm(force) == pytest.approx(depth_m, abs=1e-12) for force in forces)
    assert max(norm(minus(b, a)) for a, b in itertools.pairwise(forces)) < depth_m * 0.5 * math.pi / 100 * 1.001
    assert forces[-1] == pytest.approx((depth_m, 0.0, 0.0), abs=1e-12)
