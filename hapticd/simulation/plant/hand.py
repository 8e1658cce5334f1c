"""The force that the hand means to give, as a function of time."""

from __future__ import annotations

from typing import Any

from hapticd.simulation.options import (
    ChirpForce,
    ConstantForce,
    PressAndReleaseForce,
    RampForce,
    RecordedForce,
    SimulationOptions,
    SineForce,
    StepForce,
)
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


_PROFILES: dict[type[Any], int] = {
    ConstantForce: PROFILE_CONSTANT,
    StepForce: PROFILE_STEP,
    RampForce: PROFILE_RAMP,
    SineForce: PROFILE_SINE,
    ChirpForce: PROFILE_CHIRP,
    PressAndReleaseForce: PROFILE_PRESS,
    RecordedForce: PROFILE_RECORDED,
}


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


def recorded_points(options: SimulationOptions) -> tuple[list[float], list[float]]:
    """Times and forces of a recorded hand; one point at rest for any other."""
    force = options.hand.force
    if not isinstance(force, RecordedForce):
        return [0.0], [0.0]
    return [time_s for time_s, _ in force.points], [newton for _, newton in force.points]


def hand_terms(options: SimulationOptions) -> dict[str, bool]:
    """Which switches a hand needs on."""
    force = options.hand.force
    return {
        "HAND": not (isinstance(force, ConstantForce) and force.newton == 0.0),
        "TIMED": not isinstance(force, ConstantForce),
        "HAND_STEP": isinstance(force, StepForce),
        "HAND_RAMP": isinstance(force, RampForce),
        "HAND_SINE": isinstance(force, SineForce),
        "HAND_CHIRP": isinstance(force, ChirpForce),
        "HAND_PRESS": isinstance(force, PressAndReleaseForce),
        "HAND_RECORDED": isinstance(force, RecordedForce),
    }


def hand_fields(options: SimulationOptions) -> dict[str, float | int]:
    """The fields of `PlantParams` that say what the hand does."""
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
