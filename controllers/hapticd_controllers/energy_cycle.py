"""Energy cycles with adaptive damping.

"Relaxing Conservatism for Enhanced Impedance Range and Transparency in Haptic Interaction", eqs. 7-10: the wall
may generate energy during one press and release; what it generated is measured at the end of that cycle and
becomes damping for the next. Every reading that the print leaves open is a parameter (docs/controllers.md).
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from hapticd.law import LawParams
from hapticd.tick.energy import cycle_ended
from hapticd_controllers.cycle_sums import CycleSums, begin, end
from hapticd_controllers.felt_mass import FELT_SAMPLES, FeltFields, believe, feel, keep_period, know_nothing

LEARNED = ("damping_n_s_per_m",)
RESTS_OUTSIDE = True

WORK_SPRING, WORK_TOTAL = range(2)
PAIRING_EXACT, PAIRING_NEW_FORCE, PAIRING_POWER, PAIRING_HELD_POWER = range(4)
FORCE_DELAY_IDENTIFIED, FORCE_DELAY_NONE, FORCE_DELAY_ONE_SAMPLE = range(3)
SUM_CYCLE, SUM_START = range(2)
RULE_SIGNED, RULE_NON_NEGATIVE, RULE_NON_DECREASING = range(3)
PLATEAUS_SKIPPED, PLATEAUS_LITERAL = range(2)
CONTACT_LOSS_ENDS_CYCLE, CONTACT_LOSS_IGNORED = range(2)
NEW_CONTACT_KEEP, NEW_CONTACT_ENERGY, NEW_CONTACT_DAMPING = range(3)
STORED_ENERGY_KEPT, STORED_ENERGY_SUBTRACTED = range(2)
CAP_FELT_MASS, CAP_KNOWN_MASS, CAP_FIXED, CAP_NONE = range(4)

LIMIT = 1e12  # a quotient that is kept grows no further, in SI units; what is only summed cannot overflow
TINY_MOTION = 1e-24  # a cycle with less sum of v^2 dt [m^2/s] is rest: there is nothing to divide by
MOST_BY_FELT_MASS = 300.0  # most damping whatever was felt: a hand that moves is easily taken for a mass [N s/m]


class Params(LawParams):
    """How to read eqs. 7-10, and what bounds the damping."""

    window: int = Field(
        2, ge=1, le=100, description="samples of falling, then of rising energy at a cycle's end; 1: a plain minimum"
    )
    window_future: int = Field(
        0, ge=0, le=100, description="rising samples, where they should differ from `window`; 0: as many"
    )
    work: Literal["spring", "total"] = Field(
        "spring", description="force in the energy: without the adaptive damping term, or the complete one"
    )
    pairing: Literal["exact", "new-force", "power", "held-power"] = Field(
        "exact", description="energy of a sample: F(n-1) dx(n), F(n) dx(n), F(n) v(n) dt or F(n-1) v(n) dt"
    )
    force_delay: Literal["identified", "none", "one-sample"] = Field(
        "identified", description="how late the device applies a force; F(n-2) dx(n) is exact where it is one sample"
    )
    sum: Literal["cycle", "start"] = Field(
        "cycle", description="v^2 dt in eq. 8 summed over the cycle, or from the start of contact history"
    )
    rule: Literal["signed", "non-negative", "non-decreasing"] = Field(
        "non-decreasing", description="what the damping of eq. 8 may do from cycle to cycle"
    )
    plateaus: Literal["skipped", "literal"] = Field(
        "skipped", description="equal energies in eq. 10: passed over, or breaking the window as printed"
    )
    contact_loss: Literal["ends-cycle", "ignored"] = Field(
        "ends-cycle", description="leaving the wall: completes a release, or waits until the energy rises again"
    )
    new_contact: Literal["keep", "energy", "damping"] = Field(
        "keep", description="forgotten at a new touch: nothing, the energy and its sums, or the damping as well"
    )
    stored_energy: Literal["kept", "subtracted"] = Field(
        "kept", description="what the spring holds at a cycle's end: stays in eq. 7, or is taken out"
    )
    min_travel_counts: float = Field(
        0.0, ge=0.0, le=1e6, description="a cycle that travels less, in counts of the position, changes nothing"
    )
    small_travel_counts: float = Field(
        10.0, ge=0.0, le=1e6, description="a cycle that travels less, in counts, is noise as much as motion"
    )
    small_leaks: float = Field(
        4.0,
        ge=0.0,
        le=1e6,
        description="damping at most this many times what the spring leaked in a small cycle; 0: any",
    )
    cap: Literal["felt-mass", "known-mass", "fixed", "none"] = Field(
        "felt-mass", description="bound of the damping: from the mass identified, the mass given, a number, nothing"
    )
    cap_share: float = Field(0.6, gt=0.0, le=2.0, description="the cap from a mass, as a share of mass / dt")
    late_cap_share: float = Field(
        0.35, gt=0.0, le=2.0, description="the same where the device applies forces one sample late"
    )
    cap_damping_n_s_per_m: float = Field(
        50.0, gt=0.0, le=1e9, description="the fixed cap; for felt-mass the cap until the mass is known [N s/m]"
    )
    mass_kg: float = Field(0.25, gt=0.0, le=1e3, description="mass for the cap known-mass [kg]")
    felt_mass_memory: float = Field(
        0.998, ge=0.5, le=1.0, description="share of the felt mass's evidence that a new sample leaves standing"
    )
    wall_may_pull: bool = Field(True, description="whether damping may pull the device back while it leaves the wall")


class State(CycleSums, FeltFields):
    """What is remembered of one wall: cycle detector, energy, damping, and the evidence for mass and delay."""

    damping_n_s_per_m: float  # alpha, in force until the next cycle ends
    uncut_n_s_per_m: float  # the same before the first sample's cap
    was_in_contact: bool
    last_work_n: float  # the force that went into the energy, one sample ago


def start(state: Any, params: Any, snapshot: Any) -> None:
    """Take over: damping that was reached and energy that was not dissipated count; a credit does not."""
    state.damping_n_s_per_m = max(0.0, _bounded(snapshot.damping_n_s_per_m))
    state.uncut_n_s_per_m = 0.0
    know_nothing(state, params.force_delay == FORCE_DELAY_ONE_SAMPLE)
    state.was_in_contact = False
    state.lowest_m = snapshot.x_m
    state.highest_m = snapshot.x_m
    begin(state, min(0.0, -_bounded(snapshot.debt_j)))
    state.last_work_n = 0.0


def step(state: Any, params: Any, tick: Any) -> float:
    """The contact's own force plus the damping that past cycles called for.  -> force on the device [N]."""
    if params.cap == CAP_FELT_MASS or params.force_delay == FORCE_DELAY_IDENTIFIED:
        feel(state, tick, params.felt_mass_memory)
    if state.period_s == 0.0:
        _begin_inside(state, tick)
    if keep_period(state, tick.dt_s):  # the first one's may hold the time of enabling: its cap does not stay
        state.damping_n_s_per_m = state.uncut_n_s_per_m
    if tick.in_contact and not state.was_in_contact and params.new_contact != NEW_CONTACT_KEEP:
        begin(state, 0.0)
        if params.new_contact == NEW_CONTACT_DAMPING:
            state.damping_n_s_per_m = 0.0
    state.was_in_contact = tick.in_contact

    _count_energy(state, params, tick)
    if params.plateaus == PLATEAUS_LITERAL and state.energy_j == state.window_energy_j:
        state.window_falls = 0
        state.window_rises = 0
    inside = tick.in_contact or params.contact_loss == CONTACT_LOSS_IGNORED
    future = params.window_future if params.window_future > 0 else params.window
    ended = cycle_ended(state, state.energy_j, inside, params.window, future)  # eq. 10
    if state.window_rises == 0 and (not ended or state.window_minimum_j == state.energy_j):
        state.candidate_motion_m2_per_s = state.motion_m2_per_s
        state.candidate_stored_j = 0.5 * abs(tick.x_m * tick.spring_n)
    if ended:
        if state.count >= FELT_SAMPLES:
            believe(state, params.force_delay == FORCE_DELAY_IDENTIFIED)
        _end_cycle(state, params, tick)

    cap = _cap(state, params)
    if not state.period_is_known:
        state.uncut_n_s_per_m = state.damping_n_s_per_m
    if state.damping_n_s_per_m > cap:
        state.damping_n_s_per_m = cap
    elif state.damping_n_s_per_m < -cap:
        state.damping_n_s_per_m = -cap
    if not tick.in_contact:
        return 0.0
    force_n: float = tick.contact_n - state.damping_n_s_per_m * tick.velocity_m_per_s  # eq. 9
    if not params.wall_may_pull and (force_n > 0.0 if tick.x_m > 0.0 else force_n < 0.0):
        force_n = 0.0  # along a surface a spring is stretched either way
    return force_n


