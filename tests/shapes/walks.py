"""Solids, and hands that wander over them: fast and slow, shallow and past the centre."""

from __future__ import annotations

import math
import random
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from hapticd.shapes.field import Field
from hapticd.shapes.pose import Pose
from hapticd.shapes.proxy import follow, place
from hapticd.shapes.solid import Placed, Proxy

Point = tuple[float, float, float]

HERE = Pose.of((0.0, 0.0, 0.0))
ASKEW = Pose.of((0.01, -0.02, 0.015), (0.3, -0.5, 0.7, 0.4))

CONVEX = {
    "plane": Placed("plane", ASKEW),
    "sphere": Placed("sphere", HERE, radius_m=0.012),
    "box": Placed("box", ASKEW, size_m=(0.04, 0.03, 0.02)),
    "rounded box": Placed("box", ASKEW, size_m=(0.04, 0.03, 0.02), rounding_m=0.004),
    "plate": Placed("box", HERE, size_m=(0.06, 0.06, 0.001)),
    "capsule": Placed("capsule", ASKEW, radius_m=0.008, length_m=0.03),
    "cylinder": Placed("cylinder", ASKEW, radius_m=0.02, length_m=0.03),
    "rounded cylinder": Placed("cylinder", HERE, radius_m=0.02, length_m=0.03, rounding_m=0.003),
}

HOLLOW = {
    "cavity": Placed("sphere", ASKEW, inside=True, radius_m=0.02),
    "room": Placed("box", ASKEW, inside=True, size_m=(0.04, 0.03, 0.02)),
    "rounded room": Placed("box", HERE, inside=True, size_m=(0.04, 0.03, 0.02), rounding_m=0.005),
    "pipe": Placed("cylinder", HERE, inside=True, radius_m=0.015, length_m=0.04),
    "pill": Placed("capsule", HERE, inside=True, radius_m=0.015, length_m=0.02),
}

_LEAN = Pose.of((0.0, 0.0, 0.0), (math.cos(0.6), 0.0, math.sin(0.6), 0.0))
UNIONS: dict[str, list[Placed]] = {
    "flush boxes": [
        Placed("box", HERE, size_m=(0.03, 0.04, 0.02)),
        Placed("box", Pose.of((0.02, 0.0, 0.0)), size_m=(0.03, 0.04, 0.02)),
    ],
    "corner": [
        Placed("box", ASKEW, size_m=(0.06, 0.06, 0.01)),
        Placed("box", Pose.of(ASKEW.point((0.0, 0.02, 0.015)), (0.3, -0.5, 0.7, 0.4)), size_m=(0.06, 0.01, 0.04)),
    ],
    "valley": [Placed("plane", HERE), Placed("plane", _LEAN)],
    "ball in a table": [Placed("plane", HERE), Placed("sphere", Pose.of((0.0, 0.0, 0.005)), radius_m=0.012)],
    "cross": [
        Placed("cylinder", HERE, radius_m=0.006, length_m=0.05),
        Placed("capsule", Pose.of((0.0, 0.0, 0.0), (1.0, 1.0, 0.0, 0.0)), radius_m=0.006, length_m=0.04),
        Placed("sphere", HERE, radius_m=0.01),
    ],
}


def torus(x: float, y: float, z: float) -> float:
    """Distance to a ring of 15 mm about z, 6 mm thick [m]."""
    return math.hypot(math.hypot(x, y) - 0.015, z) - 0.006


def field_of(true: Callable[[float, float, float], float], half_m: float, spacing_m: float) -> Field:
    """A field of a function, on a cube about the origin."""
    count = round(2.0 * half_m / spacing_m) + 1
    at = [spacing_m * (each - 0.5 * (count - 1)) for each in range(count)]
    values = array("f", (true(x, y, z) for x in at for y in at for z in at))
    return Field((count, count, count), (at[0], at[0], at[0]), spacing_m, 2.0 * spacing_m, 1e-3, values)


TORUS = field_of(torus, 0.0245, 1e-3)

FIELDS: dict[str, list[Placed]] = {
    "torus": [Placed("mesh", ASKEW, field=TORUS)],
    "hollow torus": [Placed("mesh", HERE, inside=True, field=TORUS)],
    "torus on a table": [Placed("plane", HERE), Placed("mesh", Pose.of((0.0, 0.0, 0.002)), field=TORUS)],
}

SOLIDS: dict[str, list[Placed]] = {name: [shape] for name, shape in (CONVEX | HOLLOW).items()} | UNIONS | FIELDS


@dataclass(frozen=True, slots=True)
class Moment:
    """One tick of a walk: where the device is, its move, and the spring that holds it."""

    p: Point
    dp: Point
    spring: Point
    proxy: Proxy


def spring(proxy: Proxy) -> Point:
    """From the device to the proxy [m]."""
    return (
        proxy.depth_m * proxy.normal_x + proxy.stretch_x,
        proxy.depth_m * proxy.normal_y + proxy.stretch_y,
        proxy.depth_m * proxy.normal_z + proxy.stretch_z,
    )


def dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def norm(a: Point) -> float:
    return math.sqrt(dot(a, a))


def minus(a: Point, b: Point) -> Point:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def stand(proxy: Proxy, p: Point) -> None:
    place(proxy, proxy.others, proxy.voxels, *p)


def go(proxy: Proxy, p: Point) -> None:
    follow(proxy, proxy.others, proxy.voxels, *p)


def walk(
    proxy: Proxy, seed: int, ticks: int, speed_m_per_s: float = 0.3, pull_per_s: float = 30.0, reach_m: float = 0.04
) -> Iterator[Moment]:
    """A hand that wanders about the place of the solid, and through it; 1 ms a tick.

    Args:
        proxy: the proxy of the solid.
        seed: of the walk.
        ticks: how many.
        speed_m_per_s: about how fast it is.
        pull_per_s: how firmly it turns to points near the middle, a new one every 100 ticks.
        reach_m: how far these points are from the middle.
    """
    rng = random.Random(seed)
    middle = proxy.shapes[0].pose.position_m
    p: Point = tuple(at + rng.gauss(0.0, reach_m) for at in middle)  # type: ignore[assignment]  # three of them
    v = [0.0, 0.0, 0.0]
    target = list(p)
    stand(proxy, p)
    for tick in range(ticks):
        if tick % 100 == 0:
            target = [at + rng.gauss(0.0, 0.5 * reach_m) for at in middle]
        for axis in range(3):
            v[axis] = 0.97 * v[axis] + pull_per_s * 0.03 * (target[axis] - p[axis])
            v[axis] += rng.gauss(0.0, 0.25 * speed_m_per_s)
        dp: Point = (1e-3 * v[0], 1e-3 * v[1], 1e-3 * v[2])
        p = (p[0] + dp[0], p[1] + dp[1], p[2] + dp[2])
        go(proxy, p)
        yield Moment(p, dp, spring(proxy), proxy)
