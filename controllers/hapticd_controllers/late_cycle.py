"""Energy cycles of what is late: the law of couplings and forces that other programs drive.

As `energy_cycle`, what a swing has generated becomes damping, eqs. 7-9 there, against the ground. What differs is what
a client does and a wall does not:

    - a spring has a damping of k times 15 ms before anything has swung: a body behind it that has once been thrown
      about by a delay does not come down again, however much the device is damped then;
    - what the spring holds at a cycle's end is no gain: its target moves;
    - a cycle ends too when a force comes to nothing: a wall that is so late that it only ever pushes along with the
      motion never takes anything, and the energy then never rises;
    - a force learns fast: the second cycle in a row that generates adds twice. A spring learns slowly: two cycles are
      let pass after each that adds, and after it came into force, since the body behind it goes on swinging from
      before, and a device that is held too fast leaves the body to swing against it;
    - slow swings of a spring, of more than 30 ms a cycle, add no more than the most that a base is. It is quick swings
      that more damping stills: those of the device. Slow ones are the body's, by a late spring; the device takes most
      from it at sqrt(k m) of the body, 20 to 80 N s/m. Beyond that it moves less the more it is damped, so that what a
      swing gave over the little motion looks like too little damping, more each time;
    - each cycle that generates nothing takes a twentieth off, but not below what was too little before; a spring that
      comes into force anew begins anew;
    - damping comes in 10 ms, and the velocity is smoothed: 0.1 kN s/m on one count of the position is a kick, and so is
      a damping that comes at once.

docs/couplings.md has the figures.
"""

from __future__ import annotations

from typing import Any

from hapticd.law import Field, LawParams
from hapticd.tick.energy import cycle_ended
from hapticd_controllers.cycle_sums import CycleSums, begin, end
from hapticd_controllers.felt_mass import FELT_SAMPLES, FeltFields, believe, feel, keep_period, know_nothing

LEARNED = ("damping_n_s_per_m",)
RESTS_OUTSIDE = True

LIMIT = 1e12  # a quotient that is kept grows no further, in SI units; what is only summed cannot overflow
TINY_MOTION = 1e-24  # a cycle with less sum of v^2 dt [m^2/s] is rest: there is nothing to divide by
WINDOW = 2  # samples of falling, then of rising energy at a cycle's end
SMALL_COUNTS = 10.0  # a cycle that travels less, in counts of the position, is noise as much as motion
SMALL_LEAKS = 4.0  # damping at most this many times what was generated in a small cycle
MEMORY = 0.998  # share of the felt mass's evidence that a new sample leaves standing
SHARE_OF_MASS = 1.0  # most damping in m/dt: a sampled damper is itself unstable from 2, smoothed velocity or not
LATE_SHARE_OF_MASS = 0.35  # the same where the device applies forces one sample late: from 0.83
MOST = 300.0  # most damping whatever was felt: a hand that moves is easily taken for a mass [N s/m]
NEW_SPEED = 0.5  # least share of the newest sample in the velocity that is damped
SMOOTH_S = 0.001  # from twice this on a longer sample has more: half of one of 10 ms is a delay, and shakes [s]
EASE_S = 0.01  # in which a damping comes into force, to 63 %: at 1 m/s at once it is a jump of its whole force [s]
AGAIN = 2.0  # times what is missing that a force's second cycle in a row adds: one swing of it takes half a second
SPRING_WAITS = 2.0  # cycles of a spring that are let pass after a change: what swings there began before it
SLOW_S = 0.03  # a cycle of a spring that lasts longer is of the body behind it, and not of the device [s]
FLOOR_FALL = 0.1  # what was too little is forgotten so much slower than what was added beyond it


class Params(LawParams):
    """How much damping there is before anything is known, and how it goes."""

    base_s: float = Field(
        0.015, ge=0.0, le=1.0, description="damping of a spring to begin with, as a share of its stiffness [s]"
    )
    most_base_n_s_per_m: float = Field(50.0, ge=0.0, le=1e9, description="the most that this comes to [N s/m]")
    most_unfelt_n_s_per_m: float = Field(
        100.0, gt=0.0, le=1e9, description="most damping until the mass of the device has been felt [N s/m]"
    )
    fall: float = Field(
        0.05, ge=0.0, le=1.0, description="share of the damping that a cycle which generated nothing takes off"
    )


class State(CycleSums, FeltFields):
    """What is remembered of one axis of a port."""

    damping_n_s_per_m: float  # goes into force until the next cycle ends
    eased_n_s_per_m: float  # in force
    floor_n_s_per_m: float  # was too little
    again: float  # times what is missing that the next cycle adds
    waits: float  # cycles that are let pass
    cycle_s: float  # in force since the last cycle's end
    velocity_m_per_s: float  # smoothed
    was_in_contact: bool
    last_port_n: float  # the port's own force, one sample ago


def start(state: Any, params: Any, snapshot: Any) -> None:
    """Take over: damping that was reached and energy that was not dissipated count; a credit does not."""
    state.damping_n_s_per_m = max(0.0, _bounded(snapshot.damping_n_s_per_m))
    # What pushes already is not let down; what does not may be out of reach and asked next in the midst of a touch.
    state.eased_n_s_per_m = state.damping_n_s_per_m if snapshot.applied_n != 0.0 else 0.0
    _forget(state)
    state.cycle_s = 0.0
    state.velocity_m_per_s = 0.0
    know_nothing(state, False)
    state.was_in_contact = False
    begin(state, min(0.0, -_bounded(snapshot.debt_j)))
    state.lowest_m = snapshot.x_m
    state.highest_m = snapshot.x_m
    state.last_port_n = 0.0