def _begin_inside(state: Any, tick: Any) -> None:
    """At the first sample: what a spring held that was pressed at the start is no gain when it comes back."""
    start_m = state.lowest_m
    if tick.in_contact and start_m * tick.x_m > 0.0:
        stored_j = _bounded(0.5 * abs(tick.spring_n * start_m) * abs(start_m / tick.x_m))
        begin(state, state.energy_j + stored_j)
        state.was_in_contact = True


def _count_energy(state: Any, params: Any, tick: Any) -> None:
    """E(n) = E(n-1) - F(n-1) (x(n) - x(n-1)) or another reading of it, eq. 8's sum, and how far the cycle travels."""
    velocity = tick.velocity_m_per_s
    if params.pairing == PAIRING_EXACT or params.pairing == PAIRING_HELD_POWER:
        held_n = tick.applied_contact_n if params.work == WORK_SPRING else tick.applied_n
        work_n = state.last_work_n if state.forces_late else held_n
        state.last_work_n = held_n
    else:
        work_n = tick.contact_n
        if params.work == WORK_TOTAL and tick.in_contact:
            work_n = work_n - state.damping_n_s_per_m * velocity
    if params.pairing == PAIRING_EXACT or params.pairing == PAIRING_NEW_FORCE:
        moved_m = tick.moved_m
    else:
        moved_m = velocity * tick.dt_s
    state.energy_j -= work_n * moved_m
    if tick.in_contact:
        state.motion_m2_per_s += velocity * velocity * tick.dt_s
        x_m = tick.x_m
        if x_m < state.lowest_m:
            state.lowest_m = x_m
        if x_m > state.highest_m:
            state.highest_m = x_m


