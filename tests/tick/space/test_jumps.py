"""No force jumps beyond what motion and stiffness allow, through the whole tick: scene, law and guard.

A spring whose other end stays on the surface changes its force by k |dp| at most where the way to the surface is
nonexpansive: the free room is convex, or the solid is rounded by twice the depth. A law adds a damper, which may come
and go; the guard's limit takes the nearest force within a ball, which makes no change larger. Over an edge that is
sharp the force may end at once, but nowhere may it grow by more than that.
"""

from __future__ import annotations

import math
import random
from functools import cache
from itertools import product

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hapticd.shapes.solid import Proxy
from hapticd.shapes.surface import SURFACE_M, distance
from hapticd.tick.space.solid import placed
from tests.examples import examples
from tests.tick.space.rig import Point, Rig, apart, ball, length, table

STIFFNESS = 12e3
LAWS = ("none", "ring-damping", "energy-cycle")
TURNED = (0.3, -0.5, 0.7, 0.4)
LEAN = (math.cos(0.6), 0.0, math.sin(0.6), 0.0)

ROOMS = {
    "plane": table("plane", "plane", STIFFNESS, orientation=TURNED),
    "cavity": ball("cavity", STIFFNESS, inside=True, radius_m=0.02),
    "room": table("room", "box", STIFFNESS, inside=True, size_m=(0.04, 0.03, 0.02), orientation=TURNED),
    "rounded room": table("room", "box", STIFFNESS, inside=True, size_m=(0.04, 0.03, 0.02), rounding_m=0.005),
    "pipe": table("pipe", "cylinder", STIFFNESS, inside=True, radius_m=0.015, length_m=0.04),
    "pill": table("pill", "capsule", STIFFNESS, inside=True, radius_m=0.015, length_m=0.02),
    "valley": table("left", "plane", STIFFNESS) + table("right", "plane", STIFFNESS, orientation=LEAN),
    "two walls": table("left", "plane", STIFFNESS) + table("right", "plane", STIFFNESS / 2.0, orientation=LEAN),
}
ROUNDED = {
    "ball": (0.012, ball("ball", STIFFNESS, radius_m=0.012)),
    "capsule": (0.008, table("capsule", "capsule", STIFFNESS, radius_m=0.008, length_m=0.03, orientation=TURNED)),
    "box": (
        0.004,
        table("box", "box", STIFFNESS, size_m=(0.04, 0.03, 0.02), rounding_m=0.004, orientation=TURNED),
    ),
    "cylinder": (0.003, table("cylinder", "cylinder", STIFFNESS, radius_m=0.02, length_m=0.03, rounding_m=0.003)),
}
SHARP = {
    "box": table("box", "box", STIFFNESS, size_m=(0.04, 0.03, 0.02), orientation=TURNED),
    "plate": table("plate", "box", STIFFNESS, size_m=(0.06, 0.06, 0.001)),
    "cylinder": table("cylinder", "cylinder", STIFFNESS, radius_m=0.02, length_m=0.03, orientation=TURNED),
    "notch": table("one", "box", STIFFNESS, size_m=(0.06, 0.06, 0.01))
    + table("two", "box", STIFFNESS, size_m=(0.06, 0.01, 0.04), position_m=(0.0, 0.02, 0.015)),
    "ball in a table": table("table", "plane", STIFFNESS) + ball("ball", STIFFNESS, radius_m=0.012),
    "ball on a softer table": table("table", "plane", STIFFNESS / 2.0) + ball("ball", STIFFNESS, radius_m=0.012),
}

seeds = st.integers(0, 2**32)
speeds = st.sampled_from([0.05, 0.3, 1.5])
laws = st.sampled_from(LAWS)


@cache
def free(scene: str) -> Point:
    """A point near the origin out of everything: a device that starts inside comes in by a ramp."""
    off = (0.0, 0.005, -0.005, 0.03)
    for at in product(off, off, off):
        if not any(solid.depth_m for solid in Rig(scene).start(at).tick.solids):
            return at
    raise AssertionError("no room is left")


def about(scene: str, seed: int, speed: float) -> list[Point]:
    """A way about a free point."""
    x, y, z = free(scene)
    return [(x, y, z), *((x + dx, y + dy, z + dz) for dx, dy, dz in way(seed, 150, speed, 0.02))]


def way(seed: int, ticks: int, speed: float, reach_m: float) -> list[Point]:
    """Where a hand goes that wanders about the origin, a point a tick."""
    draw = random.Random(seed)
    at, v = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    target = [0.0, 0.0, 0.0]
    points: list[Point] = []
    for tick in range(ticks):
        if tick % 60 == 0:
            target = [draw.gauss(0.0, reach_m) for _ in range(3)]
        for axis in range(3):
            v[axis] = 0.9 * v[axis] + 4.0 * speed / reach_m * 0.1 * (target[axis] - at[axis])
            v[axis] += draw.gauss(0.0, 0.1 * speed)
            at[axis] += 1e-3 * v[axis]
        points.append((at[0], at[1], at[2]))
    return points


