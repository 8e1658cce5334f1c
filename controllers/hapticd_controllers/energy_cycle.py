"""Energy cycles with adaptive damping.

"Relaxing Conservatism for Enhanced Impedance Range and Transparency in Haptic Interaction", eqs. 7-10: the wall may
generate energy during one press and release; what it generated is measured at the end of that cycle and becomes
damping for the next one. Every reading that the print leaves open is a parameter (docs/controllers.md).
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from hapticd.contracts.law import LawParams
from hapticd.energy import CycleFields, cycle_ended

WORK_SPRING, WORK_TOTAL = range(2)
PAIRING_EXACT, PAIRING_NEW_FORCE, PAIRING_POWER, PAIRING_HELD_POWER = range(4)
SUM_CYCLE, SUM_START = range(2)
RULE_SIGNED, RULE_NON_NEGATIVE, RULE_NON_DECREASING = range(3)
PLATEAUS_SKIPPED, PLATEAUS_LITERAL = range(2)
CONTACT_LOSS_ENDS_CYCLE, CONTACT_LOSS_IGNORED = range(2)
NEW_CONTACT_KEEP, NEW_CONTACT_ENERGY, NEW_CONTACT_DAMPING = range(3)
STORED_KEPT, STORED_SUBTRACTED = range(2)
CAP_FELT_MASS, CAP_KNOWN_MASS, CAP_FIXED, CAP_NONE = range(4)

LIMIT = 1e12
"""No energy [J], damping [N s/m], speed [m/s] or damping force [N] grows beyond this: nothing ever overflows."""
TINY_SUM = 1e-24
"""Less motion than this in a cycle, sum of v^2 dt [m^2/s], is rest: there is nothing to divide by."""
FELT_SAMPLES = 20.0
"""Effective samples before an identified mass is believed."""
FELT_COUNTS = 2.0
"""Moves of so few counts of the position say more about the quantiser than about the mass."""


class Params(LawParams):
    """How to read eqs. 7-10, and what bounds the damping."""

    window: int = Field(
        2, ge=1, le=100, description="samples of falling, then of rising energy around a cycle's end; 1: a plain minimum"
    )
    window_future: int = Field(0, ge=0, le=100, description="rising samples, where other than `window`; 0: the same")
    work: Literal["spring", "total"] = Field(
        "spring", description="force in the energy: without the adaptive damping term, or the complete one"
    )
    pairing: Literal["exact", "new-force", "power", "held-power"] = Field(
        "exact",
        description="energy of a sample: F(n-1)(x(n)-x(n-1)), F(n)(x(n)-x(n-1)), F(n)v(n)dt, or F(n-1)v(n)dt",
    )
    sum: Literal["cycle", "start"] = Field(
        "cycle", description="v^2 dt in eq. 8 summed over the cycle, or from the start of contact history"
    )
    rule: Literal["signed", "non-negative", "non-decreasing"] = Field(
        "non-decreasing", description="what the damping of eq. 8 may do from cycle to cycle"
    )
    plateaus: Literal["skipped", "literal"] = Field(
        "skipped", description="equal energies in eq. 10 are passed over, or break the window as printed"
    )
    contact_loss: Literal["ends-cycle", "ignored"] = Field(
        "ends-cycle", description="leaving the wall completes a release, or waits until the energy rises again"
    )
    new_contact: Literal["keep", "energy", "damping"] = Field(
        "keep", description="forgotten when the wall is touched again: nothing, the energy and its sums, the damping too"
    )
    stored_energy: Literal["kept", "subtracted"] = Field(
        "kept", description="what the spring holds at a cycle's end stays in eq. 7, or is taken out"
    )
    min_travel_counts: float = Field(
        0.0, ge=0.0, le=1e6, description="a cycle that travels less, in counts of the position, changes nothing"
    )
    cap: Literal["felt-mass", "known-mass", "fixed", "none"] = Field(
        "felt-mass", description="what bounds the damping: cap_share m/dt with m identified or given, a number, nothing"
    )
    cap_share: float = Field(0.41, gt=0.0, le=2.0, description="damping at most this share of mass / dt")
    cap_damping_n_s_per_m: float = Field(
        20.0, gt=0.0, le=1e9, description="the fixed cap; for felt-mass the cap until the mass is known [N s/m]"
    )
    mass_kg: float = Field(0.25, gt=0.0, le=1e3, description="mass for the cap known-mass [kg]")
    felt_mass_memory: float = Field(
        0.998, gt=0.0, le=1.0, description="share of the felt mass's evidence that a new sample leaves standing"
    )
    wall_may_pull: bool = Field(True, description="whether damping may pull the device into the wall as it leaves")


class State(CycleFields):
    """What one contact remembers: cycle detector, energy, damping, and the motion that the felt mass comes from."""

    damping_n_s_per_m: float  # alpha, in force until the next cycle ends
    felt_mass_kg: float  # identified mass; 0 while unknown
    energy_j: float  # into the wall since the end of the last cycle
    motion_m2_per_s: float  # sum of v^2 dt in contact
    candidate_motion_m2_per_s: float  # the same at the detector's candidate
    candidate_stored_j: float  # what the spring held at the candidate
    stored_j: float  # what the spring held at the end of the last cycle
    lowest_m: float  # deepest position of this cycle
    highest_m: float  # highest position of this cycle, in contact
    was_in_contact: bool
    # the felt mass: sums of u, w, u^2, u w with forgetting
    last_moved_m: float
    last_dt_s: float
    last_applied_n: float
    count: float
    sum_u: float
    sum_w: float
    sum_uu: float
    sum_uw: float


def start(state: Any, params: Any, snapshot: Any) -> None:
    """Take over: the damping that was reached, and the energy that nobody has dissipated, count for the next cycle."""
    state.energy_j = _bounded(-snapshot.debt_j)
    if state.energy_j > 0.0:
        state.energy_j = 0.0
    state.window_energy_j = state.energy_j
    state.window_minimum_j = 0.0
    state.window_falls = 0
    state.window_rises = 0
    state.felt_mass_kg = 0.0
    state.damping_n_s_per_m = _bounded(snapshot.damping_n_s_per_m)
    if state.damping_n_s_per_m < 0.0:
        state.damping_n_s_per_m = 0.0
    state.motion_m2_per_s = 0.0
    state.candidate_motion_m2_per_s = 0.0
    state.candidate_stored_j = 0.0
    state.stored_j = 0.0
    state.lowest_m = snapshot.x_m
    state.highest_m = snapshot.x_m
    state.was_in_contact = False
    state.last_moved_m = 0.0
    state.last_dt_s = 0.0
    state.last_applied_n = 0.0
    state.count = 0.0
    state.sum_u = 0.0
    state.sum_w = 0.0
    state.sum_uu = 0.0
    state.sum_uw = 0.0


def step(state: Any, params: Any, tick: Any) -> float:
    """The contact's own force plus the damping that the last cycles called for.  -> force on the device [N]."""
    velocity = _bounded(tick.velocity_m_per_s)
    if params.cap == CAP_FELT_MASS:
        feel_mass(state, params, tick)
    if tick.in_contact and not state.was_in_contact and params.new_contact != NEW_CONTACT_KEEP:
        forget(state, params)
    state.was_in_contact = tick.in_contact

    # E(n), eq. 8's sum and the travel of this cycle
    if params.pairing == PAIRING_EXACT or params.pairing == PAIRING_HELD_POWER:
        force_n = tick.applied_contact_n if params.work == WORK_SPRING else tick.applied_n
    elif params.work == WORK_SPRING or not tick.in_contact:
        force_n = tick.contact_n
    else:
        force_n = tick.contact_n - state.damping_n_s_per_m * velocity
    if params.pairing == PAIRING_EXACT or params.pairing == PAIRING_NEW_FORCE:
        moved_m = _bounded(tick.moved_m)
    else:
        moved_m = _bounded(velocity * tick.dt_s)
    state.energy_j = _bounded(state.energy_j - _bounded(_bounded(force_n) * moved_m))
    if tick.in_contact:
        state.motion_m2_per_s = _bounded(state.motion_m2_per_s + _bounded(velocity * velocity * tick.dt_s))
        if tick.x_m < state.lowest_m:
            state.lowest_m = tick.x_m
        if tick.x_m > state.highest_m:
            state.highest_m = tick.x_m

    # eq. 10
    if params.plateaus == PLATEAUS_LITERAL and state.energy_j == state.window_energy_j:
        state.window_falls = 0
        state.window_rises = 0
    inside = tick.in_contact or params.contact_loss == CONTACT_LOSS_IGNORED
    future = params.window_future if params.window_future > 0 else params.window
    ended = cycle_ended(state, state.energy_j, inside, params.window, future)
    if state.window_rises == 0:
        state.candidate_motion_m2_per_s = state.motion_m2_per_s
        state.candidate_stored_j = _bounded(0.5 * abs(_bounded(tick.x_m) * _bounded(tick.contact_n)))
    if ended:
        end_cycle(state, params, tick)

    cap = damping_cap(state, params, tick)
    if state.damping_n_s_per_m > cap:
        state.damping_n_s_per_m = cap
    elif state.damping_n_s_per_m < -cap:
        state.damping_n_s_per_m = -cap
    if not tick.in_contact:
        return 0.0
    force_n = tick.contact_n - _bounded(state.damping_n_s_per_m * velocity)  # eq. 9
    if force_n < 0.0 and not params.wall_may_pull:
        force_n = 0.0
    return force_n


