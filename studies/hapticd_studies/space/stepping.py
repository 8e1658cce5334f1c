"""A place stepped tick by tick, with the proxy of the loop itself: does a small push die out or grow?"""

from __future__ import annotations

import numpy as np

from hapticd.shapes.proxy import follow, place
from hapticd.shapes.solid import Proxy
from hapticd_studies.space.places import PressedPlace

PUSH_M = 1e-8
"""Size of the push; small, so that what is curved looks straight."""

GROWN = 100.0
"""A push that has grown so many times, or shrunk, has shown its way."""

MOST_TICKS = 60_000


def settles(pressed: PressedPlace, seed: int) -> bool | None:
    """Whether a push dies out; None when it has done neither in `MOST_TICKS`.

    Args:
        pressed: the place.
        seed: of the push's direction.
    """
    proxy, k = pressed.proxy, pressed.stiffness_n_per_m
    others, voxels = proxy.others, proxy.voxels
    rest = [float(each) for each in pressed.at_m]
    place(proxy, others, voxels, *(float(each) for each in pressed.above_m))
    follow(proxy, others, voxels, *rest)
    hold = [k * each for each in _spring(proxy)]  # what the hand presses with
    free, forced = pressed.loop.held
    rows = [[float(each) for each in (*a, *b)] for a, b in zip(free, forced, strict=True)]
    push = np.random.default_rng(seed).normal(size=3)
    state = [*(float(each) for each in PUSH_M * push / np.linalg.norm(push)), 0.0, 0.0, 0.0]
    waiting = [[0.0, 0.0, 0.0] for _ in range(pressed.loop.delay)]
    period_s = pressed.loop.period_s
    low, high = PUSH_M / GROWN, PUSH_M * GROWN
    quiet = 0
    for _ in range(MOST_TICKS):
        x, y, z, vx, vy, vz = state
        follow(proxy, others, voxels, rest[0] + x, rest[1] + y, rest[2] + z)
        waiting.append([k * each - held for each, held in zip(_spring(proxy), hold, strict=True)])
        ux, uy, uz = waiting.pop(0)
        state = [
            a * x + b * y + c * z + d * vx + e * vy + f * vz + g * ux + h * uy + i * uz
            for a, b, c, d, e, f, g, h, i in rows
        ]
        size = max(map(abs, state[:3])) + period_s * max(map(abs, state[3:]))
        if size > high:
            return False
        quiet = quiet + 1 if size < low else 0
        if quiet > 20:
            return True
    return None


def _spring(proxy: Proxy) -> list[float]:
    depth_m = proxy.depth_m
    return [
        depth_m * proxy.normal_x + proxy.stretch_x,
        depth_m * proxy.normal_y + proxy.stretch_y,
        depth_m * proxy.normal_z + proxy.stretch_z,
    ]
