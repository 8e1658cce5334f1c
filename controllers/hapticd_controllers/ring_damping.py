"""Damping that is there while the contact rings, and lets go.

The paper spreads what a wall generated over the next press and release (energy_cycle.py). Between linear spring and
held force that amount is known beforehand: (k dt / 2) sum v^2 dt. So damping has two parts here:

    F = F_contact - (base + brake) v                       the paper's eq. 9, alpha = base + brake
    base  = leaks k dt / 2                                 leaks >= 1: what the sampled spring generates, and more where
                                                           swings do not die away (a delay, a slow actuator)
    brake = 2 ratio sqrt(k m), with the base m / (2 dt)    while the contact swings by itself
          = (4 / pi) ratio k t                             t after the touch, until the first turn, and let out from
                                                           45 ms on as it came: it is a hand's, and feels no step

A *swing* runs from one turn of the position to the next. Its half period h tells the mass, m = k (h / pi)^2 + B dt,
and whether it is the contact's own or a hand's: no hand turns within 45 ms. k is what the device was given of the wall,
less where a limit holds force back; the damping B, part of a sample late, hides B dt of the mass. Nothing about the
device is given. Before the first turn the mass is unknown; a brake that grows with the time is the full one of any mass
a quarter of a period after the touch, and takes from an arrival where that means to push, not to pull. One decision is
made a swing, none between. docs/controllers.md has the reasons and the evidence. All of it stands in one module: swings
and what comes of them share one state.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from hapticd.law import Field, LawParams

PI = 3.141592653589793
LIMIT = 1e12  # a quotient that is kept grows no further, in SI units

TURN_COUNTS = 1.6  # a way back by one count is the flicker of the quantiser, by two it is not
TURN_NOISES = 3.0  # in mean changes of the move from tick to tick: noise rarely goes 3 of them one way
NOISE_SHARE = 0.02  # of a new change in that mean: it follows within 50 ticks, longer than most half periods
LOUD = 2.0  # in turn thresholds: a shorter swing says little about mass or need
PART = 1.43  # a swing cut by the surface is 0.5 to 1 half period long
BOUNCE = 0.5  # a whole bounce without a turn that is seen goes in and out: two such parts
EVEN = 0.3  # half periods within three tenths are equal; quantised turns are blurred by as much
EVEN_TICKS = 1.5  # and never known better than to a tick at each end
QUARTER = 4.0 / PI  # ratio of k t to the full brake, a quarter of a period after the touch: 2 / w over (pi / 2) / w
RECENT = 8.0  # an arrival is braked by its mean speed over the last of 8 parts of its time: a single count is no blow
SHRINKS = 0.95  # a swing below this share of the one two before (same direction) dies away by itself
MANY = 4.0  # cut swings without a pause: a device that bounces slowly, and not a hand that taps
OWN = 2.5  # a swing that would need more than this many times the known mass is driven from outside
LEARN = 0.3  # of a new mass: three swings tell another hand
FORGET = 1.05  # growth of the mass at each quick swing that it does not explain, until it does
SILENCE = 2.0  # inside, in half periods: one until the next turn, and up to one until that is noticed
FLIGHT_S = 0.09  # a bounce is over sooner; a hand that taps is not back yet (about 10 Hz at most)
STRONGER = 4.0  # the brake, for each swing that does not shrink: from least to full in five
PATIENCE = 2.0  # full swings that do not shrink before the brake is halved instead: too much damping rings as well
FIRM = 3.0  # a ring with more such swings brings the first brake of the next one back, BACK times
BACK = 8.0
RELAX = 0.7  # of the first brake, after each ring that died away without more than that
MOST_OF_MASS = 0.5  # base and brake in m/dt: a sampled damper is unstable by itself from 2, and 0.83 one sample late
BASE_OF_MASS = 0.45  # the same for the base, which also has to suit two late samples (0.54)
GROWTH = 1.3  # of the base a swing: a step beyond the last one that was seen not to do, and within half too much
EVIDENCE = 0.3  # that a swing of one turn threshold did not shrink; of counts, a fading ring repeats a few
DOUBT = 0.5  # of that evidence which a swing that shrinks leaves: among a few counts one less is no proof
ENOUGH = 1.2  # of it in a row before the base grows: two large swings, or four of two counts
UNEVEN = 3.0  # in turn thresholds: swings as long as this are no noise, even or not
DRIVEN = 0.3  # of the wall's force: where noise through the base is more, it drives the swings, and more base is worse
ARRIVAL = 6.0  # swings of a contact before its base may grow: an arrival has died away by then
SOFTENS = 0.5  # of the stiffness, from tick to tick: another wall, at which the device arrives now
SLOWER = 0.9  # of the base, for each swing of a hand: this wall is being used and does not ring
LEFT = 0.5  # of the base, for each time the device has left for good, or the wall has softened
MOST_LEAKS = 1e3
LATE = 2.0  # in sampling periods: a longer dt is that of a tick that came late, and a shorter one of that after it
SMOOTHED = 0.05  # of such a dt in that period: another rate is followed, by at most 5 % a tick
INHERITED = 4.0  # leaks taken over from the law before, at most: what holds every wall without delay


class Params(LawParams):
    """The few choices that are a matter of taste."""

    hand_half_period_s: float = Field(
        0.045, gt=0.0, le=10.0, description="a swing longer than this may be the hand's and is not braked [s]"
    )
    brake_ratio: float = Field(0.7, ge=0.0, le=2.0, description="damping ratio of the full brake; 0: none")
    least_brake_ratio: float = Field(
        0.002,
        ge=0.0,
        le=2.0,
        description="what the first brake of a ring relaxes to while rings die away by themselves: high settles "
        "sooner, low leaves taps and presses as they are",
    )
    pull_after: int = Field(
        4, ge=0, le=1000, description="swings that did not shrink before damping may pull the device back; 0: always"
    )


class State:
    """What is remembered of one wall: the swing that runs, the last two, and what has been learned."""

    damping_n_s_per_m: float  # base and brake now; outside the wall the base
    base_n_s_per_m: float  # learned: what stays between rings
    leak_n_s_per_m: float  # k dt / 2 where it was last in the wall
    stiffness_n_per_m: float  # k there
    period_s: float  # the usual dt: one overrun is not another sampling rate
    earliest_s: float  # dt from here
    latest_s: float  # to here is a usual one; 0 while not known
    felt_mass_kg: float  # learned: what the wall swings; 0 while unknown
    leaks: float  # base in k dt / 2; 0 until the first contact
    first_brake: float  # learned: damping ratio that a ring starts with
    brake: float  # damping ratio now; 0: off
    swings: float  # own swings of this ring
    stubborn: float  # those among them that were loud and did not shrink
    age: float  # own swings since the device came
    steady: float  # evidence of those in a row that did not shrink
    noise_m: float  # mean change of the move from tick to tick
    last_moved_m: float
    was_in_contact: bool
    outward: bool  # direction of the swing that runs
    whole: bool  # whether it began with a turn, and not at the surface
    arrives: bool  # whether it is the way in from the surface, and nothing rings yet
    comes_m_per_s: float  # its mean speed then, over the last eighth of that time
    from_m: float  # where it began
    far_m: float  # how far it has come
    far_s: float  # when, from its beginning
    swing_s: float  # time since its beginning
    last_s: float  # half period of the last swing; 0: none since the device came
    last_m: float  # its length
    older_s: float  # half period of the one before
    older_m: float  # its length
    last_whole: bool


def start(state: Any, params: Any, snapshot: Any) -> None:
    """Take over: the damping of the law before is a base to begin with, never a brake."""
    state.base_n_s_per_m = max(0.0, _bounded(snapshot.damping_n_s_per_m))
    state.damping_n_s_per_m = state.base_n_s_per_m
    state.leak_n_s_per_m = 0.0
    state.stiffness_n_per_m = 0.0
    state.period_s = 0.0
    state.earliest_s = 0.0
    state.latest_s = 0.0
    state.felt_mass_kg = 0.0
    state.leaks = 0.0
    state.first_brake = params.brake_ratio
    state.brake = 0.0
    state.swings = 0.0
    state.stubborn = 0.0
    state.age = 0.0
    state.steady = 0.0
    state.noise_m = 0.0
    state.last_moved_m = 0.0
    state.comes_m_per_s = 0.0
    state.was_in_contact = snapshot.x_m < 0.0
    _begin(state, min(0.0, snapshot.x_m), snapshot.velocity_m_per_s > 0.0, False)
    state.last_s = 0.0
    state.last_m = 0.0
    state.older_s = 0.0
    state.older_m = 0.0
    state.last_whole = False


def step(state: Any, params: Any, tick: Any) -> float:
    """The contact's own force, less base and brake.  -> force on the device [N]."""
    turn_m = _turn_threshold(state, tick)
    state.swing_s += tick.dt_s
    dt_s = tick.dt_s
    stiffness = 0.0
    inside = tick.in_contact
    if inside:
        if not state.earliest_s <= dt_s <= state.latest_s:
            dt_s = _unusual(state, dt_s)
        stiffness = tick.spring_n / -tick.x_m
        if stiffness > LIMIT:
            stiffness = LIMIT
        elif stiffness < 0.0:
            stiffness = 0.0
        if state.leaks == 0.0:
            _inherit(state, stiffness, dt_s)
        if not state.was_in_contact:
            _begin(state, 0.0, False, False)
            state.arrives = state.swings == 0.0
        _follow(state, params, tick, turn_m, stiffness)
    elif state.was_in_contact:
        _leave(state, params, tick, turn_m)
    state.was_in_contact = inside
    if state.last_s > 0.0 and state.swing_s > (SILENCE * state.last_s if inside else FLIGHT_S):
        _fall_silent(state, params, inside)
    if not inside:
        return 0.0
    _set_damping(state, params, stiffness, dt_s)
    force_n: float = tick.contact_n - state.damping_n_s_per_m * tick.velocity_m_per_s  # eq. 9
    if state.arrives:
        force_n += _evenly(state, tick)
    if force_n * tick.x_m > 0.0 and state.stubborn < params.pull_after:
        # A wall does not hold on to who leaves, nor does what sticks along a surface, which is stretched either way.
        force_n = max(force_n, min(0.0, tick.contact_n)) if force_n < 0.0 else min(force_n, max(0.0, tick.contact_n))
    return force_n