def stroke(rig: Rig, seed: int, ticks: int, speed: float, most_m: float) -> list[Point]:
    """The same over the surface of a convex solid, edges and corners included, at most so deep and now and then off."""
    solid = rig.tick.solids[0].solid
    proxy = Proxy([placed(solid.configs[0])])
    points: list[Point] = []
    for tick, at in enumerate(way(seed, ticks, 3.0 * speed, 0.1)):
        size = max(length(at), 1e-6)
        out = tuple((0.08 + 0.02 * size) * value / size for value in at) if length(at) > 0.0 else (0.08, 0.0, 0.0)
        x, y, z = proxy.pose.own(out)
        d, nx, ny, nz = distance(proxy, proxy.others, proxy.voxels, x, y, z)
        d += most_m * (0.4 - 0.6 * math.cos(0.1 * tick))  # it begins free
        points.append(proxy.pose.point((x - d * nx, y - d * ny, z - d * nz)))
    return points


def drags_n(rig: Rig) -> float:
    """What the laws' dampers may come to at the velocity of now [N]."""
    return sum(
        channel.damping_n_s_per_m * abs(channel.velocity_m_per_s)
        for solid in rig.tick.solids
        for channel in solid.channels
        if solid.depth_m > 0.0
    )


def stiffness_of(rig: Rig) -> float:
    return sum(solid.solid.stiffness_n_per_m for solid in rig.tick.solids)


def worst_jump(rig: Rig, points: list[Point], more: float = 0.0) -> float:
    """By how much a change of the force goes beyond what is allowed, at the worst [N]."""
    stiffness = stiffness_of(rig)
    rig.start(points[0])
    before, force, drag_n = points[0], rig.force, 0.0
    worst = -math.inf
    for at in points[1:]:
        rig.go(at)
        now_n = drags_n(rig)
        allowed_n = stiffness * ((1.01 + more) * apart(at, before) + SURFACE_M) + drag_n + now_n
        worst = max(worst, apart(rig.force, force) - allowed_n)
        before, force, drag_n = at, rig.force, now_n
    return worst


@pytest.mark.parametrize("name", ROOMS)
def test_in_a_convex_room_no_force_jumps(name: str) -> None:
    touched: list[bool] = []

    @examples(4)
    @given(seed=seeds, speed=speeds, law=laws)
    def hold(seed: int, speed: float, law: str) -> None:
        rig = Rig(ROOMS[name], law)
        assert worst_jump(rig, about(ROOMS[name], seed, speed)) <= 0.0
        touched.append(any(map(any, rig.forces)))

    hold()
    assert any(touched)


@pytest.mark.parametrize("name", ["plane", "room", "valley"])
def test_a_surface_with_friction_adds_its_cone_and_no_more(name: str) -> None:
    """The spring along the surface follows the depth as well; with one coefficient no slip lets it snap back."""
    scene = ROOMS[name].replace("shape =", "static_friction = 0.5\ndynamic_friction = 0.5\nshape =")

    @examples(4)
    @given(seed=seeds, speed=speeds, law=laws)
    def hold(seed: int, speed: float, law: str) -> None:
        assert worst_jump(Rig(scene, law), about(scene, seed, speed), more=0.5) <= 0.0

    hold()


@pytest.mark.parametrize("name", ROUNDED)
def test_over_edges_that_are_round_no_force_jumps(name: str) -> None:
    rounding_m, scene = ROUNDED[name]
    deepest: list[float] = []

    @examples(4)
    @given(seed=seeds, speed=speeds, law=laws)
    def hold(seed: int, speed: float, law: str) -> None:
        rig = Rig(scene, law)
        points = stroke(rig, seed, 150, speed, 0.5 * rounding_m)
        assert worst_jump(rig, points) <= 0.0
        deepest.append(max(map(length, rig.forces)))

    hold()
    assert max(deepest) > 5.0


@pytest.mark.parametrize("name", [*ROOMS, *SHARP])
def test_no_force_grows_or_turns_round_by_more_than_the_device_moved(name: str) -> None:
    scene = ROOMS.get(name) or SHARP[name]

    @examples(4)
    @given(seed=seeds, speed=speeds, law=laws, friction=st.sampled_from([None, (0.8, 0.3)]))
    @example(seed=1683920953, speed=0.05, law="none", friction=(0.8, 0.3))  # deep beside a wall of the notch
    @example(seed=1725604709, speed=0.3, law="none", friction=None)  # and near its end
    @example(seed=1994430969, speed=0.3, law="none", friction=(0.8, 0.3))  # and near its back
    def hold(seed: int, speed: float, law: str, friction: tuple[float, float] | None) -> None:
        text = scene
        if friction:
            keys = f"static_friction = {friction[0]}\ndynamic_friction = {friction[1]}\nshape ="
            text = text.replace("shape =", keys)
        rig = Rig(text, law)
        points = about(text, seed, speed)
        rig.start(points[0])
        before, force, drag_n = points[0], rig.force, 0.0
        for at in points[1:]:
            rig.go(at)
            now_n = drags_n(rig)
            allowed_n = stiffness_of(rig) * (apart(at, before) + SURFACE_M) + drag_n + now_n
            on = sum(now * then for now, then in zip(rig.force, force, strict=True)) >= 0.0
            assert length(rig.force) <= allowed_n + (length(force) if on else 0.0)
            before, force, drag_n = at, rig.force, now_n

    hold()
