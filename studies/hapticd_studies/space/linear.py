"""The linearised loop of a device in space that presses a surface: its eigenvalues, and the stiffness at their limit.

    M x'' + B x' + H x = u,    u(n) = -K x(n - delay) held over a period T

M, B: mass and friction of device and hand; H: the hand's spring; K: the contact's own stiffness, which is not k n n'
alone: a curved surface turns its normal as the device moves along it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import expm

Matrix = np.ndarray[tuple[int, int], np.dtype[np.float64]]
Vector = np.ndarray[tuple[int], np.dtype[np.float64]]

_HIGHEST_N_PER_M = 1e9
_HALVINGS = 40


@dataclass(frozen=True)
class SpaceLoop:
    """A device, its hand and the loop's timing.

    Attributes:
        mass_kg: (3, 3), symmetric.
        damping_n_s_per_m: (3, 3), symmetric.
        hand_n_per_m: (3, 3), the hand's spring.
        period_s: of the loop [s].
        delay: samples until a force acts.
    """

    mass_kg: Matrix
    damping_n_s_per_m: Matrix
    hand_n_per_m: Matrix
    period_s: float
    delay: int = 0

    @cached_property
    def held(self) -> tuple[Matrix, Matrix]:
        """The step of positions and velocities (6, 6), and what a held force adds to them (6, 3): exact."""
        inverse = np.linalg.inv(self.mass_kg)
        rate = np.zeros((9, 9))
        rate[:3, 3:6] = np.eye(3)
        rate[3:6, :3] = -inverse @ self.hand_n_per_m
        rate[3:6, 3:6] = -inverse @ self.damping_n_s_per_m
        rate[3:6, 6:] = inverse
        step = expm(rate * self.period_s)
        return step[:6, :6], step[:6, 6:]

    def radius(self, contact_n_per_m: Matrix) -> float:
        """The largest eigenvalue of the loop; delayed forces are states of their own."""
        free, forced = self.held
        size = 6 + 3 * self.delay
        whole = np.zeros((size, size))
        whole[:6, :6] = free
        if self.delay == 0:
            whole[:, :3] -= forced @ contact_n_per_m
        else:
            whole[:6, 6:9] = forced  # the oldest one acts
            for at in range(6, size - 3, 3):
                whole[at : at + 3, at + 3 : at + 6] = np.eye(3)
            whole[size - 3 :, :3] = -contact_n_per_m
        return float(np.abs(np.linalg.eigvals(whole)).max())

    def limit_n_per_m(self, shape: Matrix) -> float:
        """The stiffness at which the loop loses stability, for a contact of `k` times a shape; 0 where it has none.

        Args:
            shape: the contact's stiffness at 1 N/m.
        """
        if self.radius(1e-3 * shape) >= 1.0 + 1e-12:
            return 0.0
        low, high = 1e-3, 1.0
        while self.radius(high * shape) < 1.0:
            low, high = high, 2.0 * high
            if high > _HIGHEST_N_PER_M:
                return float("inf")
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            if self.radius(middle * shape) < 1.0:
                low = middle
            else:
                high = middle
        return low

    def estimate_n_per_m(self, normal: Vector) -> float:
        """2 b_n / T: what a device holds of one spring along a direction, without hand and delay.

        1/m_n = n' M^-1 n    b_n = m_n^2 n' M^-1 B M^-1 n
        """
        weighed = np.linalg.solve(self.mass_kg, normal)
        mass = 1.0 / float(normal @ weighed)
        damping = mass * mass * float(weighed @ self.damping_n_s_per_m @ weighed)
        return 2.0 * damping / self.period_s

    def passive_n_per_m(self, normal: Vector) -> float:
        """2 / (T n' B^-1 n): what makes no energy along a direction, whatever the hand does."""
        return 2.0 / (self.period_s * float(normal @ np.linalg.solve(self.damping_n_s_per_m, normal)))


def surface_stiffness(normal: Vector, along: Any, bends_per_m: Any, depth_m: float) -> Matrix:
    """A frictionless surface's stiffness at 1 N/m: n n', and what turning of the normal adds.

    Args:
        normal: outward.
        along: the two directions of principal curvature.
        bends_per_m: the curvatures along them, positive where the solid bulges.
        depth_m: how deep it is pressed.
    """
    total = np.outer(normal, normal)
    for direction, bend in zip(along, bends_per_m, strict=True):
        total -= depth_m * bend / (1.0 - depth_m * bend) * np.outer(direction, direction)
    return total
