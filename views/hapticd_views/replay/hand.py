"""The force of the hand, from a recorded motion, the force that was applied and a model of the device.

    m a + b v + k x = F_hand + F

holds between ticks with F held, in closed form. The position is measured in steps, so the acceleration cannot be taken
from differences: 1e-5 m at 1 kHz is 10 m/s^2. A fixed-interval smoother (Rauch, Tung and Striebel 1965) is used, with
the hand's force as a random walk, which it follows up to a bandwidth f: the poles of the filter lie on a circle of
radius 2 pi f, since the walk's intensity is q = m^2 r T (2 pi f)^6, r being the variance of the position and T the
period.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import ConstantForce, Hand, RecordedForce, SimulationOptions
from hapticd.simulation.plant.hold import flow

LEAST_STEP_M = 1e-9
"""Of a position without steps, the size of those that it is taken to have [m]."""


@dataclass(frozen=True, eq=False)
class HandForce:
    """What the hand did.

    Attributes:
        force_n: along the wall's normal, > 0 outwards; held over the period that begins with the tick [N].
        x_m, v_m_per_s: the motion that it goes with.
    """

    force_n: Any
    x_m: Any
    v_m_per_s: Any

    def on(self, device: SimulationOptions, period_s: float) -> SimulationOptions:
        """The device with this hand, where the motion begins."""
        points = tuple((at * period_s, float(force_n)) for at, force_n in enumerate(self.force_n))
        hand = device.hand.model_copy(update={"force": RecordedForce(points=points)})
        return device.model_copy(
            update={
                "hand": hand,
                "initial_position_m": float(self.x_m[0]),
                "initial_velocity_m_per_s": float(self.v_m_per_s[0]),
                "coulomb_n": 0.0,
                "flexible": None,
                "changes": (),
            }
        )


def identify(x_m: Any, force_n: Any, device: SimulationOptions, period_s: float, bandwidth_hz: float) -> HandForce:
    """The force of the hand that was on a device.

    What the model does not have, such as Coulomb friction, a flexible handle or a mass that is another one, is in this
    force as well.

    Args:
        x_m: measured positions on the wall's normal, one a period.
        force_n: commanded forces, each from its tick to the next.
        device: its mass, friction, resolution, noise and actuator, and of its hand mass, damping and spring.
        period_s: time between ticks [s].
        bandwidth_hz: up to where the hand's force is followed.
    """
    mass_kg = device.mass_kg + device.hand.mass_kg
    decay_per_s = (device.viscous_n_s_per_m + device.hand.damping_n_s_per_m) / mass_kg
    slope, swing, area = flow(decay_per_s, device.hand.stiffness_n_per_m / mass_kg, period_s)
    pull = device.hand.stiffness_n_per_m / mass_kg
    move = np.array(
        [[1.0 - pull * area, swing, area / mass_kg], [-pull * swing, slope, swing / mass_kg], [0.0, 0.0, 1.0]]
    )
    push = np.array([area / mass_kg, swing / mass_kg, 0.0])
    variance = max(device.resolution_m, LEAST_STEP_M) ** 2 / 12.0 + device.noise_m**2
    walk = np.zeros((3, 3))
    walk[2, 2] = mass_kg**2 * variance * (2.0 * math.pi * bandwidth_hz) ** 6 * period_s**2
    states = _smooth(np.asarray(x_m), _applied(force_n, device, period_s), move, push, walk, variance)
    return HandForce(states[:, 2], states[:, 0], states[:, 1])


def _applied(force_n: Any, device: SimulationOptions, period_s: float) -> Any:
    """What the actuator made of the commands: delay, saturation, lag."""
    still = {"hand": Hand(force=ConstantForce(newton=0.0)), "changes": (), "noise_m": 0.0, "flexible": None}
    actuator = SimulatedDevice(device.model_copy(update=still), period_s)
    applied = []
    for command_n in force_n:
        actuator.advance(float(command_n))
        applied.append(actuator.applied_n)
    return np.array(applied)


def _smooth(x_m: Any, applied_n: Any, move: Any, push: Any, walk: Any, variance: float) -> Any:
    """States of all ticks: a Kalman filter forward, its corrections backward."""
    count = len(x_m)
    state = np.array([x_m[0], 0.0, 0.0])
    doubt = np.diag([variance, 1.0, 100.0])
    believed, foreseen = np.empty((count, 3)), np.empty((count, 3))
    doubts, foreseen_doubts = np.empty((count, 3, 3)), np.empty((count, 3, 3))
    for at in range(count):
        if at:
            state = move @ state + push * applied_n[at - 1]
            doubt = move @ doubt @ move.T + walk
        foreseen[at], foreseen_doubts[at] = state, doubt
        gain = doubt[:, 0] / (doubt[0, 0] + variance)
        state = state + gain * (x_m[at] - state[0])
        doubt = doubt - np.outer(gain, doubt[0])
        doubt = 0.5 * (doubt + doubt.T)
        believed[at], doubts[at] = state, doubt
    shares = doubts[:-1] @ move.T @ np.linalg.inv(foreseen_doubts[1:])
    for at in range(count - 2, -1, -1):
        believed[at] += shares[at] @ (believed[at + 1] - foreseen[at + 1])
    return believed
