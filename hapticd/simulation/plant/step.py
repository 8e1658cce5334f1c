"""One period of the mechanics, and the sample after it.

F and F_hand are held over a period (zero-order hold), so between samples the equation is linear with constant
input and has a closed form. A sampled wall changes its force at samples only; contact is no event here. Coulomb
friction is one: the instant of standstill is found inside the period, and the device then stays or turns back.
"""

from __future__ import annotations

from hapticd.simulation.plant.arithmetic import ROUND
from hapticd.simulation.plant.bend import bend
from hapticd.simulation.plant.hand import hand_force
from hapticd.simulation.plant.hold import flow
from hapticd.simulation.plant.state import Buffers, PlantParams, PlantState
from hapticd.simulation.plant.stepped import METHOD_EXACT, stepped

# Terms of the model. All on is the full model; `coefficients.terms` says which ones a device needs.
DELAY: bool = True
LATE: bool = True
FLEXIBLE: bool = True
SATURATION: bool = True
LAG: bool = True
HAND: bool = True
SPRING: bool = True
FRICTION: bool = True
NOISE: bool = True
QUANTISED: bool = True
STEPPED: bool = True
TIMED: bool = True
COUPLED: bool = True


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
    if LATE:
        state.change_n = state.before_n - f
        state.before_n = f
        state.applied_n = f + state.change_n * params.late_share
    if FLEXIBLE:
        motor_n = f
    if HAND:
        f = f + hand_force(state, params, buffers)
    if COUPLED and params.coupled == 1:
        state.pushed_n = f  # several axes go on together: `space.coupled`
    elif STEPPED and params.method != METHOD_EXACT:
        stepped(state, params, f)
    elif FLEXIBLE and params.flexible == 1:
        bend(state, params, motor_n, f - motor_n)
    elif FRICTION:
        if LATE and params.late_s > 0.0 and params.coulomb_n > 0.0:
            stand_still(state, params, f + state.change_n, params.late_s)
            stand_still(state, params, f, params.period_s - params.late_s)
        else:
            slide(state, params, f)
    else:
        if SPRING:
            f = f - params.spring_n_per_m * state.x_m
        v = state.v_m_per_s
        state.x_m = state.x_m + (v * params.x_per_v + f * params.x_per_f)
        state.v_m_per_s = v * params.v_per_v + f * params.v_per_f
    if LATE:
        # Until the newest force acts, the one before does; the equation is linear, so what it has more comes on top.
        state.x_m = state.x_m + state.change_n * params.x_per_change
        state.v_m_per_s = state.v_m_per_s + state.change_n * params.v_per_change
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
        x_m = (x_m / params.resolution_m + ROUND - ROUND) * params.resolution_m
    state.measured_m = x_m


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
            stand_still(state, params, force_n, params.period_s)
            return
        net_n = push_n
    state.x_m = x + (v * params.x_per_v + net_n * params.x_per_f)
    state.v_m_per_s = v * params.v_per_v + net_n * params.v_per_f


def stand_still(state: PlantState, params: PlantParams, force_n: float, left_s: float) -> None:
    """`slide` over any time, in which the device may come to rest more than once."""
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
        # From a standstill only a swing comes to the next one; without one an end speed of 0 has been rounded away.
        stops = params.half_swing_s <= left_s
        if v != 0.0:
            stops = stops or end_v == 0.0 or (end_v > 0.0) != outward
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
        if stops or (state.v_m_per_s > 0.0) != outward:  # rounding may turn what has come to rest around
            state.v_m_per_s = 0.0
        left_s = left_s - t_s
