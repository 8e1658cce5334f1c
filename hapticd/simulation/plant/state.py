"""What a simulated device remembers and what it is given: scalar fields, interpreted or compiled."""

from __future__ import annotations

from typing import Any, NamedTuple


class PlantState:
    """What changes from period to period.

    Attributes:
        x_m: position relative to the wall, where the sensor is [m].
        v_m_per_s: velocity there [m/s].
        measured_m: what the position sensor shows [m].
        applied_n: force of the actuator over the last period, its mean where it changes within [N].
        lag_n: force at the output of a first-order actuator now [N].
        tick: periods done.
        line_at: where the delay line is written next.
        point_at: point of a recorded hand force that was passed last.
        noise_a, noise_b: the two parts of the noise generator.
        pushed_n: force of actuator and hand over the period that begins, where axes share a mass matrix [N].
        before_n: command that acts until the newest one does, where that is within a period [N].
        change_n: what it had more than the newest one [N].
        stretch_m, stretch_m_per_s: of a flexible device the handle less the motor [m], and its rate [m/s].
    """

    __slots__ = (
        "applied_n",
        "before_n",
        "change_n",
        "lag_n",
        "line_at",
        "measured_m",
        "noise_a",
        "noise_b",
        "point_at",
        "pushed_n",
        "stretch_m",
        "stretch_m_per_s",
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
    pushed_n: float
    before_n: float
    change_n: float
    stretch_m: float
    stretch_m_per_s: float


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
        coupled: 1 where the axis shares a mass matrix with others.
        limit_n: saturation of the actuator [N].
        lag_keep: share of its distance from the command that the actuator keeps over a period.
        lag_mean: mean of that share over the period.
        delay_samples: whole periods between command and force.
        late_s: what is left of the time between them [s].
        late_share: the same over the period.
        x_per_change, v_per_change: what position and velocity gain from a force over that time alone.
        flexible: 1 where a spring lies between motor and handle; the coefficients below are 0 otherwise.
        x_per_x, x_per_s, x_per_q, x_per_hand, v_per_x, v_per_s, v_per_q, v_per_hand: what position and velocity gain
            per position, stretch, its rate and force of the hand.
        s_per_x, s_per_v, s_per_s, s_per_q, s_per_f, s_per_hand, s_per_change: the stretch after a period, per unit.
        q_per_x, q_per_v, q_per_s, q_per_q, q_per_f, q_per_hand, q_per_change: its rate.
        method: integrator, one of the `METHOD_` numbers.
        substeps: steps of it a period.
        substep_s: time of one [s].
        resolution_m: step of the sensor [m].
        noise_m: standard deviation of the sensor noise, times sqrt(3) [m].
        hand_profile: which function of time the hand follows, one of the `PROFILE_` numbers.
        hand_n, hand_from_n, hand_at_s, hand_duration_s, hand_hz, hand_end_hz, hand_repeat: profile of the hand.
    """

    __slots__ = (
        "coulomb_n",
        "coupled",
        "decay_per_s",
        "delay_samples",
        "flexible",
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
        "late_s",
        "late_share",
        "limit_n",
        "mass_kg",
        "method",
        "noise_m",
        "period_s",
        "q_per_change",
        "q_per_f",
        "q_per_hand",
        "q_per_q",
        "q_per_s",
        "q_per_v",
        "q_per_x",
        "resolution_m",
        "s_per_change",
        "s_per_f",
        "s_per_hand",
        "s_per_q",
        "s_per_s",
        "s_per_v",
        "s_per_x",
        "spring_n_per_m",
        "stiffness_per_s2",
        "substep_s",
        "substeps",
        "v_per_change",
        "v_per_f",
        "v_per_hand",
        "v_per_q",
        "v_per_s",
        "v_per_v",
        "v_per_x",
        "x_per_change",
        "x_per_f",
        "x_per_hand",
        "x_per_q",
        "x_per_s",
        "x_per_v",
        "x_per_x",
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
    coupled: int
    limit_n: float
    lag_keep: float
    lag_mean: float
    delay_samples: int
    method: int
    substeps: int
    substep_s: float
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
    flexible: int
    late_s: float
    late_share: float
    x_per_change: float
    v_per_change: float
    x_per_x: float
    x_per_s: float
    x_per_q: float
    x_per_hand: float
    v_per_x: float
    v_per_s: float
    v_per_q: float
    v_per_hand: float
    s_per_x: float
    s_per_v: float
    s_per_s: float
    s_per_q: float
    s_per_f: float
    s_per_hand: float
    s_per_change: float
    q_per_x: float
    q_per_v: float
    q_per_s: float
    q_per_q: float
    q_per_f: float
    q_per_hand: float
    q_per_change: float


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
