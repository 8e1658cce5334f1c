"""The first calls of a tick, made before the first deadline."""

from __future__ import annotations

import gc
import math
from collections.abc import Sequence

from hapticd.device import Sample
from hapticd.tick.remote.port import Port
from hapticd.tick.remote.update import FORCE, POSITION, VELOCITY, Update
from hapticd.tick.space.solid_contact import SolidContact
from hapticd.tick.space.tick import SpaceTick
from hapticd.tick.tick import ControlTick

TICKS = 200

_STEPS = 10
"""Samples from a wall's surface to the deepest point of a press."""

_STEP_M = 1e-4
_SHARE_OF_LIMIT = 0.1
"""Speed of the hand, as a share of what the guard lets pass along one axis."""


def warm_up(tick: ControlTick) -> None:
    """Press and release walls or the first object of a tick made for this, as a hand would, a period a tick.

    What clients drive is driven, to where it is or, by a small force, nowhere.

    Args:
        tick: fresh; it is of no other use afterwards.
    """
    sample = Sample(len(tick.info.axes))
    step_m = min(_STEP_M, _SHARE_OF_LIMIT * tick.guard.max_speed_m_per_s * tick.period_s)
    surface_m = [_middle(low_m, high_m) for low_m, high_m in tick.info.workspace_m]
    for wall in [contact.wall for contact in tick.contacts]:
        low_m, high_m = tick.info.workspace_m[wall.axis]
        surface_m[wall.axis] = min(max(wall.position_m, low_m), high_m)
    if isinstance(tick, SpaceTick) and tick.solids:
        surface_m = _surface_of(tick.solids[0])
    period_ns = round(tick.period_s * 1e9)
    said = [(port, _word(port, surface_m)) for port in tick.ports]
    for count in range(TICKS + 1):
        depth_m = step_m * (abs(count % (4 * _STEPS) - 2 * _STEPS) - _STEPS)
        sample.time_ns = count * period_ns
        sample.sequence = count
        sample.position_m[:] = [at_m + depth_m for at_m in surface_m]
        if count == 0:
            tick.start(sample)
            tick.arm()
        else:
            for port, update in said:
                port.take(update)
            tick.advance(sample, tick.period_s)
    gc.collect()


def _word(port: Port, surface_m: Sequence[float]) -> Update:
    """What a client would say of it: an object is where it is, and the target of a coupling where the hand is."""
    update = Update()
    at_m = port.target_m if port.kind == "object" else surface_m
    update.said = POSITION | VELOCITY | FORCE
    update.position_m[: len(at_m)] = at_m
    update.force_n[0] = _SHARE_OF_LIMIT * port.limits.max_force_n
    return update


def _surface_of(contact: SolidContact) -> list[float]:
    """A point on a solid: the nearest to its middle, where it has one [m]."""
    at_m = contact.solid.placed[0].pose.position_m
    contact.start(*at_m)
    proxy = contact.solid.proxy
    normal = (proxy.normal_x, proxy.normal_y, proxy.normal_z)
    return [middle + contact.depth_m * along for middle, along in zip(at_m, normal, strict=True)]


def _middle(low_m: float, high_m: float) -> float:
    middle_m = 0.5 * (low_m + high_m)
    return middle_m if math.isfinite(middle_m) else 0.0
