"""What a tick of a device with several axes adds to a row: every vector, and what is touched."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple


class SpaceRow(NamedTuple):
    """One tick of a device with two or three axes; the first eleven columns are those of one axis.

    Without a wall x_m and x_measured_m are less the depth in the object that is touched deepest, v_m_per_s is along its
    normal, and the forces are magnitudes.

    Attributes:
        t_s: time since the first tick [s].
        x_m, v_m_per_s, x_measured_m, force_n, force_requested_n, energy_j, cycle, damping_n_s_per_m, in_contact,
            armed: as `hapticd.offline.run.Row` has them.
        position_x_m, position_y_m, position_z_m: true position in the scene [m].
        velocity_x_m_per_s, velocity_y_m_per_s, velocity_z_m_per_s: true velocity [m/s].
        measured_x_m, measured_y_m, measured_z_m: position as the device reports it [m].
        force_x_n, force_y_n, force_z_n: force applied from this tick to the next [N].
        touched: the first object of the solid that is touched deepest; -1: none.
        depth_m: how deep [m].
    """

    t_s: float
    x_m: float
    v_m_per_s: float
    x_measured_m: float
    force_n: float
    force_requested_n: float
    energy_j: float
    cycle: int
    damping_n_s_per_m: float
    in_contact: int
    armed: int
    position_x_m: float
    position_y_m: float
    position_z_m: float
    velocity_x_m_per_s: float
    velocity_y_m_per_s: float
    velocity_z_m_per_s: float
    measured_x_m: float
    measured_y_m: float
    measured_z_m: float
    force_x_n: float
    force_y_n: float
    force_z_n: float
    touched: int
    depth_m: float


POSITION = ("position_x_m", "position_y_m", "position_z_m")
MEASURED = ("measured_x_m", "measured_y_m", "measured_z_m")


def three(values: Sequence[float]) -> tuple[float, float, float]:
    """A vector with as many elements as a row has columns for it; an axis that is not there stays at 0."""
    x, y, z = (*values, 0.0)[:3]
    return x, y, z


def length(values: Sequence[float]) -> float:
    """Of a vector."""
    return math.sqrt(sum([value * value for value in values]))
