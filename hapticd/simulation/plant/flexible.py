"""A device whose handle hangs on its motor by a spring and a damper: two masses, exactly over a period.

    m1 x1'' + b x1' = F + k s + c s'               motor: force, viscous friction
    m2 x2'' = F_hand - k_h x2 - b_h x2' - k s - c s'    handle, with the mass of the hand        s = x2 - x1

With its ends free it swings at f: k = (2 pi f)^2 m1 m2 / (m1 + m2), c = 2 zeta 2 pi f m1 m2 / (m1 + m2). The position
of the model is that of the end with the sensor. Between samples the equation is linear, so that a period is a matrix,
the exponential of that of the equation, made before the first one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

Matrix = list[list[float]]

_TERMS = 15  # of the series below: the next one is under 1e-20 of the sum
_STATES = ("x", "v", "s", "q")


@dataclass(frozen=True, slots=True)
class TwoMasses:
    """A flexible device in the hand that holds it.

    Attributes:
        motor_kg: m1.
        handle_kg: m2, with the mass of the hand.
        viscous_n_s_per_m: b.
        spring_n_per_m: k.
        damper_n_s_per_m: c.
        hand_n_per_m: k_h.
        hand_n_s_per_m: b_h.
        at_motor: whether the sensor is there.
    """

    motor_kg: float
    handle_kg: float
    viscous_n_s_per_m: float
    spring_n_per_m: float
    damper_n_s_per_m: float
    hand_n_per_m: float
    hand_n_s_per_m: float
    at_motor: bool

    def equation(self) -> tuple[Matrix, Matrix]:
        """A and B of z' = A z + B u with z = (x, v, s, s') and u = (force of the motor, force of the hand)."""
        spring, damper, viscous = self.spring_n_per_m, self.damper_n_s_per_m, self.viscous_n_s_per_m
        pull, brake = self.hand_n_per_m, self.hand_n_s_per_m
        if self.at_motor:  # x2 = x + s
            motor = [0.0, -viscous, spring, damper, 1.0, 0.0]
            handle = [-pull, -brake, -pull - spring, -brake - damper, 0.0, 1.0]
        else:  # x1 = x - s
            motor = [0.0, -viscous, spring, viscous + damper, 1.0, 0.0]
            handle = [-pull, -brake, -spring, -damper, 0.0, 1.0]
        motor, handle = [one / self.motor_kg for one in motor], [one / self.handle_kg for one in handle]
        stretch = [of_handle - of_motor for of_handle, of_motor in zip(handle, motor, strict=True)]
        sensed = motor if self.at_motor else handle
        rows = [[0.0, 1.0, 0.0, 0.0, 0.0, 0.0], sensed, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0], stretch]
        return [row[:4] for row in rows], [row[4:] for row in rows]


def flexible_fields(device: TwoMasses, period_s: float, late_s: float) -> dict[str, float | int]:
    """The fields of `PlantParams` of a flexible device.

    Args:
        device: the device.
        period_s: time between samples [s].
        late_s: how much of it the force before still acts [s].
    """
    equation, inputs = device.equation()
    grows, gains = held(equation, period_s)
    fields: dict[str, float | int] = {"flexible": 1}
    change = [0.0] * 4
    if late_s > 0.0:
        force = [row[0] for row in inputs]
        first = product(held(equation, late_s)[1], [[one] for one in force])
        rest, _ = held(equation, period_s - late_s)
        change = [one[0] + more[0] for one, more in zip(first, product(rest, first), strict=True)]
    pushed = product(gains, inputs)
    for at, row in enumerate(_STATES):
        for to, column in enumerate(_STATES):
            kept = 1.0 if row == column != "x" else 0.0  # of x what is gained, which is small; of others the whole
            fields[f"{row}_per_{column}"] = grows[at][to] + kept
        fields |= {f"{row}_per_f": pushed[at][0], f"{row}_per_hand": pushed[at][1], f"{row}_per_change": change[at]}
    return fields


def rigid_fields(late_x: float = 0.0, late_v: float = 0.0) -> dict[str, float | int]:
    """The same fields of a device that does not bend.

    Args:
        late_x: `x_per_change`.
        late_v: `v_per_change`.
    """
    fields: dict[str, float | int] = {"flexible": 0}
    for row in _STATES:
        known = ("x", "s", "q", "hand", "change") if row in "xv" else ("x", "v", "s", "q", "f", "hand", "change")
        fields |= {f"{row}_per_{column}": 0.0 for column in known}
    return {**fields, "x_per_change": late_x, "v_per_change": late_v}


def held(equation: Matrix, time_s: float) -> tuple[Matrix, Matrix]:
    """exp(A t) - 1, and the integral of exp(A t) from 0 to t, which takes a constant input to what it does.

    The Taylor series over a short enough time, doubled as often as needed; without the 1 nothing is lost of a motion
    that is slow beside the period.
    """
    unit = (1.0, time_s, 1.0, time_s)
    size = max(
        sum(abs(one) * unit[at] / unit[to] for to, one in enumerate(row)) * time_s for at, row in enumerate(equation)
    )
    doublings = max(0, math.frexp(size)[1] + 2)
    short_s = math.ldexp(time_s, -doublings)
    count = len(equation)
    term = [[short_s if at == to else 0.0 for to in range(count)] for at in range(count)]
    gains = [list(row) for row in term]
    grows = [[0.0] * count for _ in range(count)]
    for n in range(1, _TERMS):
        power = product(equation, term)  # A^n t^n / n!
        grows = _sum(grows, power)
        term = [[one * short_s / (n + 1) for one in row] for row in power]
        gains = _sum(gains, term)
    for _ in range(doublings):
        gains = _sum(_sum(gains, gains), product(grows, gains))
        grows = _sum(_sum(grows, grows), product(grows, grows))
    return grows, gains


def product(left: Sequence[Sequence[float]], right: Sequence[Sequence[float]]) -> Matrix:
    """Of two matrices."""
    columns = list(zip(*right, strict=True))
    return [[sum(a * b for a, b in zip(one, column, strict=True)) for column in columns] for one in left]


def _sum(left: Matrix, right: Matrix) -> Matrix:
    return [[a + b for a, b in zip(one, other, strict=True)] for one, other in zip(left, right, strict=True)]
