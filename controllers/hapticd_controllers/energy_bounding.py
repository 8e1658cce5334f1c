"""The energy-bounding algorithm: no more force than the device's own damping can pay for.

Kim & Ryu, "Robustly stable haptic interaction control using an energy-bounding algorithm", IJRR 29(6), 2010. The
device dissipates at least (p / dt) dx^2 in a sample, what is left of that after the wall's work is E, and the force is
bounded so that no next move can make E negative: min over dx of E + (p / dt) dx^2 - F dx = E - F^2 dt / (4 p).
"""

from __future__ import annotations

import math
from typing import Any

from pydantic import Field

from hapticd.law import LawParams

RESTS_OUTSIDE = True

LIMIT = 1e12
"""No debt [J] is larger, so that nothing ever overflows."""


class Params(LawParams):
    """How much the device itself is trusted to dissipate, p = share b."""

    device_damping_n_s_per_m: float = Field(
        4.4, gt=0.0, le=1e6, description="damping that the device has without any law, b [N s/m]"
    )
    share: float = Field(
        0.75, gt=0.0, le=2.0, description="share of it that may be spent; no wall is shown stiffer than 2 share b / dt"
    )


class State:
    """What the device has dissipated and the wall has not spent."""

    energy_j: float
    was_in_contact: bool


def start(state: Any, params: Any, snapshot: Any) -> None:
    """Take over: a debt has to be dissipated first."""
    state.energy_j = -max(0.0, min(snapshot.debt_j, LIMIT))
    state.was_in_contact = False


def step(state: Any, params: Any, tick: Any) -> float:
    """The contact's own force within what E can pay for.  -> force on the device [N]."""
    p_n_per_m = params.share * params.device_damping_n_s_per_m / tick.dt_s
    if not (tick.in_contact and state.was_in_contact):  # a new contact begins with nothing, a debt excepted
        state.energy_j = min(0.0, state.energy_j)
    else:
        state.energy_j += p_n_per_m * tick.moved_m * tick.moved_m - tick.applied_n * tick.moved_m
    state.was_in_contact = tick.in_contact
    most_n = 2.0 * math.sqrt(p_n_per_m * max(0.0, state.energy_j))
    force_n: float = max(-most_n, min(tick.contact_n, most_n))
    return force_n