# From positions to swings


def _turn_threshold(state: Any, tick: Any) -> float:
    """How far the way back must go to be one: beyond counts, and beyond noise.

    Noise changes the move from tick to tick, a swing hardly: its change is (pi dt / h)^2 of its length.
    """
    change_m = abs(tick.moved_m - state.last_moved_m)
    state.last_moved_m = tick.moved_m
    state.noise_m += NOISE_SHARE * (change_m - state.noise_m)
    counts_m: float = TURN_COUNTS * tick.resolution_m
    noise_m: float = TURN_NOISES * state.noise_m
    return counts_m if counts_m > noise_m else noise_m


def _begin(state: Any, from_m: float, outward: bool, whole: bool) -> None:
    """A swing begins now."""
    state.from_m = from_m
    state.far_m = from_m
    state.far_s = 0.0
    state.swing_s = 0.0
    state.outward = outward
    state.whole = whole
    state.arrives = False


def _follow(state: Any, params: Any, tick: Any, turn_m: float, stiffness: float) -> None:
    """Inside: the swing goes on, or has turned where it had come farthest."""
    x_m = tick.x_m
    ahead_m = x_m - state.far_m if state.outward else state.far_m - x_m
    if ahead_m > 0.0:
        state.far_m = x_m
        state.far_s = state.swing_s
    elif -ahead_m > turn_m:
        since_s = state.swing_s - state.far_s
        half_s = state.far_s if state.whole else PART * state.far_s
        deep_m = tick.moved_m - x_m  # a tick ago, as deep as it was given its force: less where a limit held that back
        given = tick.applied_contact_n / deep_m if deep_m != 0.0 else 0.0
        stiffness = max(0.0, min(stiffness, given))
        _end(state, params, half_s, abs(state.far_m - state.from_m), state.whole, turn_m, stiffness, tick.dt_s)
        _begin(state, state.far_m, not state.outward, True)
        state.swing_s = since_s
        state.far_m = x_m
        state.far_s = since_s


