"""The input-to-state stable approach: a wall that gives way to its own force.

Jafari, Nabeel & Ryu, "The input to state stable (ISS) approach for stabilizing haptic interaction with virtual
environments", IEEE T-RO 33(4), 2017. The wall is driven not by v but by v - u, u = (dF_e/dt) / mu, F_e being its force
against the motion; the device is given F_e + tau dF_e/dt. The wall may so generate a bounded energy. Its own damping
is passed on as it is.
"""

from __future__ import annotations

from typing import Any

from pydantic import Field

from hapticd.law import LawParams

RESTS_OUTSIDE = True

SOFTEST, STIFFEST = 1e-12, 1e12
"""Stiffness of a wall [N/m] within which nothing is divided by zero or overflows."""


class Params(LawParams):
    """How far the wall gives way, and how far ahead its force is taken."""

    slope_ratio: float = Field(
        1.1, gt=1.0, le=1e3, description="mu / k; the device is shown k mu / (k + mu): at 1.1 little more than half"
    )
    lead_s: float = Field(0.003, ge=0.0, le=1.0, description="how far ahead the force is taken, tau [s]")


class State:
    """The wall's force before it is taken ahead, and whether it is still to be found in a contact that goes on."""

    environment_n: float
    takes_over: bool


def start(state: Any, params: Any, snapshot: Any) -> None:
    """A contact that goes on is taken over as it would be at rest: without a rate of its force."""
    state.environment_n = 0.0
    state.takes_over = True


def step(state: Any, params: Any, tick: Any) -> float:
    """The force of the wall that gave way, taken ahead.  -> force on the device [N]."""
    if not tick.in_contact:
        state.environment_n = 0.0
        state.takes_over = False
        return 0.0
    wall_n_per_m = max(SOFTEST, min(-tick.spring_n / tick.x_m, STIFFEST))
    inside = tick.x_m < 0.0  # a spring along a surface may be stretched either way
    if state.takes_over:
        state.takes_over = False
        if (tick.x_m - tick.moved_m < 0.0) == inside:  # at rest F_e = -k (x + F_e / mu)
            state.environment_n = -wall_n_per_m * tick.x_m * params.slope_ratio / (1.0 + params.slope_ratio)
    # the sum of (v - u) dt since the contact began; u has the force of the last sample, for F_e(n) needs u(n)
    contact_m = tick.x_m + state.environment_n / (params.slope_ratio * wall_n_per_m)
    environment_n = 0.0
    if (contact_m < 0.0) == inside:
        environment_n = -wall_n_per_m * contact_m
    rate_n_per_s = (environment_n - state.environment_n) / tick.dt_s
    state.environment_n = environment_n
    force_n: float = tick.contact_n - tick.spring_n + environment_n + params.lead_s * rate_n_per_s
    return force_n