def end_cycle(state: Any, params: Any, tick: Any) -> None:
    """Eqs. 7 and 8; then energies count from here, so that they stay small however long the contact lasts."""
    generated_j = state.window_minimum_j  # E_n - E_(n-1), since E_(n-1) is 0 here
    if params.stored_energy == STORED_SUBTRACTED:
        generated_j -= state.candidate_stored_j - state.stored_j
    motion = state.candidate_motion_m2_per_s
    travel_m = state.highest_m - state.lowest_m
    if motion > TINY_SUM and travel_m >= params.min_travel_counts * tick.resolution_m:
        change = _bounded(-generated_j / motion)
        if params.rule == RULE_NON_DECREASING and change < 0.0:
            change = 0.0
        state.damping_n_s_per_m += change
        if params.rule == RULE_NON_NEGATIVE and state.damping_n_s_per_m < 0.0:
            state.damping_n_s_per_m = 0.0
    state.energy_j -= state.window_minimum_j
    state.window_energy_j -= state.window_minimum_j
    state.window_minimum_j = 0.0
    state.stored_j = state.candidate_stored_j
    if params.sum == SUM_CYCLE:
        state.motion_m2_per_s -= motion
        state.candidate_motion_m2_per_s = 0.0
    state.lowest_m = tick.x_m
    state.highest_m = tick.x_m


