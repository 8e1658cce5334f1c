"""moteus controllers on a bus: one frame to each and one back in every tick."""

from __future__ import annotations

import math
import time

from hapticd.errors import ConfigError, DeviceFaultError, DeviceProtocolError, DriverError
from hapticd_drivers.moteus import registers
from hapticd_drivers.moteus.faults import stopped_text
from hapticd_drivers.moteus.registers import (
    ANSWER,
    BRAKE,
    FAULT,
    FAULTED,
    FIRMWARE,
    HOME_AT_OUTPUT,
    HOME_AT_ROTOR,
    HOME_STATE,
    MILLISECONDS,
    MODE,
    POSITION,
    POSITION_MODE,
    PREPARING,
    SERIAL,
    STOPPED,
    TEMPERATURE,
    TIMED_OUT,
    TORQUE,
    VELOCITY,
    VOLTAGE,
    VOLTS,
)
from hapticd_drivers.motors.crew import GREETING_PATIENCE_S, Crew, Metered, Motor, NoWatchdogError
from hapticd_drivers.motors.drum import Drum
from hapticd_drivers.motors.link import BusLink

_BACKWARDS = 0x80000000  # of a difference of two counts of milliseconds, which wrap after 49 days
_LOOK_S = 0.005
_WITHOUT_FORCE = (STOPPED, FAULTED, BRAKE)

LEAST_MARK = 64.0
MARK_TRAVELS = 8.0
"""hapticd sets a home at this many turns at least, and at this many times the travel [turns].

A controller that is switched on counts from within half a turn of 0, whatever it says of its home: no travel leads from
there to the mark, so that who counts from it was told by hapticd.
"""

NO_HOME = 0.5
"""This share of the turns of a home is where one that counts no milliseconds counts from while home is looked for."""

AT_ONCE_S = 0.005
"""What a controller has said of its place says where home is for this time, since the handle may move [s]."""

PREPARING_S = 0.3
"""For this time after it was enabled a controller may get ready, in which it gives no torque [s]."""


class MoteusMotor(Motor):
    """What is known of a controller and its motor.

    Args:
        drum: on its shaft.

    Attributes:
        restarted: it was switched off and on after the driver last looked whether it knows its home.
        most_n_m: torque that it may apply [N m].
        absolute: it is to know by itself where it is: turn 0 is home.
        mark_turns: where it counts a home that it is told, forwards or backwards from 0 [turns].
        places: where it counts from as it was told; elsewhere it has restarted. Empty: that is not known [turns].
        has_counter: it counts milliseconds, so that a restart shows.
        follows: it has followed torques since it was enabled.
        mode, fault, home_state: its registers.
        firmware, serial: what it is; "" until it has said so.
    """

    __slots__ = (
        "absolute",
        "fault",
        "firmware",
        "follows",
        "has_counter",
        "home_state",
        "mark_turns",
        "milliseconds",
        "mode",
        "most_n_m",
        "places",
        "restarted",
        "serial",
    )

    def __init__(self, drum: Drum) -> None:
        super().__init__(drum.options.id)
        self.most_n_m = drum.options.max_torque_n_m
        self.absolute = drum.options.homing == "absolute"
        self.mark_turns = LEAST_MARK
        while self.mark_turns < MARK_TRAVELS * drum.options.most_turns:
            self.mark_turns *= 2.0  # a float has them all
        self.mode = STOPPED
        self.fault = 0
        self.home_state = 0
        self.milliseconds = 0
        self.places: tuple[float, ...] = ()
        self.has_counter = False
        self.restarted = False
        self.follows = False
        self.firmware = ""
        self.serial = ""

    @property
    def home_turns(self) -> float | None:
        """Where it counts the home that it was told by hapticd [turns]; None: it has none, or lost it."""
        mark_turns = math.copysign(self.mark_turns, self.turns)
        return mark_turns if self.counts_from(mark_turns) else None

    @property
    def needs_mark(self) -> bool:
        """Whether only a place that it is told can show that its controller restarts."""
        return not self.has_counter and not self.absolute  # that counts from the same place afterwards

    def counts_from(self, place_turns: float) -> bool:
        """Whether it was told a place near which it is [turns]."""
        return self.home_state == HOME_AT_OUTPUT and abs(self.turns - place_turns) < 0.25 * self.mark_turns