def _end_cycle(state: Any, params: Any, tick: Any) -> None:
    """Eqs. 7 and 8; then energies count from here, so that they stay small however long a contact lasts."""
    gained_j = state.window_minimum_j  # eq. 7: E_n - E_(n-1), as E_(n-1) is 0
    pure_j = gained_j - (state.candidate_stored_j - state.stored_j)  # without what the spring holds
    motion = state.candidate_motion_m2_per_s
    travel_m = state.highest_m - state.lowest_m
    if motion > TINY_MOTION and travel_m >= params.min_travel_counts * tick.resolution_m:
        subtract = params.stored_energy == STORED_ENERGY_SUBTRACTED
        change = _bounded(-(pure_j if subtract else gained_j) / motion)  # eq. 8
        small = travel_m < params.small_travel_counts * tick.resolution_m
        if small and change > 0.0 and params.small_leaks > 0.0 and params.sum == SUM_CYCLE:
            enough = params.small_leaks * _bounded(-pure_j / motion)
            change = max(0.0, min(change, enough - state.damping_n_s_per_m))
        if change < 0.0 and params.rule == RULE_NON_DECREASING:
            change = 0.0
        state.damping_n_s_per_m += change
        if state.damping_n_s_per_m < 0.0 and params.rule == RULE_NON_NEGATIVE:
            state.damping_n_s_per_m = 0.0
    end(state, tick.x_m)
    if params.sum == SUM_CYCLE:
        state.motion_m2_per_s -= motion
        state.candidate_motion_m2_per_s = 0.0


def _cap(state: Any, params: Any) -> float:
    """Largest damping now: on a mass m a sampled damper is itself unstable from 2 m/dt, one sample late 0.83 m/dt."""
    cap: float = params.cap_damping_n_s_per_m
    if params.cap == CAP_NONE:
        cap = LIMIT
    elif params.cap != CAP_FIXED:
        mass_kg = params.mass_kg if params.cap == CAP_KNOWN_MASS else state.felt_mass_kg
        if mass_kg > 0.0:
            share = params.late_cap_share if state.forces_late else params.cap_share
            cap = share * mass_kg / state.period_s
        if params.cap == CAP_FELT_MASS and cap > MOST_BY_FELT_MASS:
            cap = MOST_BY_FELT_MASS
    return cap


def _bounded(value: float) -> float:
    if -LIMIT < value < LIMIT:
        return value
    return LIMIT if value > 0.0 else -LIMIT
