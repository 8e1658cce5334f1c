"""A constant damper in the wall.

F = F_wall - B v, as in Colgate & Brown, "Factors affecting the Z-width of a haptic display", ICRA 1994. Nothing
adapts: what every adaptive law has to beat.
"""

from __future__ import annotations

from typing import Any

from pydantic import Field

from hapticd.law import LawParams

RESTS_OUTSIDE = True


class Params(LawParams):
    """How hard it brakes."""

    damping_n_s_per_m: float = Field(50.0, ge=0.0, le=1e9, description="damping inside the wall, B [N s/m]")


class State:
    """Nothing is remembered; the damping is published."""

    damping_n_s_per_m: float


def start(state: Any, params: Any, snapshot: Any) -> None:
    """Nothing to take over."""
    state.damping_n_s_per_m = params.damping_n_s_per_m


def step(state: Any, params: Any, tick: Any) -> float:
    """The contact's own force less B v.  -> force on the device [N]."""
    force_n: float = tick.contact_n - params.damping_n_s_per_m * tick.velocity_m_per_s
    return force_n
