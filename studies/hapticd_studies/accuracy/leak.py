"""How much energy one integrator makes of a sampled wall, from its one-tick map and not from waiting.

    s(n+1) = A s(n),  s = (x, v),  F(n) = -K x(n) held over T          a wall that is felt on both sides, nothing else

A is 2 x 2. Its determinant says what the loop gains: a damper b alone would make it exp(-b T / m), so what it exceeds
that by is a negative damping, the leak; for the exact step about K T / 2. The angle of its eigenvalues is the swing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import ConstantForce, SimulationOptions


@dataclass(frozen=True, slots=True)
class Leak:
    """What a wall gains under one integrator.

    Attributes:
        damping_n_s_per_m: negative damping that the sampled wall amounts to [N s/m].
        theory_n_s_per_m: K T / 2, the analytic leak of a sampled spring [N s/m].
        per_cycle_j: energy made in one swing of a given depth [J]; NaN when the loop does not swing.
        theory_per_cycle_j: the same from the analytic leak, over a swing of sqrt(K / m) [J].
        determinant: of A.
        radius: largest magnitude of an eigenvalue; the loop is stable below 1.
    """

    damping_n_s_per_m: float
    theory_n_s_per_m: float
    per_cycle_j: float
    theory_per_cycle_j: float
    determinant: float
    radius: float

    @property
    def share(self) -> float:
        """The leak in units of K T / 2: 1 is right."""
        return self.damping_n_s_per_m / self.theory_n_s_per_m if self.theory_n_s_per_m else math.nan

    @property
    def words(self) -> str:
        """Whether the linear loop is stable."""
        return "stable" if self.radius < 1.0 - 1e-9 else "marginal" if self.radius <= 1.0 + 1e-9 else "unstable"


def leak(
    options: SimulationOptions,
    stiffness_n_per_m: float,
    period_s: float,
    depth_m: float,
    make_device: Callable[[SimulationOptions, float], SimulatedDevice] = SimulatedDevice,
) -> Leak:
    """What a wall gains on the mass, damping and hand of a device, under the device's integrator.

    Args:
        options: the device; its sensor, actuator, friction and hand force are left out.
        stiffness_n_per_m: of the wall, K [N/m].
        period_s: T [s].
        depth_m: amplitude of the swing that `per_cycle_j` is for [m].
        make_device: makes the device model.
    """
    linear = options.model_copy(
        update={
            "hand": options.hand.model_copy(update={"force": ConstantForce()}),
            "coulomb_n": 0.0,
            "noise_m": 0.0,
            "resolution_m": 0.0,
            "max_force_n": 0.0,
            "bandwidth_hz": 0.0,
            "force_delay_samples": 0,
            "changes": (),
        }
    )
    scale = np.array([1e-3, 1e-1])  # so that tolerances of an adaptive integrator see usual sizes
    columns = []
    for x_m, v_m_per_s in ((scale[0], 0.0), (0.0, scale[1])):
        start = {"initial_position_m": float(x_m), "initial_velocity_m_per_s": float(v_m_per_s)}
        device = make_device(linear.model_copy(update=start), period_s)
        device.advance(-stiffness_n_per_m * float(x_m))
        columns.append([device.x_m, device.v_m_per_s])
    one_tick = np.array(columns).T / scale
    mass_kg = options.mass_kg + options.hand.mass_kg
    damping = options.viscous_n_s_per_m + options.hand.damping_n_s_per_m
    determinant = float(one_tick[0, 0] * one_tick[1, 1] - one_tick[0, 1] * one_tick[1, 0])
    found = math.nan
    if determinant > 0.0:
        found = damping + mass_kg / period_s * math.log(determinant)
    roots = np.linalg.eigvals(one_tick)
    angle = abs(float(np.angle(roots[0])))
    swings = bool(abs(roots[0].imag) > 0.0) and found == found
    stored_j = 0.5 * stiffness_n_per_m * depth_m * depth_m
    ticks = 2.0 * math.pi / angle if swings else math.nan
    theory = 0.5 * stiffness_n_per_m * period_s
    return Leak(
        damping_n_s_per_m=found,
        theory_n_s_per_m=theory,
        per_cycle_j=stored_j * math.expm1(found * period_s / mass_kg * ticks) if swings else math.nan,
        theory_per_cycle_j=stored_j * math.expm1(theory * 2.0 * math.pi / math.sqrt(stiffness_n_per_m * mass_kg)),
        determinant=determinant,
        radius=float(np.max(np.abs(roots))),
    )
