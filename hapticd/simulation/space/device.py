"""A simulated device with two or three axes that advances by exactly one period at a time."""

from __future__ import annotations

from collections.abc import Sequence

from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from hapticd.simulation.space.axes import axis_options
from hapticd.simulation.space.coupled import place_of, swing
from hapticd.simulation.space.masses import masses


class SpatialDevice:
    """The device model of several axes, in the coordinates of the scene.

    Each axis is a one-axis device with its own actuator, sensor, friction and hand. Where the axes share a mass matrix,
    their mechanics go on together, with the matrix of where the device is when the period begins.

    Args:
        options: the model.
        period_s: time between samples [s].

    Attributes:
        axes: the model along each axis.
        masses: of axes that share a mass matrix; None where each goes by itself.
        ticks: periods done.
        measured_m: position as the sensors show it, always the same list [m].

    Raises:
        ValueError: the model cannot be stepped at this rate.
    """

    def __init__(self, options: SimulationOptions, period_s: float) -> None:
        self.options = options
        self.period_s = period_s
        self.ticks = 0
        along = axis_options(options)
        self.masses = masses(options, period_s)
        self.axes = [SimulatedDevice(one, period_s, self.masses is not None) for one in along]
        self.measured_m = [one.measured_m for one in self.axes]

    def advance(self, force_n: Sequence[float]) -> None:
        """One period with these commands held, then a new sample of each position."""
        measured_m = self.measured_m
        axes = self.axes
        if self.masses is None:
            for axis, device in enumerate(axes):
                device.advance(force_n[axis])
                measured_m[axis] = device.measured_m
        else:
            matrices = self.masses
            first, second, third = (device.state for device in axes)
            for axis, device in enumerate(axes):
                device.push(force_n[axis])
            at = place_of(first.x_m, second.x_m, third.x_m, matrices.step_m, *matrices.places)
            swing(first, second, third, matrices.table, at, matrices.springs_n_per_m)
            for axis, device in enumerate(axes):
                device.sense()
                measured_m[axis] = device.measured_m
        self.ticks += 1

    @property
    def position_m(self) -> tuple[float, ...]:
        """True position [m]."""
        return tuple([device.x_m for device in self.axes])

    @property
    def velocity_m_per_s(self) -> tuple[float, ...]:
        """True velocity [m/s]."""
        return tuple([device.v_m_per_s for device in self.axes])
