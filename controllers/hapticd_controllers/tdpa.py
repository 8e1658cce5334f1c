"""Time-domain passivity control.

Hannaford & Ryu, "Time-domain passivity control of haptic interfaces", IEEE T-RA 18(1), 2002, eqs. 6-8,
with the bounds that keep it usable near zero speed (docs/controllers.md, "A fair TDPA"). The reference energy is that
of Ryu, Preusche, Hannaford & Hirzinger, "Time domain passivity control with reference energy following", IEEE T-CST
13(5), 2005.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from hapticd.law import LawParams

RESTS_OUTSIDE = True

OBSERVER_EXACT, OBSERVER_PRINTED = range(2)
REFERENCE_ZERO, REFERENCE_STORED = range(2)
RESET_CONTACT, RESET_NEVER = range(2)

LIMIT = 1e12
"""No energy [J], damping [N s/m] or damping force [N] grows beyond this, so that nothing ever overflows."""


class Params(LawParams):
    """Bounds of the passivity controller; with all of them off it is the published one."""

    damping_cap_n_s_per_m: float = Field(
        50.0, ge=0.0, le=1e9, description="largest damping that may be injected [N s/m]; 0: unbounded, as published"
    )
    min_speed_m_per_s: float = Field(
        1e-3,
        ge=0.0,
        le=10.0,
        description="below this speed the debt waits, since v^2 divides it [m/s]; 0: as published",
    )
    carry_debt: bool = Field(
        True, description="a debt that the bounds left unpaid is paid later; false: it is forgiven at the next tick"
    )
    reset: Literal["contact", "never"] = Field(
        "contact", description="contact: a credit ends with the contact; never: it is kept for ever, as published"
    )
    observer: Literal["exact", "printed"] = Field(
        "exact",
        description="exact: -F(n-1)(x(n)-x(n-1)) with the applied force; printed: -F(n) v(n) dt, blind to the leak",
    )
    reference: Literal["zero", "stored"] = Field(
        "zero",
        description="energy that must have come in: none, or what the spring has stored, k x^2 / 2, so that a press "
        "leaves no credit",
    )


class State:
    """What the passivity observer remembers."""

    energy_j: float  # observed at the port, after dissipation; < 0 is energy we generated
    damping_n_s_per_m: float  # injected at the last tick
    speed_m_per_s: float  # at the last tick, for the printed observer
    reference_j: float  # at the last tick; what is missing from it is the debt
    start_m: float  # where it took over, until the first sample tells how stiff the spring is that is pressed there


def start(state: Any, params: Any, snapshot: Any) -> None:
    """Take over: a debt is carried over, of a credit only what a pressed spring holds."""
    state.energy_j = min(0.0, -_bounded(snapshot.debt_j))
    state.damping_n_s_per_m = 0.0
    state.speed_m_per_s = 0.0
    state.reference_j = 0.0
    state.start_m = snapshot.x_m


def step(state: Any, params: Any, tick: Any) -> float:
    """The contact's own force plus just enough damping to pay the energy debt.  -> force on the device [N]."""
    velocity = tick.velocity_m_per_s
    if not params.carry_debt and state.energy_j < state.reference_j:
        state.energy_j = state.reference_j
    if state.start_m != 0.0:
        _begin_inside(state, tick)
    if params.observer == OBSERVER_EXACT:
        flow_j = -tick.applied_n * tick.moved_m  # E(n) = E(n-1) - F(n-1) (x(n) - x(n-1))
    else:  # W(n) = W(n-1) + f(n) v(n) + alpha(n-1) v(n-1)^2
        paid_w = state.damping_n_s_per_m * state.speed_m_per_s * state.speed_m_per_s
        flow_j = (paid_w - tick.contact_n * velocity) * tick.dt_s
    state.energy_j += flow_j
    state.speed_m_per_s = abs(velocity)
    state.damping_n_s_per_m = 0.0
    state.reference_j = 0.0
    if not tick.in_contact:
        if params.reset == RESET_CONTACT and state.energy_j > 0.0:
            state.energy_j = 0.0
        return 0.0
    if params.reference == REFERENCE_STORED:
        state.reference_j = -0.5 * tick.spring_n * tick.x_m
    force_n: float = tick.contact_n
    debt_j = state.reference_j - state.energy_j
    payable_per_damping = velocity * velocity * tick.dt_s
    if debt_j > 0.0 and state.speed_m_per_s >= params.min_speed_m_per_s and payable_per_damping > 0.0:
        damping = _bounded(debt_j / payable_per_damping)  # alpha(n)
        if params.damping_cap_n_s_per_m > 0.0 and damping > params.damping_cap_n_s_per_m:
            damping = params.damping_cap_n_s_per_m
        state.damping_n_s_per_m = damping
        force_n -= damping * velocity
    return force_n


def _begin_inside(state: Any, tick: Any) -> None:
    """At the first sample: E(0) is what the spring held at the start, else its return would be a debt."""
    start_m = state.start_m
    state.start_m = 0.0
    if tick.in_contact and start_m * tick.x_m > 0.0:
        state.energy_j += _bounded(0.5 * abs(tick.spring_n * start_m) * abs(start_m / tick.x_m))


def _bounded(value: float) -> float:
    if -LIMIT < value < LIMIT:
        return value
    return LIMIT if value > 0.0 else -LIMIT