def _leave(state: Any, params: Any, tick: Any, turn_m: float) -> None:
    """The surface ends the swing; the stiffness is out of sight, so that no mass comes of it."""
    if state.outward:
        _end(state, params, PART * state.swing_s, abs(state.from_m), False, turn_m, 0.0, tick.dt_s)
    else:
        _end(state, params, BOUNCE * PART * state.swing_s, abs(state.far_m), False, turn_m, 0.0, tick.dt_s)
    state.swing_s = 0.0


# What a swing says


def _end(
    state: Any, params: Any, half_s: float, length_m: float, whole: bool, turn_m: float, stiffness: float, dt_s: float
) -> None:
    """A swing has ended: whose was it, does the contact need more base, does it need a brake?"""
    if state.brake < 1.0:  # a braked swing takes longer than a free one; beyond it the contact does not swing
        half_s *= sqrt(1.0 - state.brake * state.brake)
    even = _even(state, half_s, turn_m, dt_s)
    shrinks = length_m < SHRINKS * state.older_m
    loud = length_m > LOUD * turn_m
    quick = half_s <= params.hand_half_period_s
    mass_kg = stiffness * (half_s / PI) * (half_s / PI)
    mass_kg = _bounded(mass_kg + state.damping_n_s_per_m * dt_s) if mass_kg > 0.0 else 0.0
    own = quick and (state.felt_mass_kg == 0.0 or mass_kg <= OWN * state.felt_mass_kg)
    own = own or (state.felt_mass_kg == 0.0 and not whole and state.swings >= MANY)  # it bounces, slowly

    if (quick or own) and loud and mass_kg > 0.0:
        _feel(state, mass_kg, own, whole)
    if own:
        alike = whole and state.last_whole and (even or length_m > UNEVEN * turn_m)
        bounces = not whole and state.swings >= 2.0 and length_m > turn_m
        state.age += 1.0
        if shrinks:
            state.steady *= DOUBT
        elif (alike or bounces) and state.age > ARRIVAL:
            state.steady += min(1.0, EVIDENCE * length_m / turn_m)
            noise_n = state.base_n_s_per_m * state.noise_m / dt_s
            deepest_n = stiffness * max(abs(state.from_m), abs(state.far_m))  # 0 at the surface, where nothing grows
            if state.steady > ENOUGH and noise_n < DRIVEN * deepest_n:
                state.leaks = min(MOST_LEAKS, GROWTH * state.leaks)
        if loud:
            if state.swings >= 2.0 and not shrinks:
                state.stubborn += 1.0
            _brake(state, params)
        else:
            state.brake = 0.0
        state.swings += 1.0
    elif not quick:
        _relax(state, SLOWER)
        state.brake = 0.0
        if state.felt_mass_kg == 0.0 and not whole:
            state.swings += 1.0
    state.older_s = state.last_s
    state.older_m = state.last_m
    state.last_s = half_s
    state.last_m = length_m
    state.last_whole = whole


