"""A simulated device behind the driver's contract: the model that the studies use, one period a tick."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import ClassVar

from hapticd.device import DeviceInfo, Sample
from hapticd.driver import Driver
from hapticd.errors import DeviceFaultError, DeviceProtocolError, DriverStateError
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import FARTHEST_M, SimulationOptions
from hapticd.simulation.plant import epochs
from hapticd.simulation.space.axes import AXES, axis_options
from hapticd.simulation.space.device import SpatialDevice
from hapticd.simulation.space.masses import masses

MOST_CATCH_UP_S = 1.0
"""clock = "wall": a host that was stopped for longer makes up for this much [s]."""


class SimulatedDriver(Driver[SimulationOptions]):
    """Base of every driver of a simulated device; `loopback` is one as it stands.

    With `clock = "ticks"` every read but the first advances the model by one period, with the force written
    last, so that results do not depend on the host's scheduling; device time counts the same periods.

    Attributes:
        make_model: makes the device model at `open`; a study may put another one in.
    """

    Options = SimulationOptions
    NAME: ClassVar[str] = "simulated"
    """How it names itself, before the name of its model."""

    def __init__(self, options: SimulationOptions, period_s: float) -> None:
        super().__init__(options, period_s)
        self._wall_m = 0.0
        self._outward = 1.0
        self._period_ns = round(period_s * 1e9)
        self._now_ns = time.monotonic_ns
        self._sample = Sample(options.axes)
        self._space: SpatialDevice | None = None
        self._by_ticks = options.clock == "ticks"
        self.make_model: Callable[[SimulationOptions, float], SimulatedDevice] = SimulatedDevice
        self._model: SimulatedDevice | None = None
        self._force_n = 0.0
        self._forces_n = [0.0] * options.axes
        self._first = True
        self._started_ns = 0

    @classmethod
    def check(cls, options: SimulationOptions, period_s: float) -> None:
        """Refuse what a step of this length cannot hold."""
        if options.axes == 1:
            epochs(options, period_s)
            return
        coupled = masses(options, period_s) is not None
        for one in axis_options(options):
            epochs(one, period_s, coupled)

    @property
    def model(self) -> SimulatedDevice:
        """The device model, whose true position no sample tells.

        Raises:
            DriverStateError: the driver is not open.
        """
        if self._model is None:
            raise DriverStateError("the device is not open")
        return self._model

    @property
    def space(self) -> SpatialDevice | None:
        """The device model of several axes; None for one with a single axis, or while the driver is closed."""
        return self._space

    def place(self, wall_m: float, outward: int) -> None:
        """Start relative to this wall, where there is one axis; several have their place in the scene."""
        self._wall_m = wall_m
        self._outward = float(outward)

    def _open(self) -> DeviceInfo:
        options = self.options
        try:
            if options.axes > 1:
                self._space = SpatialDevice(options, self.period_s)
            else:
                self._model = self.make_model(options, self.period_s)
        except ValueError as error:
            raise DeviceProtocolError(f"device.options.{error}") from error
        self._force_n = 0.0
        self._forces_n = [0.0] * options.axes
        self._first = True
        along = axis_options(options) if options.axes > 1 else [options]
        return DeviceInfo(
            model=f"{self.NAME} ({options.model} model)",
            serial="",
            axes=AXES[: options.axes],
            max_force_n=min([one.largest_force_n for one in along]),
            resolution_m=max([one.resolution_m for one in along]),
            workspace_m=((self._wall_m - FARTHEST_M, self._wall_m + FARTHEST_M),) * options.axes,
            nominal_rate_hz=1.0 / self.period_s,
            safe_damping_n_s_per_m=min([_safe_damping(one, self.period_s) for one in along]),
            host_silence_ms=0.0,
            simulated=True,
            start_m=tuple(self._space.measured_m) if self._space is not None and options.axes == 3 else (),
            has_clock=True,
            has_sequence=True,
        )

    def _enable(self) -> None:
        self._drop()

    def _read(self) -> Sample:
        device = self._model
        if device is None:
            return self._read_space()
        if self._first:
            self._first = False
            self._started_ns = self._now_ns()
        elif self._by_ticks:
            device.advance(self._force_n)
        else:
            self._catch_up(device)
        x_m = device.measured_m
        if not -FARTHEST_M < x_m < FARTHEST_M:
            raise DeviceFaultError(f"the model has diverged after {device.ticks * self.period_s:g} s")
        sample = self._sample
        sample.position_m[0] = self._wall_m + self._outward * x_m
        sample.time_ns = device.ticks * self._period_ns
        sample.sequence = device.ticks
        return sample

    def _read_space(self) -> Sample:
        device = self._space
        assert device is not None
        if self._first:
            self._first = False
        else:
            device.advance(self._forces_n)
        sample = self._sample
        for axis, x_m in enumerate(device.measured_m):
            if not -FARTHEST_M < x_m < FARTHEST_M:
                raise DeviceFaultError(f"the model has diverged after {device.ticks * self.period_s:g} s")
            sample.position_m[axis] = x_m
        sample.time_ns = device.ticks * self._period_ns
        sample.sequence = device.ticks
        return sample

    def _write(self, force_n: Sequence[float]) -> None:
        if self._space is not None:
            self._forces_n[:] = force_n
            return
        self._force_n = self._outward * force_n[0]

    def _disable(self) -> None:
        self._drop()

    def _close(self) -> None:
        self._model = self._space = None

    def _drop(self) -> None:
        self._force_n = 0.0
        self._forces_n = [0.0] * self.options.axes

    def _catch_up(self, device: SimulatedDevice) -> None:
        due = (self._now_ns() - self._started_ns) // self._period_ns
        most = max(1, round(MOST_CATCH_UP_S / self.period_s))
        if due - device.ticks > most:
            self._started_ns += (due - device.ticks - most) * self._period_ns
            due = device.ticks + most
        while device.ticks < due:
            device.advance(self._force_n)


def _safe_damping(options: SimulationOptions, period_s: float) -> float:
    """Digital damping that holds the bare device: about half of what would shake it, or less.

    A damper on the difference of two samples is stable below 2, 0.83, 0.54, 0.40 m / T with 0, 1, 2, 3 samples of
    delay; 0.75 / (1 + delay) stays under half of each, and 0.41 m / T under half of the second, should one sample of
    delay be there undeclared. A slow actuator counts as delay. The hand is left out: it may let go.

    Of a flexible device the motor alone counts, which a stiff damper holds while the handle swings; and it bears no
    more than half of what its own swing loses where the damper may drive that swing: with the sensor at the handle,
    which then moves against the motor, or where the damper lags an eighth of a swing.
    """
    delay = options.force_delay_samples + options.force_delay_s / period_s
    if options.bandwidth_hz > 0.0:
        delay += 1.0 / (2.0 * math.pi * options.bandwidth_hz * period_s)
    mass_kg = min([options.mass_kg, *(change.mass_kg for change in options.changes if change.mass_kg is not None)])
    safe = min(0.41, 0.75 / (1.0 + delay)) * mass_kg / period_s
    flexible = options.flexible
    if flexible is None:
        return safe
    share = flexible.handle_share
    safe *= 1.0 - share
    turns = flexible.frequency_hz * period_s * (1.0 + delay)
    if flexible.sensor == "motor" and turns <= 0.125:
        return safe
    # Per speed of the motor its own swing loses c / r^2, and a damper on the handle's speed gives it B (1 - r) / r.
    _, damper = flexible.spring(mass_kg)
    return min(safe, 0.5 * damper / (share * (share if flexible.sensor == "motor" else 1.0 - share)))
