"""Random places where random devices press: shapes whose curvature is known, at any pose, with and without friction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from hapticd.shapes.pose import Pose
from hapticd.shapes.solid import Placed, Proxy
from hapticd_studies.space.linear import Matrix, SpaceLoop, Vector, surface_stiffness

KINDS = (
    "plane",
    "ball",
    "cavity",
    "cylinder",
    "pipe",
    "capsule's end",
    "box edge, rounded",
    "box corner, rounded",
    "edge of a room",
    "corner of a room",
    "plane with friction",
    "ball with friction",
)

_RADIUS_M = (0.01, 0.05)
_DEPTH_M = (2e-4, 2e-3)
_NEUTRAL = 2e-4


@dataclass(frozen=True)
class PressedPlace:
    """A device at rest, pressing a surface.

    Attributes:
        kind: one of `KINDS`.
        loop: the device.
        proxy: of the solid.
        above_m: a free point from which the device comes.
        at_m: where it rests, inside.
        shape: the contact's stiffness at 1 N/m, linearised there.
        stiffness_n_per_m: of the contact.
    """

    kind: str
    loop: SpaceLoop
    proxy: Proxy
    above_m: Vector
    at_m: Vector
    shape: Matrix
    stiffness_n_per_m: float


def draw(rng: Generator, kind: str) -> PressedPlace:
    """A random device at a random place of a kind, pressing 0.5 to 2 times the stiffness that it holds.

    What would take more than some 20 000 ticks to show its way, so near to the limit, is drawn again.
    """
    loop = draw_loop(rng)
    frame = _turn(rng)
    x, y, z = frame.T
    r, depth_m = rng.uniform(*_RADIUS_M), rng.uniform(*_DEPTH_M)
    turned = _quaternion(frame)
    pose = Pose.of([float(each) for each in rng.uniform(-0.05, 0.05, 3)], turned)
    centre = np.array(pose.position_m)
    side = 0.1
    friction = 0.0
    if kind == "plane":
        solid, on, normal, shape = Placed("plane", pose), centre, z, np.outer(z, z)
    elif kind == "plane with friction":
        solid, on, normal, shape, friction = Placed("plane", pose), centre, z, np.eye(3), 1.0
    elif kind == "ball with friction":
        solid, on, normal, shape, friction = Placed("sphere", pose, radius_m=r), centre + r * z, z, np.eye(3), 1.0
    elif kind == "ball":
        shape = surface_stiffness(z, (x, y), (1.0 / r, 1.0 / r), depth_m)
        solid, on, normal = Placed("sphere", pose, radius_m=r), centre + r * z, z
    elif kind == "cavity":
        shape = surface_stiffness(z, (x, y), (-1.0 / r, -1.0 / r), depth_m)
        solid, on, normal = Placed("sphere", pose, inside=True, radius_m=r), centre - r * z, z
    elif kind == "cylinder":
        shape = surface_stiffness(x, (y, z), (1.0 / r, 0.0), depth_m)
        solid, on, normal = Placed("cylinder", pose, radius_m=r, length_m=side), centre + r * x, x
    elif kind == "pipe":
        shape = surface_stiffness(x, (y, z), (-1.0 / r, 0.0), depth_m)
        solid, on, normal = Placed("cylinder", pose, inside=True, radius_m=r, length_m=side), centre - r * x, x
    elif kind == "capsule's end":
        normal = (x + y + z) / np.sqrt(3.0)
        along = np.linalg.svd(normal[None])[2][1:]
        shape = surface_stiffness(normal, along, (1.0 / r, 1.0 / r), depth_m)
        solid = Placed("capsule", pose, radius_m=r, length_m=side)
        on = centre + 0.5 * side * z + r * normal
    elif kind == "box edge, rounded":
        normal = (x + y) / np.sqrt(2.0)
        shape = surface_stiffness(normal, ((x - y) / np.sqrt(2.0), z), (1.0 / r, 0.0), depth_m)
        solid = Placed("box", pose, size_m=(2.0 * side,) * 3, rounding_m=r)
        on = centre + (side - r) * (x + y) + r * normal
    elif kind == "box corner, rounded":
        normal = (x + y + z) / np.sqrt(3.0)
        along = np.linalg.svd(normal[None])[2][1:]
        shape = surface_stiffness(normal, along, (1.0 / r, 1.0 / r), depth_m)
        solid = Placed("box", pose, size_m=(2.0 * side,) * 3, rounding_m=r)
        on = centre + (side - r) * (x + y + z) + r * normal
    else:  # two or three walls of a room at once
        walls = x + y if kind == "edge of a room" else x + y + z
        normal = -walls / np.linalg.norm(walls)
        shape = np.eye(3) - (np.outer(z, z) if kind == "edge of a room" else 0.0)
        solid = Placed("box", pose, inside=True, size_m=(2.0 * side,) * 3)
        on = centre + side * walls
    limit = loop.limit_n_per_m(shape)
    stiffness = limit
    while abs(loop.radius(stiffness * shape) - 1.0) < _NEUTRAL:
        share = float(np.exp(rng.uniform(-np.log(2.0), np.log(2.0))))
        stiffness = share * limit if 0.0 < limit < 1e6 else float(rng.uniform(1e3, 2e4))
    proxy = Proxy([solid], friction, friction)
    return PressedPlace(kind, loop, proxy, on + 1e-3 * normal, on - depth_m * normal, shape, stiffness)


def draw_loop(rng: Generator) -> SpaceLoop:
    """A device whose axes differ up to five times, coupled, in a light hand; 0 to 2 samples of delay."""
    mass = _between(rng, 0.1, 0.5)
    damping = _between(rng, 1.0, 5.0)
    hand = np.diag(rng.uniform(200.0, 1000.0, 3))
    return SpaceLoop(mass, damping, hand, float(rng.choice([0.25e-3, 0.5e-3, 1e-3, 2e-3])), int(rng.integers(0, 3)))


def _between(rng: Generator, low: float, high: float) -> Matrix:
    """A symmetric matrix whose eigenvalues lie between two values."""
    turn = _turn(rng)
    matrix: Matrix = turn @ np.diag(np.exp(rng.uniform(np.log(low), np.log(high), 3))) @ turn.T
    return 0.5 * (matrix + matrix.T)


def _turn(rng: Generator) -> Matrix:
    """A random rotation."""
    matrix, upper = np.linalg.qr(rng.normal(size=(3, 3)))
    matrix = matrix * np.sign(np.diag(upper))
    matrix[:, 0] *= np.sign(np.linalg.det(matrix))
    return matrix


def _quaternion(rotation: Matrix) -> tuple[float, float, float, float]:
    """The quaternion w x y z of a rotation, from the eigenvector that belongs to it."""
    r = rotation
    system = np.array(
        [
            [r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
            [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], r[1, 2] + r[2, 1]],
            [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1]],
        ]
    )
    w, x, y, z = (float(each) for each in np.linalg.eigh(system)[1][:, -1])
    return w, x, y, z
