"""A hand that presses and releases what is in a scene, where there is no hand: to warm a tick up, or to time it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hapticd.device import Sample
from hapticd.shapes.solid import Proxy
from hapticd.shapes.surface import SURFACE_M, distance
from hapticd.tick.remote.port import Port
from hapticd.tick.remote.update import FORCE, POSITION, VELOCITY, Update
from hapticd.tick.space.tick import SpaceTick
from hapticd.tick.tick import ControlTick

_STEPS = 10
"""Samples from a wall's surface to the deepest point of a press."""

_STEP_M = 1e-4
_OFF_M = (1e-3, 2e-3, 3e-3)
"""Off the middle of an object, from which no way may be the nearest."""

_WAYS = 64
_SHARE_OF_LIMIT = 0.1
"""Speed of the hand, as a share of what the guard lets pass along one axis."""


class Press:
    """A hand on the walls or the first object of a tick that is armed and made for this, a period a tick.

    What clients drive is driven, to where it is or, by a small force, nowhere.

    Args:
        tick: fresh; it is of no other use afterwards.
    """

    def __init__(self, tick: ControlTick) -> None:
        self._tick = tick
        self._count = 0
        self._sample = Sample(len(tick.info.axes))
        self._step_m = min(_STEP_M, _SHARE_OF_LIMIT * tick.guard.max_speed_m_per_s * tick.period_s)
        self._period_ns = round(tick.period_s * 1e9)
        self._surface_m, self._out = _surface(tick)
        self._said = [(port, _word(port, self._surface_m)) for port in tick.ports]
        self._move()
        tick.start(self._sample)
        tick.arm()

    def step(self) -> None:
        """Move by a sample, and let the tick answer."""
        self._count += 1
        self._move()
        for port, update in self._said:
            update.stamp(update.said, self._count)
            port.take(update)
        self._tick.advance(self._sample, self._tick.period_s)

    def _move(self) -> None:
        height_m = self._step_m * (abs(self._count % (4 * _STEPS) - 2 * _STEPS) - _STEPS)
        sample = self._sample
        sample.time_ns = self._count * self._period_ns
        sample.sequence = self._count
        sample.position_m[:] = [at_m + height_m * out for at_m, out in zip(self._surface_m, self._out, strict=True)]


def _surface(tick: ControlTick) -> tuple[list[float], list[float]]:
    """A point on every wall, or on the first object [m], and the way that leads through it."""
    if isinstance(tick, SpaceTick) and tick.solids:
        return _surface_of(tick.solids[0].solid.proxy)
    surface_m = [_middle(low_m, high_m) for low_m, high_m in tick.info.workspace_m]
    for wall in [contact.wall for contact in tick.contacts]:
        low_m, high_m = tick.info.workspace_m[wall.axis]
        surface_m[wall.axis] = min(max(wall.position_m, low_m), high_m)
    return surface_m, [1.0] * len(surface_m)


def _word(port: Port, surface_m: Sequence[float]) -> Update:
    """What a client would say of it: an object is where it is, and the target of a coupling where the hand is."""
    update = Update()
    at_m = port.target_m if port.kind == "object" else surface_m
    update.said = POSITION | VELOCITY | FORCE
    update.position_m[: len(at_m)] = at_m
    update.force_n[0] = _SHARE_OF_LIMIT * port.limits.max_force_n
    return update


def _surface_of(proxy: Proxy) -> tuple[list[float], list[float]]:
    """A point on a solid [m], and its normal: from somewhere near its middle always as far as the surface is away."""
    pose = proxy.pose
    x_m, y_m, z_m = _OFF_M
    for _ in range(_WAYS):
        distance_m, *normal = distance(proxy, proxy.others, proxy.voxels, x_m, y_m, z_m)
        x_m, y_m, z_m = (own_m - distance_m * out for own_m, out in zip((x_m, y_m, z_m), normal, strict=True))
        if abs(distance_m) < SURFACE_M:
            break
    return list(pose.point((x_m, y_m, z_m))), list(pose.out(normal))


def _middle(low_m: float, high_m: float) -> float:
    middle_m = 0.5 * (low_m + high_m)
    return middle_m if math.isfinite(middle_m) else 0.0
