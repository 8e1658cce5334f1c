"""What the drivers of motor controllers share: everything but what is said on the bus."""

from __future__ import annotations

import threading
from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar, TypeVar

from hapticd.device import DeviceInfo, Sample
from hapticd.driver import Driver, DriverState
from hapticd.errors import (
    ConfigError,
    DeviceProtocolError,
    DeviceTimeoutError,
    DriverStateError,
)
from hapticd.trace import DriverTrace
from hapticd_drivers.claims import Claims
from hapticd_drivers.motors.crew import RESTARTED_S, Crew, NoWatchdogError
from hapticd_drivers.motors.drum import Drum
from hapticd_drivers.motors.link import BusLink, TracedLink
from hapticd_drivers.motors.metrics import METRICS, TICKS_WITHOUT_STATE
from hapticd_drivers.motors.mover import COUNTS_PER_TURN, MotorMover
from hapticd_drivers.motors.options import MotorOptions, refuse_axes
from hapticd_drivers.rig import motion
from hapticd_drivers.rig.sign import Sign

PATIENCE = 0.25
"""Share of the period for which a tick waits for states that are late."""

SILENCE_S = 0.5
SILENT_TICKS = 20
"""After this time and this many ticks in a row without new states the device counts as lost [s].

By then its force has long gone: its own watchdog has stopped it, and the loop has stopped for a frozen device.
"""

MOST_TURNS = 1e6
"""No shaft has turned so often."""

_NAMES = ("x", "y", "z")

MotorOptionsT = TypeVar("MotorOptionsT", bound=MotorOptions)


