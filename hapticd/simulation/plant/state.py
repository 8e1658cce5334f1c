"""What a simulated device remembers and what it is given: scalar fields, interpreted or compiled."""

from __future__ import annotations

from typing import Any, NamedTuple


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
        pushed_n: force of actuator and hand over the period that begins, where axes share a mass matrix [N].
    """

    __slots__ = (
        "applied_n",
        "lag_n",
        "line_at",
        "measured_m",
        "noise_a",
        "noise_b",
        "point_at",
        "pushed_n",
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
        delay_samples: periods between command and force.
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
        "method",
        "noise_m",
        "period_s",
        "resolution_m",
        "spring_n_per_m",
        "stiffness_per_s2",
        "substep_s",
        "substeps",
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
