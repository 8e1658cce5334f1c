"""A simulated one-axis device that advances by exactly one period at a time."""

from __future__ import annotations

import math

from hapticd.simulation.compiler.specialise import specialise
from hapticd.simulation.options import SimulationOptions
from hapticd.simulation.plant.coefficients import delay_line, epochs, recorded_points, start_state, terms
from hapticd.simulation.plant.state import Buffers, PlantParams, PlantState
from hapticd.simulation.plant.step import move, sense


class SimulatedDevice:
    """The device model behind the loopback driver and the studies.

    Coordinates: x relative to the first wall, outward positive; force on the device along the same direction.

    Args:
        options: the model.
        period_s: time between samples [s].
        coupled: it is an axis of a device whose axes share a mass matrix: `push`, the step of all, `sense`.

    Attributes:
        ticks: periods done.
        state: its position, velocity, actuator and sensor.
        params: its coefficients now.
        buffers: its delay line, and a recorded hand.

    Raises:
        ValueError: the model cannot be stepped at this rate.
    """

    def __init__(self, options: SimulationOptions, period_s: float, coupled: bool = False) -> None:
        self.options = options
        self.period_s = period_s
        self.ticks = 0
        switches = terms(options, coupled)
        self._move = specialise(move, switches)
        self._sense = specialise(sense, switches)
        self.state = PlantState()
        for name, value in start_state(options).items():
            setattr(self.state, name, value)
        self._coming: list[tuple[float, PlantParams]] = []
        for tick, fields in epochs(options, period_s, coupled):
            params = PlantParams()
            for name, value in fields.items():
                setattr(params, name, value)
            self._coming.append((tick, params))
        self._coming.reverse()
        self.buffers = Buffers(delay_line(options, period_s), *recorded_points(options))
        self.params = self._coming.pop()[1]
        self._next_change = self._coming[-1][0] if self._coming else math.inf
        self._sense(self.state, self.params)

    def advance(self, force_n: float) -> None:
        """One period with this command held, then a new sample of the position."""
        if self.ticks >= self._next_change:
            self.params = self._coming.pop()[1]
            self._next_change = self._coming[-1][0] if self._coming else math.inf
        self._move(self.state, self.params, self.buffers, force_n)
        self._sense(self.state, self.params)
        self.ticks += 1

    def push(self, force_n: float) -> None:
        """Take the command of a period in; the mechanics go on with those of the other axes."""
        self._move(self.state, self.params, self.buffers, force_n)

    def sense(self) -> None:
        """Take the sample at the end of that period."""
        self._sense(self.state, self.params)
        self.ticks += 1

    @property
    def changing(self) -> bool:
        """Whether the device is another at a later time."""
        return bool(self._coming)

    @property
    def x_m(self) -> float:
        """True position [m]."""
        return self.state.x_m

    @property
    def v_m_per_s(self) -> float:
        """True velocity [m/s]."""
        return self.state.v_m_per_s

    @property
    def measured_m(self) -> float:
        """Position as the sensor shows it [m]."""
        return self.state.measured_m

    @property
    def applied_n(self) -> float:
        """Force of the actuator over the last period, after delay, saturation and lag [N]."""
        return self.state.applied_n
