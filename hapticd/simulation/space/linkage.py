"""A parallel device: three arms on one platform, and what they weigh at the platform, place by place.

No maker publishes the dynamics of such a device. What is assumed, and stated in docs/space.md: a delta linkage with
arms of 120 mm and rods of 220 mm, its base 30 mm wider than its platform; half of the mass moves with the platform,
half turns with the arms; at the middle of its workspace the device weighs what the options call its mass, on the mean
over all directions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from hapticd.simulation.space.matrix import Matrix

ARM_M = 0.12
ROD_M = 0.22
OFFSET_M = 0.03
"""Lengths of the linkage: upper arm, rod, and how much wider base is than platform [m]."""

ARMS_SHARE = 0.5
"""How much of the mass, at the middle of the workspace, is that of the arms."""

MIDDLE_M = 0.2
"""How far in front of its base the middle of the workspace is [m]."""

REACH_M = (0.08, 0.08, 0.06)
"""Farther from the middle, along x, y and z, the matrix is that of the border [m]."""

STEP_M = 0.02
"""Distance of the places at which the matrix is known; in between it is that of the nearest [m]."""

PLACES = tuple(2 * round(reach_m / STEP_M) + 1 for reach_m in REACH_M)
"""How many there are along x, y and z."""


def jacobian(x_m: float, y_m: float, z_m: float) -> Matrix:
    """Turn of each arm for a move of the platform, a row an arm [rad/m]; z points out of the base.

    Raises:
        ValueError: no arm reaches there.
    """
    rows = []
    out_m = MIDDLE_M + z_m
    for arm in range(3):
        angle = 2.0 * math.pi * arm / 3.0
        cos, sin = math.cos(angle), math.sin(angle)
        # In the arm's plane: across (r, from the arm's joint outward), beside it (t), and out (z).
        r_m = cos * x_m + sin * y_m - OFFSET_M
        t_m = cos * y_m - sin * x_m
        reach = r_m * r_m + t_m * t_m + out_m * out_m + ARM_M * ARM_M - ROD_M * ROD_M
        # |platform - elbow| = rod:  r cos(q) + z sin(q) = reach / (2 arm)
        amplitude = math.hypot(r_m, out_m)
        share = reach / (2.0 * ARM_M * amplitude)
        if not -1.0 < share < 1.0:
            raise ValueError("out of the linkage's reach")
        turn = math.atan2(out_m, r_m) - math.acos(share)
        rod = (r_m - ARM_M * math.cos(turn), t_m, out_m - ARM_M * math.sin(turn))
        lever = ARM_M * (-math.sin(turn) * rod[0] + math.cos(turn) * rod[2])
        rows.append([(cos * rod[0] - sin * rod[1]) / lever, (sin * rod[0] + cos * rod[1]) / lever, rod[2] / lever])
    return rows


def mass_matrix(mass_kg: float, hand_kg: Sequence[float], x_m: float, y_m: float, z_m: float) -> Matrix:
    """What the device weighs at a place, in every direction at once [kg].

    Args:
        mass_kg: of the device at the middle of its workspace, mean over all directions.
        hand_kg: of the hand, along each axis.
        x_m: from the middle [m].
        y_m: see x_m.
        z_m: see x_m.
    """
    middle = _turned(jacobian(0.0, 0.0, 0.0))
    inertia = ARMS_SHARE * mass_kg * 3.0 / sum([middle[i][i] for i in range(3)])  # of each arm [kg m^2]
    here = _turned(jacobian(x_m, y_m, z_m))
    still = (1.0 - ARMS_SHARE) * mass_kg
    return [[inertia * here[i][j] + (still + hand_kg[i] if i == j else 0.0) for j in range(3)] for i in range(3)]


def places() -> list[tuple[float, float, float]]:
    """All of them, x slowest, z fastest [m]."""
    along = [[(at - count // 2) * STEP_M for at in range(count)] for count in PLACES]
    return [(x_m, y_m, z_m) for x_m in along[0] for y_m in along[1] for z_m in along[2]]


def _turned(rows: Matrix) -> Matrix:
    """J' J: a unit of inertia on each arm, as felt at the platform."""
    return [[sum([row[i] * row[j] for row in rows]) for j in range(3)] for i in range(3)]
