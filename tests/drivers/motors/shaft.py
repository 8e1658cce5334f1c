"""A motor that is not there: a shaft with a drum, a cord, a handle between two stops, and a hand."""

from __future__ import annotations

import math

STEP_S = 50e-6


class Shaft:
    """A rotor and what hangs on its drum.

    Attributes:
        turns, turns_per_s: of the shaft; turn 0 is the middle of the travel.
        hand_n: constant force of the hand on the handle [N].
        grip_n_per_m, grip_n_s_per_m, grip_m: a hand that holds the handle at a place.
        motor: what the motor does with 1 N m: -1 is a reversed one, 0 one without supply.
        travel_m: from the middle to a stop [m].
    """

    def __init__(self, radius_m: float = 0.01, start_m: float = 0.0) -> None:
        self.radius_m = radius_m
        self.rotor_kg_m2 = 4e-6
        self.handle_kg = 0.06
        self.viscous_n_s_per_m = 1.0
        self.coulomb_n = 0.02
        self.travel_m = 0.05
        self.hand_n = 0.0
        self.grip_n_per_m = self.grip_n_s_per_m = self.grip_m = 0.0
        self.motor = 1.0
        self.x_m = start_m
        self.v_m_per_s = 0.0

    @property
    def turns(self) -> float:
        return self.x_m / (2.0 * math.pi * self.radius_m)

    @property
    def turns_per_s(self) -> float:
        return self.v_m_per_s / (2.0 * math.pi * self.radius_m)

    @property
    def mass_kg(self) -> float:
        """Handle and rotor, as a hand feels them [kg]."""
        return self.handle_kg + self.rotor_kg_m2 / self.radius_m**2

    def advance(self, torque_n_m: float, duration_s: float) -> None:
        """Let time pass under a torque."""
        for _ in range(round(duration_s / STEP_S)):
            self._step(self.motor * torque_n_m / self.radius_m)

    def _step(self, motor_n: float) -> None:
        v = self.v_m_per_s
        push_n = motor_n + self.hand_n - self.grip_n_per_m * (self.x_m - self.grip_m) - self.grip_n_s_per_m * v
        if v == 0.0 and abs(push_n) <= self.coulomb_n:
            return
        drag_n = math.copysign(self.coulomb_n, v or push_n) + self.viscous_n_s_per_m * v
        after = v + (push_n - drag_n) / self.mass_kg * STEP_S
        self.v_m_per_s = 0.0 if v * after < 0.0 else after
        self.x_m += self.v_m_per_s * STEP_S
        if abs(self.x_m) > self.travel_m:
            self.x_m = math.copysign(self.travel_m, self.x_m)
            self.v_m_per_s = 0.0
