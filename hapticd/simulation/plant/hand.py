"""The force that the hand means to give, as a function of time."""

from __future__ import annotations

from hapticd.simulation.plant.arithmetic import sine
from hapticd.simulation.plant.state import Buffers, PlantParams, PlantState

# Terms of the hand, as those of `step`.
TIMED: bool = True
HAND_STEP: bool = True
HAND_RAMP: bool = True
HAND_SINE: bool = True
HAND_CHIRP: bool = True
HAND_PRESS: bool = True
HAND_RECORDED: bool = True

PROFILE_CONSTANT, PROFILE_STEP, PROFILE_RAMP, PROFILE_SINE, PROFILE_CHIRP, PROFILE_PRESS, PROFILE_RECORDED = range(7)


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
        return from_n  # type: ignore[no-any-return]  # an array has no type for its elements
    share = (t_s - from_s) / (buffers.points_s[at + 1] - from_s)
    return from_n + share * (buffers.points_n[at + 1] - from_n)  # type: ignore[no-any-return]  # an array has no type for its elements
