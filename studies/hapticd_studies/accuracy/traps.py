"""Two integrators that mislead when they take one step a sample, on the simulation of the paper."""

from __future__ import annotations

from dataclasses import dataclass

from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import ConstantForce, Hand, SimulationOptions
from hapticd_studies.accuracy.leak import leak

STIFFNESS_N_PER_M = 3000.0
PRESS_N = 5.0
PERIOD_S = 1e-3
DURATION_S = 3.0
_LAST_TICKS = 300


@dataclass(frozen=True, slots=True)
class Trap:
    """The paper's mass against the paper's wall, without a law, under one integrator.

    Attributes:
        integrator: one step of it a sample.
        leak_share: what the wall gains, in units of K T / 2.
        peak_to_peak_m: span of the last 0.3 s of 3 s [m].
    """

    integrator: str
    leak_share: float
    peak_to_peak_m: float


def traps() -> list[Trap]:
    """What the exact step and both Euler methods make of it."""
    found = []
    for integrator in ("exact", "explicit-euler", "semi-implicit-euler"):
        options = SimulationOptions(
            model="paper-simulation", integrator=integrator, hand=Hand(force=ConstantForce(newton=-PRESS_N))
        )
        device = SimulatedDevice(options, PERIOD_S)
        positions = []
        for _ in range(round(DURATION_S / PERIOD_S)):
            device.advance(max(0.0, -STIFFNESS_N_PER_M * device.measured_m))
            positions.append(device.x_m)
        last = positions[-_LAST_TICKS:]
        share = leak(options, STIFFNESS_N_PER_M, PERIOD_S, PRESS_N / STIFFNESS_N_PER_M).share
        found.append(Trap(integrator, share, max(last) - min(last)))
    return found
