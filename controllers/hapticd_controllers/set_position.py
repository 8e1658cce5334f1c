"""Passive set-position modulation.

Lee & Huang, "Passive-set-position-modulation framework for interactive robotic systems", IEEE T-RO 26(2), 2010: a
spring and a damper hold the device to a set position, which jumps from sample to sample to the surface of the wall, as
far as what has been dissipated pays for what the jump puts into the spring.
"""

from __future__ import annotations

import math
from typing import Any

from pydantic import Field

from hapticd.law import LawParams

RESTS_OUTSIDE = True

SOFTEST, STIFFEST = 1e-12, 1e12
"""Stiffness of a wall [N/m] within which nothing is divided by zero or overflows."""
LIMIT = 1e12
"""No energy [J] grows beyond this."""


class Params(LawParams):
    """The damper whose dissipation pays."""

    damping_n_s_per_m: float = Field(
        50.0, ge=0.0, le=1e9, description="damping inside the wall, which pays for the jumps, B [N s/m]"
    )


class State:
    """Where the device is held to, and what is left to spend."""

    damping_n_s_per_m: float
    set_position_m: float
    energy_j: float
    was_in_contact: bool


def start(state: Any, params: Any, snapshot: Any) -> None:
    """Take over with a slack spring; a debt has to be dissipated first."""
    state.damping_n_s_per_m = params.damping_n_s_per_m
    state.set_position_m = 0.0
    state.energy_j = -max(0.0, min(snapshot.debt_j, LIMIT))
    state.was_in_contact = False


def step(state: Any, params: Any, tick: Any) -> float:
    """A spring to the set position, and the damper.  -> force on the device [N]."""
    braking = params.damping_n_s_per_m
    if not tick.in_contact:
        state.was_in_contact = False
        return 0.0
    if not state.was_in_contact:
        state.set_position_m = tick.x_m  # slack: a new contact has nothing stored
    state.was_in_contact = True
    wall_n_per_m = max(SOFTEST, min(-tick.spring_n / tick.x_m, STIFFEST))
    # E(n) = E(n-1) + B dx^2 / dt + k (x - x_s(n-1))^2 / 2 - k (x - x_s(n))^2 / 2 >= 0, x_s(n) as near to 0 as may be
    stretch_m = tick.x_m - state.set_position_m
    budget_j = state.energy_j + braking * tick.moved_m * tick.moved_m / tick.dt_s
    budget_j += 0.5 * wall_n_per_m * stretch_m * stretch_m
    asked_j = 0.5 * wall_n_per_m * tick.x_m * tick.x_m
    if budget_j >= asked_j:
        state.set_position_m = 0.0
        state.energy_j = min(budget_j - asked_j, LIMIT)
    else:
        state.energy_j = min(0.0, budget_j)
        reach_m = math.sqrt(2.0 * max(0.0, budget_j) / wall_n_per_m)
        # a spring along a surface may be stretched either way
        state.set_position_m = tick.x_m + reach_m if tick.x_m < 0.0 else tick.x_m - reach_m
    force_n: float = tick.contact_n - tick.spring_n  # the wall's own damping is passed on as it is
    force_n += wall_n_per_m * (state.set_position_m - tick.x_m) - braking * tick.velocity_m_per_s
    return force_n
