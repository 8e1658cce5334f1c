"""The mechanics of a simulated device: one period, exactly.

    m x'' + b x' + k x = F + F_hand - f_c sign(x')          m, b, k: device and hand together

F and F_hand are held over a period (zero-order hold), so between samples the equation is linear with constant
input and has a closed form. A sampled wall changes its force at samples only; contact is no event here. Coulomb
friction is one: the instant of standstill is found inside the period, and the device then stays or turns back.

The functions are arithmetic on scalar fields, + - * / and comparisons only, so that the same source runs
interpreted and compiled with equal results to the last bit. Switches in capitals are terms of the model;
`specialise` removes the branches of those that a device does not have.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from hapticd.simulation.options import (
    Change,
    ChirpForce,
    ConstantForce,
    PressAndReleaseForce,
    RampForce,
    RecordedForce,
    SimulationOptions,
    SineForce,
    StepForce,
)

# Terms of the model. All on is the full model; `terms` says which ones a device needs.
DELAY: bool = True
SATURATION: bool = True
LAG: bool = True
HAND: bool = True
SPRING: bool = True
FRICTION: bool = True
NOISE: bool = True
QUANTISED: bool = True
TIMED: bool = True
HAND_STEP: bool = True
HAND_RAMP: bool = True
HAND_SINE: bool = True
HAND_CHIRP: bool = True
HAND_PRESS: bool = True
HAND_RECORDED: bool = True

PROFILE_CONSTANT, PROFILE_STEP, PROFILE_RAMP, PROFILE_SINE, PROFILE_CHIRP, PROFILE_PRESS, PROFILE_RECORDED = range(7)

_ROUND = 6755399441055744.0  # 1.5 * 2^52: adding and taking it away rounds to the nearest whole, half to even
_TURN = 6.283185307179586
_TERMS = 17  # of the series below: the next one is under 1e-19 of the sum
_SWINGS_PER_PERIOD = 10.0


_PROFILES: dict[type[Any], int] = {
    ConstantForce: PROFILE_CONSTANT,
    StepForce: PROFILE_STEP,
    RampForce: PROFILE_RAMP,
    SineForce: PROFILE_SINE,
    ChirpForce: PROFILE_CHIRP,
    PressAndReleaseForce: PROFILE_PRESS,
    RecordedForce: PROFILE_RECORDED,
}


class PlantState:
    """What changes from period to period.

    Attributes:
        x_m: position relative to the wall [m].
        v_m_per_s: velocity [m/s].
        measured_m: what the position sensor shows [m].
        applied_n: force of the actuator over the last period [N].
        lag_n: force at the output of a first-order actuator now [N].
        tick: periods done.
        line_at: where the delay line is written next.
        point_at: point of a recorded hand force that was passed last.
        noise_a, noise_b: the two parts of the noise generator.
    """

    __slots__ = (
        "applied_n",
        "lag_n",
        "line_at",
        "measured_m",
        "noise_a",
        "noise_b",
        "point_at",
        "tick",
        "v_m_per_s",
        "x_m",
    )

    x_m: float
    v_m_per_s: float
    measured_m: float
    applied_n: float
    lag_n: float
    tick: int
    line_at: int
    point_at: int
    noise_a: int
    noise_b: int


class PlantParams:
    """What stays the same until the next change of parameters.

    Attributes:
        period_s: time between samples [s].
        x_per_v, x_per_f, v_per_v, v_per_f: what position and velocity gain in a period, per velocity and force.
        spring_n_per_m: spring of the hand [N/m].
        mass_kg: device and hand [kg].
        decay_per_s: b / m [1/s].
        stiffness_per_s2: k / m [1/s^2].
        half_swing_s: longest time between two standstills under constant force [s].
        coulomb_n: Coulomb friction [N].
        limit_n: saturation of the actuator [N].
        lag_keep: share of its distance from the command that the actuator keeps over a period.
        lag_mean: mean of that share over the period.
        delay_samples: periods between command and force.
        resolution_m: step of the sensor [m].
        noise_m: standard deviation of the sensor noise, times sqrt(3) [m].
        hand_profile: which function of time the hand follows, one of the `PROFILE_` numbers.
        hand_n, hand_from_n, hand_at_s, hand_duration_s, hand_hz, hand_end_hz, hand_repeat: profile of the hand.
    """

    __slots__ = (
        "coulomb_n",
        "decay_per_s",
        "delay_samples",
        "half_swing_s",
        "hand_at_s",
        "hand_duration_s",
        "hand_end_hz",
        "hand_from_n",
        "hand_hz",
        "hand_n",
        "hand_profile",
        "hand_repeat",
        "lag_keep",
        "lag_mean",
        "limit_n",
        "mass_kg",
        "noise_m",
        "period_s",
        "resolution_m",
        "spring_n_per_m",
        "stiffness_per_s2",
        "v_per_f",
        "v_per_v",
        "x_per_f",
        "x_per_v",
    )

    period_s: float
    x_per_v: float
    x_per_f: float
    v_per_v: float
    v_per_f: float
    spring_n_per_m: float
    mass_kg: float
    decay_per_s: float
    stiffness_per_s2: float
    half_swing_s: float
    coulomb_n: float
    limit_n: float
    lag_keep: float
    lag_mean: float
    delay_samples: int
    resolution_m: float
    noise_m: float
    hand_profile: int
    hand_n: float
    hand_from_n: float
    hand_at_s: float
    hand_duration_s: float
    hand_hz: float
    hand_end_hz: float
    hand_repeat: int


class Buffers(NamedTuple):
    """What does not fit into scalar fields: lists when interpreted, arrays when compiled.

    Attributes:
        line: commands on their way to the actuator [N].
        points_s: times of a recorded hand force [s].
        points_n: its forces [N].
    """

    line: Any
    points_s: Any
    points_n: Any


def move(state: PlantState, params: PlantParams, buffers: Buffers, force_n: float) -> None:
    """Advance the mechanics by one period under a commanded force."""
    f = force_n
    if DELAY:
        length = len(buffers.line)
        buffers.line[state.line_at] = f
        f = buffers.line[(state.line_at + length - params.delay_samples) % length]
        state.line_at = (state.line_at + 1) % length
    if SATURATION:
        if f > params.limit_n:
            f = params.limit_n
        elif f < -params.limit_n:
            f = -params.limit_n
    if LAG:
        # The actuator's state is exact; the mechanics feel its mean over the period, so the impulse is exact.
        distance_n = state.lag_n - f
        state.lag_n = f + distance_n * params.lag_keep
        f = f + distance_n * params.lag_mean
    state.applied_n = f
    if HAND:
        f = f + hand_force(state, params, buffers)
    if FRICTION:
        slide(state, params, f)
    else:
        if SPRING:
            f = f - params.spring_n_per_m * state.x_m
        v = state.v_m_per_s
        state.x_m = state.x_m + (v * params.x_per_v + f * params.x_per_f)
        state.v_m_per_s = v * params.v_per_v + f * params.v_per_f
    if TIMED:
        state.tick += 1


def sense(state: PlantState, params: PlantParams) -> None:
    """Take a sample of the position: noise first, then the nearest step of the sensor, half to even."""
    x_m = state.x_m
    if NOISE:
        # L'Ecuyer's combined generator (1988); the sum of four uniforms has variance 1/3.
        a = state.noise_a
        b = state.noise_b
        total = 0.0
        for _ in range(4):
            a = a * 40014 % 2147483563
            b = b * 40692 % 2147483399
            total += (a - b) % 2147483562 / 2147483562.0
        state.noise_a = a
        state.noise_b = b
        x_m = x_m + (total - 2.0) * params.noise_m
    if QUANTISED and params.resolution_m > 0.0:
        x_m = (x_m / params.resolution_m + _ROUND - _ROUND) * params.resolution_m
    state.measured_m = x_m


def hand_force(state: PlantState, params: PlantParams, buffers: Buffers) -> float:
    """Force that the hand means to give over the period that starts now [N]."""
    if TIMED:
        t_s = state.tick * params.period_s
        if HAND_STEP and params.hand_profile == PROFILE_STEP:
            return params.hand_n if t_s >= params.hand_at_s else params.hand_from_n
        if HAND_RAMP and params.hand_profile == PROFILE_RAMP:
            if t_s <= params.hand_at_s:
                return params.hand_from_n
            done = (t_s - params.hand_at_s) / params.hand_duration_s
            if done >= 1.0:
                return params.hand_n
            return params.hand_from_n + done * (params.hand_n - params.hand_from_n)
        if HAND_SINE and params.hand_profile == PROFILE_SINE:
            return params.hand_from_n + params.hand_n * sine(params.hand_hz * t_s)
        if HAND_CHIRP and params.hand_profile == PROFILE_CHIRP:
            swept_s = t_s if t_s < params.hand_duration_s else params.hand_duration_s
            rise_hz = (params.hand_end_hz - params.hand_hz) / params.hand_duration_s
            turns = (params.hand_hz + 0.5 * rise_hz * swept_s) * swept_s + params.hand_end_hz * (t_s - swept_s)
            return params.hand_from_n + params.hand_n * sine(turns)
        if HAND_PRESS and params.hand_profile == PROFILE_PRESS:
            pressed = 0.5 - 0.5 * sine(t_s * params.hand_hz + 0.25)
            return params.hand_from_n + pressed * (params.hand_n - params.hand_from_n)
        if HAND_RECORDED and params.hand_profile == PROFILE_RECORDED:
            return recorded(state, params, buffers, t_s)
    return params.hand_n


def recorded(state: PlantState, params: PlantParams, buffers: Buffers, t_s: float) -> float:
    """A recorded force at a time [N]; times only go forward."""
    last = len(buffers.points_s) - 1
    if params.hand_repeat == 1:
        end_s = buffers.points_s[last]
        t_s = t_s - (t_s // end_s) * end_s
        if t_s < buffers.points_s[state.point_at]:
            state.point_at = 0
    while state.point_at < last and buffers.points_s[state.point_at + 1] <= t_s:
        state.point_at += 1
    at = state.point_at
    from_s = buffers.points_s[at]
    from_n = buffers.points_n[at]
    if at == last or t_s <= from_s:
        return from_n  # type: ignore[no-any-return]
    share = (t_s - from_s) / (buffers.points_s[at + 1] - from_s)
    return from_n + share * (buffers.points_n[at + 1] - from_n)  # type: ignore[no-any-return]


def slide(state: PlantState, params: PlantParams, force_n: float) -> None:
    """One period with Coulomb friction.

    Friction is constant while the device moves one way, so the closed form holds until it stands still. There it
    stays if friction can hold it, and turns back if not.
    """
    x = state.x_m
    v = state.v_m_per_s
    net_n = force_n - params.spring_n_per_m * x
    if params.coulomb_n > 0.0:
        if v == 0.0 and -params.coulomb_n <= net_n <= params.coulomb_n:
            return
        outward = v > 0.0 or (v == 0.0 and net_n > 0.0)
        push_n = net_n - params.coulomb_n if outward else net_n + params.coulomb_n
        end_v = v * params.v_per_v + push_n * params.v_per_f
        if end_v == 0.0 or (end_v > 0.0) != outward or params.half_swing_s <= params.period_s:
            stand_still(state, params, force_n)
            return
        net_n = push_n
    state.x_m = x + (v * params.x_per_v + net_n * params.x_per_f)
    state.v_m_per_s = v * params.v_per_v + net_n * params.v_per_f


def stand_still(state: PlantState, params: PlantParams, force_n: float) -> None:
    """One period of `slide` in which the device comes to rest at least once."""
    left_s = params.period_s
    while left_s > 0.0:
        x = state.x_m
        v = state.v_m_per_s
        net_n = force_n - params.spring_n_per_m * x
        if v == 0.0 and -params.coulomb_n <= net_n <= params.coulomb_n:
            return
        outward = v > 0.0 or (v == 0.0 and net_n > 0.0)
        push_n = net_n - params.coulomb_n if outward else net_n + params.coulomb_n
        push = push_n / params.mass_kg
        v_per_v, v_per_a, x_per_a = flow(params.decay_per_s, params.stiffness_per_s2, left_s)
        end_v = v * v_per_v + push * v_per_a
        stops = end_v == 0.0 or (end_v > 0.0) != outward or params.half_swing_s <= left_s
        t_s = left_s
        if stops and v == 0.0:
            t_s = params.half_swing_s
        elif stops:
            # v(t) has one zero in here: bracketed Newton.
            low_s = 0.0
            high_s = params.half_swing_s if params.half_swing_s < left_s else left_s
            t_s = high_s * 0.5
            if end_v != 0.0 and (end_v > 0.0) != outward:
                t_s = high_s * (v / (v - end_v))
            for _ in range(200):
                v_per_v, v_per_a, x_per_a = flow(params.decay_per_s, params.stiffness_per_s2, t_s)
                at_v = v * v_per_v + push * v_per_a
                if at_v != 0.0 and (at_v > 0.0) == outward:
                    low_s = t_s
                else:
                    high_s = t_s
                slope = push * v_per_v - v * (params.decay_per_s * v_per_v + params.stiffness_per_s2 * v_per_a)
                next_s = 0.5 * (low_s + high_s)
                if slope != 0.0 and low_s < t_s - at_v / slope < high_s:
                    next_s = t_s - at_v / slope
                moved_s = next_s - t_s
                t_s = next_s
                if -1e-15 * high_s <= moved_s <= 1e-15 * high_s:
                    break
        v_per_v, v_per_a, x_per_a = flow(params.decay_per_s, params.stiffness_per_s2, t_s)
        state.x_m = x + (v * v_per_a + push * x_per_a)
        state.v_m_per_s = v * v_per_v + push * v_per_a
        if stops:
            state.v_m_per_s = 0.0
        left_s = left_s - t_s


def flow(decay_per_s: float, stiffness_per_s2: float, t_s: float) -> tuple[float, float, float]:
    """What x'' + a x' + w x = u makes of a start (x, v) in a time t, whatever a and w are.

        v(t) = S' v + S q        x(t) = x + S v + IS q        q = u - w x,  IS = integral of S from 0 to t

    S is the answer to a unit impulse. Its Taylor series over a short enough time, doubled as often as needed, has
    no case distinctions and does not cancel: not for a -> 0 or w -> 0, nor near critical damping.

    Returns:
        S', S [s] and IS [s^2] at t.
    """
    short_s = t_s
    doublings = 0
    while abs(decay_per_s) * short_s > 0.5 or abs(stiffness_per_s2) * short_s * short_s > 0.25:
        short_s = short_s * 0.5
        doublings += 1
    decay = decay_per_s * short_s
    stiffness = stiffness_per_s2 * short_s * short_s
    # S = short_s * (c1 + c2 + ...) with c(n+1) = -decay c(n) / (n+1) - stiffness c(n-1) / (n (n+1))
    before = 0.0
    term = 1.0
    slope = 0.0
    swing = 0.0
    area = 0.0
    for n in range(1, _TERMS):
        slope += n * term
        swing += term
        area += term / (n + 1)
        after = -(decay * term + stiffness * before / n) / (n + 1)
        before = term
        term = after
    swing = swing * short_s
    area = area * short_s * short_s
    for _ in range(doublings):
        rest = 1.0 - stiffness_per_s2 * area
        area = area * (1.0 + slope) + swing * (swing + decay_per_s * area)
        doubled = swing * (rest + slope)
        slope = slope * slope - stiffness_per_s2 * swing * swing
        swing = doubled
    return slope, swing, area


def sine(turns: float) -> float:
    """sin(2 pi turns) from arithmetic alone, so that it is the same everywhere."""
    r = turns - (turns + _ROUND - _ROUND)
    if r > 0.25:
        r = 0.5 - r
    elif r < -0.25:
        r = -0.5 - r
    y = r * _TURN
    z = y * y
    series = -1.0 / 121645100408832000.0 + z / 51090942171709440000.0
    series = 1.0 / 355687428096000.0 + z * series
    series = -1.0 / 1307674368000.0 + z * series
    series = 1.0 / 6227020800.0 + z * series
    series = -1.0 / 39916800.0 + z * series
    series = 1.0 / 362880.0 + z * series
    series = -1.0 / 5040.0 + z * series
    series = 1.0 / 120.0 + z * series
    series = -1.0 / 6.0 + z * series
    return y + y * z * series


def start_state(options: SimulationOptions) -> dict[str, float | int]:
    """Fields of `PlantState` before the first sample is taken."""
    seed = options.seed
    return {
        "x_m": float(options.initial_position_m),
        "v_m_per_s": float(options.initial_velocity_m_per_s),
        "measured_m": 0.0,
        "applied_n": 0.0,
        "lag_n": 0.0,
        "tick": 0,
        "line_at": 0,
        "point_at": 0,
        "noise_a": 1 + seed * 69069 % 2147483562,
        "noise_b": 1 + (seed * 1664525 + 1013904223) % 2147483398,
    }


def epochs(options: SimulationOptions, period_s: float) -> list[tuple[int, dict[str, float | int]]]:
    """The parameters from each change on, as (first tick, fields of `PlantParams`); the first is tick 0.

    Raises:
        ValueError: with Coulomb friction, the spring of the hand swings too fast for the rate.
    """
    values = {
        "mass_kg": options.mass_kg,
        "viscous_n_s_per_m": options.viscous_n_s_per_m,
        "coulomb_n": options.coulomb_n,
        "max_force_n": options.max_force_n,
        "hand_mass_kg": options.hand.mass_kg,
        "hand_damping_n_s_per_m": options.hand.damping_n_s_per_m,
        "hand_stiffness_n_per_m": options.hand.stiffness_n_per_m,
    }
    found: dict[int, dict[str, float | int]] = {0: _params(options, values, period_s)}
    for change in options.changes:
        values.update(change.values())
        found[first_tick(change, period_s)] = _params(options, values, period_s)
    return sorted(found.items())


def first_tick(change: Change, period_s: float) -> int:
    """The first period that starts at or after a change."""
    return max(0, math.ceil(change.at_s / period_s - 1e-6))


def terms(options: SimulationOptions) -> dict[str, bool]:
    """Which switches of this module a device needs on."""
    force = options.hand.force
    timed = not isinstance(force, ConstantForce)
    return {
        "DELAY": options.force_delay_samples > 0,
        "SATURATION": options.max_force_n > 0.0 or any(change.max_force_n for change in options.changes),
        "LAG": options.bandwidth_hz > 0.0,
        "HAND": not (isinstance(force, ConstantForce) and force.newton == 0.0),
        "SPRING": options.hand.stiffness_n_per_m > 0.0 or any(c.hand_stiffness_n_per_m for c in options.changes),
        "FRICTION": options.coulomb_n > 0.0 or any(change.coulomb_n for change in options.changes),
        "NOISE": options.noise_m > 0.0,
        "QUANTISED": options.resolution_m > 0.0,
        "TIMED": timed,
        "HAND_STEP": isinstance(force, StepForce),
        "HAND_RAMP": isinstance(force, RampForce),
        "HAND_SINE": isinstance(force, SineForce),
        "HAND_CHIRP": isinstance(force, ChirpForce),
        "HAND_PRESS": isinstance(force, PressAndReleaseForce),
        "HAND_RECORDED": isinstance(force, RecordedForce),
    }


def delay_line(options: SimulationOptions) -> list[float]:
    """An empty delay line."""
    return [0.0] * (options.force_delay_samples + 1)


def recorded_points(options: SimulationOptions) -> tuple[list[float], list[float]]:
    """Times and forces of a recorded hand; one point at rest for any other."""
    force = options.hand.force
    if not isinstance(force, RecordedForce):
        return [0.0], [0.0]
    return [time_s for time_s, _ in force.points], [newton for _, newton in force.points]


def _params(options: SimulationOptions, values: dict[str, float], period_s: float) -> dict[str, float | int]:
    mass_kg = values["mass_kg"] + values["hand_mass_kg"]
    decay_per_s = (values["viscous_n_s_per_m"] + values["hand_damping_n_s_per_m"]) / mass_kg
    spring_n_per_m = values["hand_stiffness_n_per_m"]
    stiffness_per_s2 = spring_n_per_m / mass_kg
    v_per_v, v_per_a, x_per_a = flow(decay_per_s, stiffness_per_s2, period_s)
    swing_per_s2 = stiffness_per_s2 - 0.25 * decay_per_s * decay_per_s
    half_swing_s = math.pi / math.sqrt(swing_per_s2) if swing_per_s2 > 0.0 else math.inf
    if values["coulomb_n"] > 0.0 and half_swing_s * _SWINGS_PER_PERIOD < period_s:
        raise ValueError(
            f"hand.stiffness_n_per_m = {spring_n_per_m:g}: with Coulomb friction the hand may swing at most "
            f"{_SWINGS_PER_PERIOD / 2:g} times in a period of {period_s:g} s"
        )
    lag_keep = lag_mean = 0.0
    if options.bandwidth_hz > 0.0:
        ratio = 2.0 * math.pi * options.bandwidth_hz * period_s
        lag_keep = math.exp(-ratio)
        lag_mean = -math.expm1(-ratio) / ratio
    return {
        "period_s": period_s,
        "x_per_v": v_per_a,
        "x_per_f": x_per_a / mass_kg,
        "v_per_v": v_per_v,
        "v_per_f": v_per_a / mass_kg,
        "spring_n_per_m": spring_n_per_m,
        "mass_kg": mass_kg,
        "decay_per_s": decay_per_s,
        "stiffness_per_s2": stiffness_per_s2,
        "half_swing_s": half_swing_s,
        "coulomb_n": values["coulomb_n"],
        "limit_n": values["max_force_n"] or math.inf,
        "lag_keep": lag_keep,
        "lag_mean": lag_mean,
        "delay_samples": options.force_delay_samples,
        "resolution_m": options.resolution_m,
        "noise_m": options.noise_m * math.sqrt(3.0),
        **_hand(options),
    }


def _hand(options: SimulationOptions) -> dict[str, float | int]:
    force = options.hand.force
    fields: dict[str, float | int] = {
        "hand_profile": _PROFILES[type(force)],
        "hand_n": 0.0,
        "hand_from_n": 0.0,
        "hand_at_s": 0.0,
        "hand_duration_s": 1.0,
        "hand_hz": 0.0,
        "hand_end_hz": 0.0,
        "hand_repeat": 0,
    }
    if isinstance(force, RecordedForce):
        fields["hand_repeat"] = int(force.repeat)
    else:
        fields["hand_n"] = force.newton
    if isinstance(force, StepForce | RampForce):
        fields |= {"hand_from_n": force.from_newton, "hand_at_s": force.at_s}
    if isinstance(force, RampForce | ChirpForce):
        fields["hand_duration_s"] = force.duration_s
    if isinstance(force, SineForce | ChirpForce):
        fields["hand_from_n"] = force.offset_newton
    if isinstance(force, SineForce):
        fields["hand_hz"] = force.frequency_hz
    if isinstance(force, ChirpForce):
        fields |= {"hand_hz": force.start_hz, "hand_end_hz": force.end_hz}
    if isinstance(force, PressAndReleaseForce):
        fields |= {"hand_from_n": force.release_newton, "hand_hz": 1.0 / force.period_s}
    return fields