class MotorDriver(Driver[MotorOptionsT]):
    """One to three motors behind an adapter; a driver of its own says what is said to them."""

    METRICS = METRICS
    ABSENT = "plug the adapter in, and say in the configuration which motors are behind it"
    NAME: ClassVar[str]
    """What the configuration calls the driver."""

    def __init__(self, options: MotorOptionsT, period_s: float) -> None:
        super().__init__(options, period_s)
        self._crew: Crew | None = None
        self._claims = Claims()
        self.trace = DriverTrace(options.trace)
        self._drums = [Drum(axis) for axis in options.axes]
        self._sample = Sample(len(self._drums))
        self._state_wait_s = PATIENCE * period_s
        self._most_silent = max(SILENT_TICKS, round(SILENCE_S / period_s))
        self._restarted_ticks = round(RESTARTED_S / period_s)
        self._silent = 0
        self._sign = Sign(self.NAME, options.sign_checked)
        self._no_watchdog = ""  # what a calibration has found, until one finds otherwise
        self._lock = threading.Lock()  # a calibration talks to the motors beside the loop

    @classmethod
    def check(cls, options: MotorOptionsT, period_s: float) -> None:
        """Refuse axes that cannot be, and a watchdog that this rate would trip.

        Args:
            options: as the configuration gives them.
            period_s: time between ticks [s].

        Raises:
            ValueError: says which key.
        """
        refuse_axes(options)

    @abstractmethod
    def _connect(self) -> BusLink:
        """Open the adapter.

        Raises:
            DriverError: not found, not permitted or busy.
        """

    @abstractmethod
    def _gather(self, link: BusLink) -> Crew:
        """The motors behind it."""

    @property
    @abstractmethod
    def _host_silence_ms(self) -> float | None:
        """After how long without the host they let go [ms]."""

    def _open(self) -> DeviceInfo:
        link = self._connect()
        if self.options.trace:
            link = TracedLink(link, self.trace)
        self._crew = crew = self._gather(link)
        for axis in self.options.axes:  # before the greeting, which has a motor let go
            self._claims.take(self.NAME, f"motor {axis.id} on {link.where}")
        crew.greet()
        crew.note()
        for drum, motor in zip(self._drums, crew.motors, strict=True):
            options = drum.options
            home_turns = 0.0 if options.homing == "absolute" else motor.home_turns
            drum.homed = home_turns is not None
            if home_turns is not None:
                drum.put(home_turns, options.home_m)
            else:  # it has been switched off perhaps: its middle will do until it is calibrated
                drum.put(motor.turns, 0.5 * (options.lowest_m + options.highest_m))
        self._silent = 0
        self._sample.sequence = 0
        self._accept()
        crew.ask()
        return self._described(crew)

    def _described(self, crew: Crew) -> DeviceInfo:
        options = self.options
        limit_n = min(drum.max_force_n for drum in self._drums)
        max_force_n = limit_n if options.max_force_n is None else options.max_force_n
        if max_force_n > limit_n:
            raise ConfigError(
                f"device.options.max_force_n = {max_force_n:g}: the weakest motor gives {limit_n:.3g} N on its drum"
            )
        return DeviceInfo(
            model=crew.model,
            serial=crew.serial,
            axes=_NAMES[: len(self._drums)],
            max_force_n=max_force_n,
            resolution_m=max(drum.resolution_m for drum in self._drums),
            workspace_m=tuple((drum.options.lowest_m, drum.options.highest_m) for drum in self._drums),
            nominal_rate_hz=1.0 / self.period_s,
            # A damper on the difference of two samples, three samples late, is stable below 0.40 m / T.
            safe_damping_n_s_per_m=0.2 * options.moving_mass_kg / self.period_s,
            host_silence_ms=self._host_silence_ms,
            has_velocity=True,
            has_sequence=True,
        )

    def _enable(self) -> None:
        if not all(drum.homed for drum in self._drums):
            raise DriverStateError(
                f"{self.NAME}: it is not known where the handle is: clear its workspace, then `hapticd calibrate`, "
                "which moves the arm"
            )
        self._sign.demand()
        if self._no_watchdog:
            raise DriverStateError(f"{self._no_watchdog}; then `hapticd calibrate`, which moves the arm")
        with self._lock:
            crew = self._opened()
            crew.enable()
            self.forces_flow = crew.follow()
            self._silent = 0

    def _read(self) -> Sample:
        if not self._lock.acquire(False):
            return self._sample  # a calibration keeps it fresh until it ends
        try:
            crew = self._crew
            assert crew is not None
            fresh = crew.await_states(self._state_wait_s)
            enabled = self.state is _ENABLED
            if enabled:
                problem = crew.problem()
                if problem is not None:
                    raise problem
                if not self.forces_flow:
                    self.forces_flow = crew.follow()
            elif crew.REMEMBERS or self._silent >= self._restarted_ticks:
                for drum, motor in zip(self._drums, crew.motors, strict=True):
                    if motor.home_turns is None:
                        _forget_home(drum)
            if fresh:
                crew.note()
                self._silent = 0
                self._accept()
            else:
                self._bear_silence(crew)
            if not enabled:
                crew.accept_restarts()
                crew.ask()
            return self._sample
        finally:
            self._lock.release()

    def _write(self, force_n: Sequence[float]) -> None:
        crew = self._crew
        assert crew is not None
        crew.push([drum.torque_n_m(newton) for drum, newton in zip(self._drums, force_n, strict=True)])

    def _disable(self) -> None:
        crew = self._crew
        if crew is None:
            return
        if not self._lock.acquire(timeout=1.0):
            raise DeviceTimeoutError(f"{self.NAME}: a calibration that was called off has not ended within 1 s")
        try:
            crew.disable()
        finally:
            self._lock.release()

    def _close(self) -> None:
        crew, self._crew = self._crew, None
        if crew is not None:
            crew.link.close()
        self._claims.release()

    def _accept(self) -> None:
        """Fill the sample in."""
        crew = self._opened()
        sample = self._sample
        position_m, velocity_m_per_s = sample.position_m, sample.velocity_m_per_s
        for index, (drum, motor) in enumerate(zip(self._drums, crew.motors, strict=True)):
            if not (-MOST_TURNS < motor.turns < MOST_TURNS and -MOST_TURNS < motor.turns_per_s < MOST_TURNS):
                raise DeviceProtocolError(
                    f"{self.NAME}: motor controller {motor.address} says that its shaft is at {motor.turns:g} turns, "
                    f"with {motor.turns_per_s:g} turns/s: check its encoder"
                )
            position_m[index] = drum.position_m(motor.turns)
            velocity_m_per_s[index] = drum.turn_m * motor.turns_per_s
        sample.sequence += 1
        sample.calibrated = self._sign.checked and all(drum.homed for drum in self._drums)

    def _bear_silence(self, crew: Crew) -> None:
        self.metrics[TICKS_WITHOUT_STATE] += 1.0
        self._silent += 1
        if self._silent >= self._most_silent:
            raise DeviceTimeoutError(
                f"{self.NAME}: a motor on {crew.link.where} has said nothing for {self._silent} ticks: is it without "
                "power, or its cable out?"
            )

    def _calibrate(self) -> None:
        with self._lock:
            crew = self._opened()
            mover = MotorMover(crew, self._drums, self._accept, lambda: self._called_off, self.period_s)
            if not crew.REMEMBERS:  # one that restarts from here on is noticed only in that the calibration fails
                for drum in self._drums:
                    _forget_home(drum)
            try:
                crew.disable()
                self._mark(crew)
                self._prove_watchdog(crew)
                crew.enable()
                places = [self._calibrate_axis(mover, index) for index in range(len(self._drums))]
            finally:
                crew.disable()
            for drum, place in zip(self._drums, places, strict=True):
                if place is not None:
                    drum.put(*place)
            homes = [
                None if drum.options.homing == "absolute" else drum.turns(drum.options.home_m) for drum in self._drums
            ]
            for drum in self._drums:
                _forget_home(drum)  # if one does not take its home, others may have
            crew.set_home(homes)
            for drum, motor in zip(self._drums, crew.motors, strict=True):
                if motor.home_turns is not None:
                    drum.put(motor.home_turns, drum.options.home_m)
                drum.homed = True
            self._sign.checked = True
            self._accept()
            crew.ask()

    def _prove_watchdog(self, crew: Crew) -> None:
        try:
            crew.prove_watchdog()
        except NoWatchdogError as error:
            self._no_watchdog = str(error)
            raise
        self._no_watchdog = ""

    def _mark(self, crew: Crew) -> None:
        """Have a restart be seen from here on, also of a controller that does not tell."""
        for index, (drum, motor) in enumerate(zip(self._drums, crew.motors, strict=True)):
            if motor.needs_mark:
                at_m = drum.position_m(motor.turns)
                _forget_home(drum)
                drum.put(crew.mark(index), at_m)

    def _calibrate_axis(self, mover: MotorMover, index: int) -> tuple[float, float] | None:
        """Check one axis, and find where the shaft is [turns] when the handle is at some place [m]; None: it knows."""
        drum = self._drums[index]
        options = drum.options
        force_n = min(self.options.calibration_force_n, drum.max_force_n, self.info.max_force_n)
        speed_m_per_s = self.options.calibration_speed_m_per_s
        drive = motion.Drive(
            mover=mover,
            axis=index,
            name=_NAMES[index],
            force_n=force_n,
            speed_m_per_s=speed_m_per_s,
            damping_n_s_per_m=min(0.1 * self.options.moving_mass_kg / self.period_s, 0.2 * force_n / speed_m_per_s),
            count_m=drum.resolution_m,
            span_m=options.highest_m - options.lowest_m,
        )
        self._sign.check(drive)
        if options.homing == "absolute":
            return None
        if options.homing == "here":
            return motion.here(drive) / COUNTS_PER_TURN, options.home_m
        towards = -1.0 if options.homing == "low_stop" else 1.0
        return motion.find_stop(drive, towards) / COUNTS_PER_TURN, _end_m(drum)

    def _opened(self) -> Crew:
        assert self._crew is not None
        return self._crew


def _forget_home(drum: Drum) -> None:
    drum.homed = drum.options.homing == "absolute"


def _end_m(drum: Drum) -> float:
    options = drum.options
    return options.highest_m if options.homing == "high_stop" else options.lowest_m


_ENABLED = DriverState.ENABLED  # Python 3.11 takes 0.1 us to look a member up, each time
