"""Turns to metres and newtons to newton metres, along one axis."""

from __future__ import annotations

import math

from hapticd_drivers.motors.options import DrumOptions


class Drum:
    """A drum on a motor's shaft, with a cord that pulls the handle.

        x = x_home + c (n - n_home)      c = 2 pi r / g       n [turns of the reported shaft]
        tau = F r / g                                         at the same shaft [N m]

    Args:
        options: radius r, gear g and the rest.

    Attributes:
        turn_m: change of position in one turn of the shaft [m]; negative when it turns backwards.
        resolution_m: change of position in one count of the encoder [m].
        max_force_n: largest force at the handle [N].
        homed: it is known where the handle is.
    """

    def __init__(self, options: DrumOptions) -> None:
        self.options = options
        arm_m = options.radius_m / options.gear
        self.turn_m = -2.0 * math.pi * arm_m if options.reversed else 2.0 * math.pi * arm_m
        self.resolution_m = abs(self.turn_m) / options.counts_per_turn
        self.max_force_n = options.max_torque_n_m / arm_m * options.force_scale
        self.homed = False
        pushes = -1.0 if options.reversed is not options.motor_reversed else 1.0
        self._n_m_per_n = pushes * arm_m / options.force_scale
        self._most_n_m = options.max_torque_n_m
        self._zero_m = 0.0

    def put(self, turns: float, position_m: float) -> None:
        """The handle is there when the shaft is here."""
        self._zero_m = position_m - turns * self.turn_m

    def position_m(self, turns: float) -> float:
        """Position of the handle [m]."""
        return self._zero_m + turns * self.turn_m

    def turns(self, position_m: float) -> float:
        """Where the shaft is when the handle is there."""
        return (position_m - self._zero_m) / self.turn_m

    def torque_n_m(self, force_n: float) -> float:
        """What to tell the controller for a force on the handle [N m]."""
        return max(-self._most_n_m, min(self._most_n_m, force_n * self._n_m_per_n))