class MoteusCrew(Crew):
    """The controllers on a bus.

    Args:
        link: the adapter.
        meter: keeps the metrics.
        name: of the driver.
        motors: what is behind it, in the order of the axes.
        watchdog_s: goes with every torque [s].
        brake: short the windings to let go, and not just take the current away.
    """

    REMEMBERS = True

    def __init__(
        self,
        link: BusLink,
        meter: Metered,
        name: str,
        motors: list[MoteusMotor],
        watchdog_s: float,
        brake: bool,
    ) -> None:
        super().__init__(link, meter, name)
        self._motors = motors
        self._by_identifier = {motor.address << 8: motor for motor in motors}
        self._watchdog_s = watchdog_s
        self._let_go = registers.SHORTED if brake else registers.STOP
        self._letting_go = False  # to have let go, none needs to know where it is
        self._enabled_ns = 0

    @property
    def motors(self) -> list[Motor]:
        """The motors, in the order of the axes."""
        return list[Motor](self._motors)

    def greet(self) -> None:
        """Learn that all are there, what they are and where, without force."""
        motors = self._motors
        self._have_let_go(urgent=False)
        self._say_until(lambda index: self._send(index, registers.IDENTITY), lambda index: bool(motors[index].serial))
        self._say_until(lambda index: self._send(index, registers.QUERY), lambda index: motors[index].heard)
        self.model = f"moteus (firmware {motors[0].firmware})"
        self.serial = " ".join(motor.serial for motor in motors)
        misplaced = self._misplaced()
        if misplaced:
            raise ConfigError(misplaced)
        self.accept_restarts()

    def enable(self) -> None:
        """Clear faults whose cause is gone, and have all follow a torque of 0.

        One that was switched off and on since it was last looked at may count from elsewhere, and is refused.
        """
        self._say_until(
            lambda index: self._send(index, registers.STOP),
            lambda index: self._motors[index].heard and self._motors[index].mode == STOPPED,
            urgent=True,
        )
        for motor in self._motors:
            if motor.restarted:
                raise self._has_restarted(motor)
        misplaced = self._misplaced()
        if misplaced:
            raise DeviceFaultError(f"{self._name}: {misplaced}")
        for motor in self._motors:
            motor.follows = False
        self._enabled_ns = time.monotonic_ns()
        self._say_until(self._send_no_torque, self._follows, urgent=True)

    def accept_restarts(self) -> None:
        """Forget who was switched off and on: the driver has looked whether all still know their home."""
        for motor in self._motors:
            motor.restarted = False
            if not motor.has_counter:
                home_turns = motor.home_turns
                motor.places = () if home_turns is None else (home_turns,)

    def disable(self) -> None:
        """Let go, until all have said that they have."""
        self._have_let_go(urgent=True)

    def ask(self) -> None:
        """Ask for the states."""
        for index in range(len(self._motors)):
            self._send(index, registers.QUERY)
        self._sent_ns = time.monotonic_ns()

    def push(self, torque_n_m: list[float]) -> None:
        """Set the torques, and ask for the states."""
        for motor, newton_metre in zip(self._motors, torque_n_m, strict=True):
            self.link.send(ANSWER | motor.address, registers.torque(newton_metre, motor.most_n_m, self._watchdog_s))
        self._sent_ns = time.monotonic_ns()

    def problem(self) -> DriverError | None:
        """Why a controller follows no torque."""
        for motor in self._motors:
            if motor.restarted:  # it has followed the next torque at once, and its turns may count from elsewhere
                return self._has_restarted(motor)
            if motor.mode != POSITION_MODE:
                if (
                    motor.mode in PREPARING
                    and not motor.follows
                    and time.monotonic_ns() - self._enabled_ns < PREPARING_S * 1e9
                ):
                    continue
                return DeviceFaultError(
                    f"{self._name}: controller {motor.address} has let go: "
                    f"{stopped_text(motor.mode, motor.fault, 1e3 * self._watchdog_s)}"
                )
        return None

    def follow(self) -> bool:
        """Whether none gets ready any more."""
        return all(motor.follows for motor in self._motors)

    def set_home(self, turns: list[float | None]) -> None:
        """Tell each its home, which it remembers until it is switched off.

        Each counts it at the other one of its two marks then, which shows that it has taken this one and not kept an
        older one.
        """
        for index, (motor, home) in enumerate(zip(self._motors, turns, strict=True)):
            if home is not None:
                self._tell(index, home, math.copysign(motor.mark_turns, -motor.turns))

    def mark(self, index: int) -> float:
        """Have one that counts no milliseconds count from a place that it does not get to by itself, and is no home."""
        motor = self._motors[index]
        mark_turns = math.copysign(NO_HOME * motor.mark_turns, -motor.turns)
        self._tell(index, motor.turns, mark_turns)
        return mark_turns

    def prove_watchdog(self) -> None:
        """Command nothing while a torque of 0 holds; questions feed no watchdog."""
        self.enable()
        end_s = time.monotonic() + 2.0 * self._watchdog_s + PREPARING_S
        while not all(motor.mode == TIMED_OUT for motor in self._motors):
            if time.monotonic() > end_s:
                raise NoWatchdogError(
                    f"{self._name}: a controller on {self.link.where} goes on without a command for "
                    f"{1e3 * self._watchdog_s:g} ms: update its firmware"
                )
            self.ask()
            self.await_states(_LOOK_S)
            self.note()

    def _tell(self, index: int, turns: float, place_turns: float) -> None:
        """Have one count what is at some turns now at a place where it counts nothing yet."""
        motor = self._motors[index]
        if motor.places:
            motor.places = (*motor.places, place_turns)
        states, end_s = motor.states, time.monotonic() + GREETING_PATIENCE_S
        while not motor.counts_from(place_turns):
            if time.monotonic() > end_s:
                if motor.states == states:
                    raise self._silent([index], GREETING_PATIENCE_S)
                raise DeviceProtocolError(f"{self._name}: controller {motor.address} has not taken its home")
            where = self._says(index, registers.QUERY)  # the handle may have moved since
            if motor.restarted:
                raise self._has_restarted(motor)
            if where and not motor.counts_from(place_turns):
                self._says(index, registers.here_is(motor.turns - turns + place_turns))
        motor.places = (place_turns,)

    def _says(self, index: int, data: bytes) -> bool:
        """Whether one answers at once; its state is new then."""
        self.link.receive()  # what was said before is no answer
        for motor in self._motors:
            motor.heard = motor is not self._motors[index]
        end_s = time.monotonic() + AT_ONCE_S
        self._send(index, data)
        return self.await_states(AT_ONCE_S) and time.monotonic() < end_s

    def _misplaced(self) -> str:
        """Which axis is to know by itself where it is and does not, and what to do; "" when there is none."""
        for index, motor in enumerate(self._motors):
            if not motor.absolute:
                continue
            where = f'device.options.axes[{index}].homing = "absolute": controller {motor.address}'
            if motor.home_turns is not None:
                return f"{where} counts from a home that it was told: switch it off and on"
            if motor.home_state not in (HOME_AT_ROTOR, HOME_AT_OUTPUT):
                return (
                    f"{where} does not know where its shaft is (HOME_STATE {motor.home_state}): take another homing, "
                    "or an encoder that knows"
                )
        return ""

    def _has_restarted(self, motor: MoteusMotor) -> DeviceFaultError:
        return DeviceFaultError(
            f"{self._name}: controller {motor.address} was switched off and on: check its supply and plugs"
        )

    def _have_let_go(self, urgent: bool) -> None:
        self._letting_go = True
        try:
            self._say_until(
                lambda index: self._send(index, self._let_go),
                lambda index: self._motors[index].heard and self._motors[index].mode in _WITHOUT_FORCE,
                urgent,
            )
        finally:
            self._letting_go = False

    def _send_no_torque(self, index: int) -> None:
        self._send(index, registers.torque(0.0, self._motors[index].most_n_m, self._watchdog_s))

    def _follows(self, index: int) -> bool:
        motor = self._motors[index]
        return motor.heard and (motor.mode == POSITION_MODE or motor.mode in PREPARING)

    def _send(self, index: int, data: bytes) -> None:
        self.link.send(ANSWER | self._motors[index].address, data)

    def _take(self, identifier: int, data: bytes) -> bool:
        motor = self._by_identifier.get(identifier)
        if motor is None:
            return False
        found = registers.answers(data)
        if found is None:
            return False
        try:
            if POSITION in found:
                motor.turns = found[POSITION]
                motor.turns_per_s = found[VELOCITY]
                motor.torque_n_m = found[TORQUE]
                motor.mode = int(found[MODE])
                if motor.mode == POSITION_MODE:
                    motor.follows = True
                motor.voltage_v = VOLTS * found[VOLTAGE]
                motor.temperature_c = found[TEMPERATURE]
                motor.fault = int(found[FAULT])
                motor.home_state = int(found[HOME_STATE])
                motor.has_counter = MILLISECONDS in found  # older firmware has none
                if motor.has_counter:
                    milliseconds = int(found[MILLISECONDS])
                    if milliseconds - motor.milliseconds & _BACKWARDS:
                        motor.restarted = True
                    motor.milliseconds = milliseconds
                elif motor.places and not any(map(motor.counts_from, motor.places)):
                    motor.restarted = True
                motor.states += 1
                motor.heard = True
            if SERIAL in found:
                words = (int(found[SERIAL + word]) & 0xFFFFFFFF for word in range(3))
                motor.serial = "-".join(f"{word:08x}" for word in words)
                motor.firmware = f"{int(found[FIRMWARE]):x}"
        except (KeyError, ValueError):  # half of what was asked for, or not a number where there is always one
            return False
        if math.isnan(motor.turns) and not self._letting_go:
            raise DeviceProtocolError(
                f"{self._name}: controller {motor.address} does not know where its shaft is: check its encoder (tview)"
            )
        return True