def _even(state: Any, half_s: float, turn_m: float, dt_s: float) -> bool:
    """Whether a swing is as long as the last one; of a few counts the way in and out differ."""
    blur_s = max(EVEN_TICKS * dt_s, EVEN * half_s)
    if abs(half_s - state.last_s) <= blur_s:
        return True
    again: bool = turn_m > TURN_NOISES * state.noise_m and abs(half_s - state.older_s) <= blur_s
    return again


def _feel(state: Any, mass_kg: float, own: bool, whole: bool) -> None:
    """The mass; a swing that the surface has cut tells it roughly, which is for a beginning only."""
    if state.felt_mass_kg == 0.0:
        state.felt_mass_kg = mass_kg
    elif whole and own:
        state.felt_mass_kg += LEARN * (min(mass_kg, 2.0 * state.felt_mass_kg) - state.felt_mass_kg)
    elif whole:
        state.felt_mass_kg = _bounded(FORGET * state.felt_mass_kg)


def _brake(state: Any, params: Any) -> None:
    """From the first brake up, once for each stubborn swing, to the full one; what that does not stop, less may."""
    ratio = state.first_brake
    used = 0.0
    while used < state.stubborn and ratio < params.brake_ratio:
        ratio *= STRONGER
        used += 1.0
    ratio = min(ratio, params.brake_ratio)
    used += PATIENCE
    while used < state.stubborn and ratio > params.least_brake_ratio:
        ratio *= 0.5
        used += 1.0
    if ratio <= params.least_brake_ratio < params.brake_ratio:
        state.stubborn = 0.0  # nothing helped: from the beginning, if there was more than the least
    state.brake = ratio


def _relax(state: Any, share: float) -> None:
    """A share of the base that is there: leaks go on growing where the mass limits it, and are not waited for."""
    leaks = state.leaks
    if state.leak_n_s_per_m > 0.0:
        leaks = min(leaks, state.base_n_s_per_m / state.leak_n_s_per_m)
    state.leaks = max(1.0, share * leaks)