def damping_cap(state: Any, params: Any, tick: Any) -> float:
    """Largest |alpha| now: a sampled damper on a mass m is itself unstable from 2 m/dt, with one sample late 0.83 m/dt."""
    cap: float = params.cap_damping_n_s_per_m
    if params.cap == CAP_NONE:
        cap = LIMIT
    elif params.cap != CAP_FIXED and tick.dt_s > 0.0:
        mass_kg = params.mass_kg if params.cap == CAP_KNOWN_MASS else state.felt_mass_kg
        if mass_kg > 0.0:
            cap = _bounded(params.cap_share * mass_kg / tick.dt_s)
    return cap


def feel_mass(state: Any, params: Any, tick: Any) -> None:
    """Identify the mass that the wall pushes, from how the mean speed of two successive samples changes.

    Held forces make it exact, even where samples are not equally far apart:
        w = moved(n)/dt(n) - moved(n-1)/dt(n-1)  =  u / m,   u = (F(n-1) dt(n) + F(n-2) dt(n-1)) / 2
    The hand's slow force is the intercept of the line, its slope 1/m.
    """
    moved_m = _bounded(tick.moved_m)
    applied_n = _bounded(tick.applied_n)
    enough_m = FELT_COUNTS * tick.resolution_m
    if (
        tick.dt_s > 0.0
        and state.last_dt_s > 0.0
        and applied_n != 0.0
        and state.last_applied_n != 0.0
        and abs(moved_m) > enough_m
    ):
        u = _bounded(0.5 * (applied_n * tick.dt_s + state.last_applied_n * state.last_dt_s))
        w = _bounded(_bounded(moved_m / tick.dt_s) - _bounded(state.last_moved_m / state.last_dt_s))
        keep = params.felt_mass_memory
        state.count = keep * state.count + 1.0
        state.sum_u = keep * state.sum_u + u
        state.sum_w = keep * state.sum_w + w
        state.sum_uu = keep * state.sum_uu + u * u
        state.sum_uw = keep * state.sum_uw + u * w
        variance = state.sum_uu - state.sum_u * state.sum_u / state.count
        covariance = state.sum_uw - state.sum_u * state.sum_w / state.count
        if state.count >= FELT_SAMPLES and variance > 0.0 and covariance > 0.0:
            state.felt_mass_kg = _bounded(variance / covariance)
    state.last_moved_m = moved_m
    state.last_dt_s = tick.dt_s
    state.last_applied_n = applied_n


def forget(state: Any, params: Any) -> None:
    """A new contact begins from nothing."""
    state.energy_j = 0.0
    state.window_energy_j = 0.0
    state.window_falls = 0
    state.window_rises = 0
    state.motion_m2_per_s = 0.0
    state.candidate_motion_m2_per_s = 0.0
    state.stored_j = 0.0
    if params.new_contact == NEW_CONTACT_DAMPING:
        state.damping_n_s_per_m = 0.0


def _bounded(value: float) -> float:
    if value > LIMIT:
        return LIMIT
    if value < -LIMIT:
        return -LIMIT
    return value
