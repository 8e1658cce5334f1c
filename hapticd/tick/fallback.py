"""The law that stands in for one that failed: the wall as it is, plus damping that is safe on this device.

It only bridges the ramp to zero force that follows a failure at once.
"""

from __future__ import annotations

from typing import Any

from pydantic import Field

from hapticd.law import LawParams

RESTS_OUTSIDE = True


class Params(LawParams):
    """Parameters of the fallback."""

    damping_n_s_per_m: float = Field(ge=0, description="damping that the device declares safe [N s/m]")


class State:
    """Nothing to remember but what is published."""

    damping_n_s_per_m: float


def start(state: Any, params: Any, snapshot: Any) -> None:
    """Damping is in force from the first tick."""
    state.damping_n_s_per_m = params.damping_n_s_per_m


def step(state: Any, params: Any, tick: Any) -> float:
    """F = F_contact - b v  [N]."""
    force_n: float = tick.contact_n - params.damping_n_s_per_m * tick.velocity_m_per_s
    return force_n
