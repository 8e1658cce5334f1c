"""One loop of a batch, as a study asks for it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hapticd.config.walls import WallConfig
from hapticd.law import LawParams
from hapticd.simulation.options import SimulationOptions


@dataclass(frozen=True, slots=True)
class Point:
    """One loop of a grid.

    Attributes:
        device: the device model, hand included.
        wall: stiffness, damping and their changes; where it stands does not matter.
        params: the law's parameters.
        period_s: time between ticks, whole nanoseconds where it is to be the daemon's to the last bit [s].
        max_force_n: the guard's limit; the daemon's is never above the force at which the device saturates [N].
        velocity_samples: samples that the velocity difference spans.
        target_m: where it should settle; NaN: nowhere, then no settling time is looked for [m].
        band_m: settled means within this of the target [m].
    """

    device: SimulationOptions
    wall: WallConfig
    params: LawParams
    period_s: float = 1e-3
    max_force_n: float = math.inf
    velocity_samples: int = 1
    target_m: float = math.nan
    band_m: float = 0.0
