"""One period of a device that bends, from the coefficients that `flexible` has made."""

from __future__ import annotations

from hapticd.simulation.plant.state import PlantParams, PlantState

# A term of the model, as those of `step`.
LATE: bool = True


def bend(state: PlantState, params: PlantParams, motor_n: float, hand_n: float) -> None:
    """One period under a force at the motor and one at the handle; `move` adds what a late force has to do with x."""
    x = state.x_m
    v = state.v_m_per_s
    s = state.stretch_m
    q = state.stretch_m_per_s
    state.x_m = x + (
        v * params.x_per_v
        + s * params.x_per_s
        + q * params.x_per_q
        + motor_n * params.x_per_f
        + hand_n * params.x_per_hand
        + x * params.x_per_x
    )
    state.v_m_per_s = (
        v * params.v_per_v
        + s * params.v_per_s
        + q * params.v_per_q
        + motor_n * params.v_per_f
        + hand_n * params.v_per_hand
        + x * params.v_per_x
    )
    state.stretch_m = (
        v * params.s_per_v
        + s * params.s_per_s
        + q * params.s_per_q
        + motor_n * params.s_per_f
        + hand_n * params.s_per_hand
        + x * params.s_per_x
    )
    state.stretch_m_per_s = (
        v * params.q_per_v
        + s * params.q_per_s
        + q * params.q_per_q
        + motor_n * params.q_per_f
        + hand_n * params.q_per_hand
        + x * params.q_per_x
    )
    if LATE:
        state.stretch_m = state.stretch_m + state.change_n * params.s_per_change
        state.stretch_m_per_s = state.stretch_m_per_s + state.change_n * params.q_per_change