def _fall_silent(state: Any, params: Any, in_contact: bool) -> None:
    """Silence ends the ring, and with it the brake; the next ring begins with less if this one was harmless."""
    if in_contact and state.brake == 0.0 and state.swings == 0.0:
        return
    state.brake = 0.0
    if state.swings > 0.0 and state.stubborn == 0.0:
        state.first_brake = max(min(params.least_brake_ratio, params.brake_ratio), RELAX * state.first_brake)
    elif state.stubborn > FIRM:
        state.first_brake = min(params.brake_ratio, BACK * state.first_brake)
    state.swings = 0.0
    state.stubborn = 0.0
    if not in_contact:
        _relax(state, LEFT)
        state.last_s = 0.0
        state.age = 0.0
        state.base_n_s_per_m = min(state.base_n_s_per_m, state.leaks * state.leak_n_s_per_m)
        state.damping_n_s_per_m = state.base_n_s_per_m


# From what is known to damping


def _inherit(state: Any, stiffness: float, dt_s: float) -> None:
    """The first contact: damping of the law before in leaks of this wall."""
    leak = 0.5 * stiffness * dt_s
    state.leaks = 1.0
    if leak > 0.0:
        state.leaks = max(1.0, min(INHERITED, state.base_n_s_per_m / leak))


def _set_damping(state: Any, params: Any, stiffness: float, dt_s: float) -> None:
    """Base and brake at the stiffness of now, so that both soften with the wall."""
    leak = 0.5 * stiffness * dt_s
    if stiffness < SOFTENS * state.stiffness_n_per_m:
        state.age = 0.0
        _relax(state, LEFT)
    base = leak * state.leaks
    if state.leaks > 1.0 and state.felt_mass_kg > 0.0:
        base = max(leak, min(base, BASE_OF_MASS * state.felt_mass_kg / dt_s))
    state.leak_n_s_per_m = leak
    state.stiffness_n_per_m = stiffness
    state.base_n_s_per_m = base
    damping = base
    if state.brake > 0.0:
        most = max(base, MOST_OF_MASS * state.felt_mass_kg / dt_s)
        damping = _bounded(min(most, base + _full(state, state.brake, stiffness, dt_s)))
    elif state.arrives and state.swing_s < 2.0 * params.hand_half_period_s:
        brake_s = min(state.swing_s, 2.0 * params.hand_half_period_s - state.swing_s)  # a hand's is let out as it came
        brake = QUARTER * state.first_brake * stiffness * brake_s
        if state.felt_mass_kg > 0.0:
            brake = min(brake, _full(state, state.first_brake, stiffness, dt_s))
        damping = _bounded(base + brake)
    state.damping_n_s_per_m = damping


def _unusual(state: Any, dt_s: float) -> float:
    """What to reckon with for a time between samples that is not the usual one [s]; what is usual follows slowly.

    The first two are not known to be: what came before the first may have taken long.
    """
    period_s: float = state.period_s
    bounded_s: float
    if period_s == 0.0:
        state.period_s = dt_s
        return dt_s
    if state.latest_s == 0.0:
        state.period_s = min(period_s, dt_s)
        bounded_s = min(dt_s, LATE * state.period_s)
    else:
        bounded_s = state.latest_s if dt_s > state.latest_s else state.earliest_s
        state.period_s += SMOOTHED * (bounded_s - period_s)
    state.latest_s = LATE * state.period_s
    state.earliest_s = state.period_s / LATE
    return bounded_s


def _evenly(state: Any, tick: Any) -> float:
    """What the brake gives more on an arrival for its mean speed than for that of this tick, 0 or a few counts."""
    share = RECENT * tick.dt_s / max(RECENT * tick.dt_s, state.swing_s)
    state.comes_m_per_s += share * (tick.velocity_m_per_s - state.comes_m_per_s)
    brake = state.damping_n_s_per_m - state.base_n_s_per_m
    more_n: float = brake * (tick.velocity_m_per_s - state.comes_m_per_s)
    return more_n


def _full(state: Any, ratio: float, stiffness: float, dt_s: float) -> float:
    """A brake of this damping ratio, as far as a sampled one may go."""
    mass_kg: float = state.felt_mass_kg
    return min(2.0 * ratio * sqrt(stiffness * mass_kg), MOST_OF_MASS * mass_kg / dt_s)


def _bounded(value: float) -> float:
    if -LIMIT < value < LIMIT:
        return value
    return LIMIT if value > 0.0 else -LIMIT
