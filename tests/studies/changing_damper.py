"""A damper that becomes another one a while after its port has come into force, for tests."""

from __future__ import annotations

from typing import Any

from hapticd.law import Field, LawParams

RESTS_OUTSIDE = True


class Params(LawParams):
    """What it is, and when it changes."""

    first_n_s_per_m: float = Field(50.0, ge=0.0, description="damping to begin with [N s/m]")
    later_n_s_per_m: float = Field(50.0, ge=0.0, description="damping from then on [N s/m]")
    at_s: float = Field(0.1, ge=0.0, description="when it changes, in force [s]")


class State:
    """How long it has been in force."""

    in_force_s: float


def start(state: Any, params: Any, snapshot: Any) -> None:
    """Begin with the first."""
    state.in_force_s = 0.0


def step(state: Any, params: Any, tick: Any) -> float:
    """The port's own force, less what is damped now.  -> force on the device [N]."""
    if not tick.in_contact:
        return 0.0
    state.in_force_s += tick.dt_s
    damping = params.first_n_s_per_m if state.in_force_s < params.at_s else params.later_n_s_per_m
    force_n: float = tick.contact_n - damping * tick.velocity_m_per_s
    return force_n