def step(state: Any, params: Any, tick: Any) -> float:
    """The port's own force, less damping.  -> force on the device [N]."""
    feel(state, tick, MEMORY)
    if tick.in_contact and not state.was_in_contact and tick.spring_n != 0.0:
        begin(state, 0.0)
        state.lowest_m = tick.x_m
        state.highest_m = tick.x_m
        state.damping_n_s_per_m = 0.0
        _forget(state)
        state.cycle_s = 0.0
        state.waits = SPRING_WAITS
    state.was_in_contact = tick.in_contact

    _count_energy(state, tick)
    pushes = tick.in_contact and tick.contact_n != 0.0
    ended = cycle_ended(state, state.energy_j, pushes, WINDOW, WINDOW)
    if state.window_rises == 0 and (not ended or state.window_minimum_j == state.energy_j):
        state.candidate_motion_m2_per_s = state.motion_m2_per_s
        state.candidate_stored_j = 0.5 * abs(tick.x_m * tick.spring_n)
    if ended:
        if state.count >= FELT_SAMPLES:
            believe(state, True)
        _end_cycle(state, params, tick)
    _bound(state, params, tick)
    if not tick.in_contact:
        state.eased_n_s_per_m = 0.0
        state.velocity_m_per_s = 0.0
        return 0.0
    newest = max(NEW_SPEED, 1.0 - SMOOTH_S / tick.dt_s)
    state.velocity_m_per_s += newest * (tick.velocity_m_per_s - state.velocity_m_per_s)
    share = tick.dt_s / (EASE_S + tick.dt_s)
    state.eased_n_s_per_m += share * (state.damping_n_s_per_m - state.eased_n_s_per_m)
    force_n: float = tick.contact_n - state.eased_n_s_per_m * state.velocity_m_per_s
    return force_n


def _count_energy(state: Any, tick: Any) -> None:
    """E(n) = E(n-1) - F(n-1) (x(n) - x(n-1)) of the port's own force, and how far the cycle travels."""
    port_n = state.last_port_n if state.forces_late else tick.applied_contact_n
    state.last_port_n = tick.applied_contact_n
    state.energy_j -= port_n * tick.moved_m
    if tick.in_contact:
        state.cycle_s += tick.dt_s
        state.motion_m2_per_s += tick.velocity_m_per_s * tick.velocity_m_per_s * tick.dt_s
        x_m = tick.x_m
        if x_m < state.lowest_m:
            state.lowest_m = x_m
        elif x_m > state.highest_m:
            state.highest_m = x_m


def _end_cycle(state: Any, params: Any, tick: Any) -> None:
    """What was generated becomes damping; then energies count from here."""
    generated_j = state.candidate_stored_j - state.stored_j - state.window_minimum_j
    motion = state.candidate_motion_m2_per_s
    if motion > TINY_MOTION:
        missing = _bounded(generated_j / motion)  # eq. 8
        if missing > 0.0 and state.highest_m - state.lowest_m < SMALL_COUNTS * tick.resolution_m:
            missing = max(0.0, min(missing, SMALL_LEAKS * missing - state.damping_n_s_per_m))
        if state.waits > 0.0:
            state.waits -= 1.0
        elif missing > 0.0:
            _add(state, params, missing, tick.spring_n != 0.0)
        else:
            state.again = 1.0
            state.floor_n_s_per_m *= 1.0 - FLOOR_FALL * params.fall
            state.damping_n_s_per_m = max(state.floor_n_s_per_m, state.damping_n_s_per_m * (1.0 - params.fall))
    end(state, tick.x_m)
    state.cycle_s = 0.0
    state.motion_m2_per_s -= motion
    state.candidate_motion_m2_per_s = 0.0


def _add(state: Any, params: Any, missing: float, spring: bool) -> None:
    """What there was is too little."""
    state.floor_n_s_per_m = max(state.floor_n_s_per_m, state.damping_n_s_per_m)
    if spring:
        if state.cycle_s > SLOW_S:
            missing = min(missing, max(0.0, params.most_base_n_s_per_m - state.damping_n_s_per_m))
        state.damping_n_s_per_m += missing
        state.waits = SPRING_WAITS
    else:
        state.damping_n_s_per_m += missing * state.again
        state.again = AGAIN


def _forget(state: Any) -> None:
    """Know nothing of what was too little."""
    state.floor_n_s_per_m = 0.0
    state.again = 1.0
    state.waits = 0.0


def _bound(state: Any, params: Any, tick: Any) -> None:
    """No less than the spring's base, but of that as well no more than the device bears."""
    keep_period(state, tick.dt_s)
    most: float = params.most_unfelt_n_s_per_m
    if state.felt_mass_kg > 0.0:
        share = LATE_SHARE_OF_MASS if state.forces_late else SHARE_OF_MASS
        most = share * state.felt_mass_kg / state.period_s
    if tick.in_contact and tick.spring_n != 0.0:
        base = min(params.most_base_n_s_per_m, params.base_s * _bounded(tick.spring_n / -tick.x_m))
        state.damping_n_s_per_m = max(state.damping_n_s_per_m, base)
    state.damping_n_s_per_m = min(state.damping_n_s_per_m, most, MOST)


def _bounded(value: float) -> float:
    if -LIMIT < value < LIMIT:
        return value
    return LIMIT if value > 0.0 else -LIMIT
