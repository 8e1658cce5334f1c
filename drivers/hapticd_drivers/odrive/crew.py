"""ODrives on a bus: a torque to each in every tick, and what they send by themselves."""

from __future__ import annotations

import struct
import time

from hapticd.errors import DeviceFaultError, DeviceProtocolError, DeviceTimeoutError, DriverError
from hapticd_drivers.motors.crew import GREETING_PATIENCE_S, Crew, Metered, Motor, NoWatchdogError
from hapticd_drivers.motors.link import BusLink
from hapticd_drivers.odrive import cansimple
from hapticd_drivers.odrive.cansimple import (
    BUS,
    CLEAR_ERRORS,
    CLOSED_LOOP,
    ERRORS,
    ESTIMATES,
    HEARTBEAT,
    IDLE,
    SET_MODE,
    SET_STATE,
    SET_TORQUE,
    TEMPERATURES,
    TORQUES,
    VERSION,
    WATCHDOG_EXPIRED,
)
from hapticd_drivers.odrive.faults import errors_text

HEARTBEAT_S = 0.05
"""An ODrive without a heartbeat for this time has lost its power or its cable [s]."""

LOOKED_S = 0.3
LEAST_BEATS = 6
_LOOK_S = 0.001
"""This many heartbeats have to come in this time: what a loop waits for is seen in them [s]."""

OBEYS_S = 0.1
"""An ODrive that was enabled says within this time that it follows [s]; until then it may not, and gives no torque."""

WATCHDOG_MARGIN = 1.5
"""A watchdog has to act within this many times its own time and 2 `HEARTBEAT_S`, when a calibration tries it.

By a computer that is busy no less can be told: heartbeats say that it has acted, not when.
"""


class OdriveMotor(Motor):
    """What is known of an ODrive and its motor.

    Attributes:
        state: its axis state; IDLE before the first heartbeat.
        error, reason: its active errors, and why it let go last.
        beats: heartbeats that have come.
        beat_ns: when the last of them came.
        follows: it has followed torques since it was enabled.
        version: hardware and firmware, "" when it has not said so.
    """

    __slots__ = ("beat_ns", "beats", "error", "follows", "reason", "state", "version")

    def __init__(self, address: int) -> None:
        super().__init__(address)
        self.state = IDLE
        self.error = 0
        self.reason = 0
        self.beats = 0
        self.beat_ns = 0
        self.follows = False
        self.version = ""


class OdriveCrew(Crew):
    """The ODrives on a bus.

    Args:
        link: the adapter.
        meter: keeps the metrics.
        name: of the driver.
        addresses: one a motor.
        watchdog_s: of each, as it was set up [s]; None when it has none.
    """

    REMEMBERS = False

    def __init__(
        self, link: BusLink, meter: Metered, name: str, addresses: list[int], watchdog_s: float | None
    ) -> None:
        super().__init__(link, meter, name)
        self._motors = [OdriveMotor(address) for address in addresses]
        self._by_address = {motor.address: motor for motor in self._motors}
        self._watchdog_s = watchdog_s
        self._enabled_ns = 0
        self._torques = [cansimple.identifier(address, SET_TORQUE) for address in addresses]

    @property
    def motors(self) -> list[Motor]:
        """The motors, in the order of the axes."""
        return list[Motor](self._motors)

    def greet(self) -> None:
        """Have all let go, and learn that each sends what is needed."""
        motors = self._motors
        self._say_until(self._let_go, lambda index: motors[index].beats > 0 and motors[index].state == IDLE)
        end_s = time.monotonic() + GREETING_PATIENCE_S
        while not self.await_states(0.05):
            if time.monotonic() > end_s:
                silent = ", ".join(str(motor.address) for motor in motors if not motor.heard)
                raise DeviceTimeoutError(
                    f"{self._name}: ODrive {silent} on {self.link.where} sends no encoder estimates: set "
                    "axis0.config.can.encoder_msg_rate_ms = 1 (docs/odrive.md)"
                )
        self._count_heartbeats()
        version = motors[0].version
        self.model = f"ODrive ({version})" if version else "ODrive"

    def enable(self) -> None:
        """Clear errors whose cause is gone, and have all follow a torque of 0; heartbeats show soon whether they do.

        It does not wait for them, since a loop may not.
        """
        for index, motor in enumerate(self._motors):
            motor.beats = 0
            motor.follows = False
            self._close_loop(index)
        self._enabled_ns = time.monotonic_ns()

    def accept_restarts(self) -> None:
        """Nothing to forget: an ODrive that was switched off and on is noticed by its silence."""

    def disable(self) -> None:
        """Let go, until all have said that they have."""
        motors = self._motors
        for motor in motors:
            motor.beats = 0
        self._say_until(
            self._let_go, lambda index: motors[index].beats > 0 and motors[index].state != CLOSED_LOOP, urgent=True
        )

    def ask(self) -> None:
        """Nothing to do: the states come by themselves."""

    def push(self, torque_n_m: list[float]) -> None:
        """Set the torques."""
        send = self.link.send
        for identifier, newton_metre in zip(self._torques, torque_n_m, strict=True):
            send(identifier, cansimple.torque(newton_metre))
        self._sent_ns = time.monotonic_ns()

    def problem(self) -> DriverError | None:
        """Why an ODrive follows no torque."""
        for motor in self._motors:
            if motor.error or motor.state != CLOSED_LOOP:
                if not motor.follows and time.monotonic_ns() - self._enabled_ns < OBEYS_S * 1e9:
                    continue
                why = errors_text(motor.error or motor.reason) or (
                    f"it is in state {motor.state} and names no error; it was restarted, or another program told it to"
                )
                return DeviceFaultError(f"{self._name}: ODrive {motor.address} has let go: {why}")
            if time.monotonic_ns() - motor.beat_ns > HEARTBEAT_S * 1e9:
                return DeviceTimeoutError(
                    f"{self._name}: ODrive {motor.address} has had no heartbeat for {1e3 * HEARTBEAT_S:g} ms: is it "
                    "without power, or its cable out?"
                )
        return None

    def follow(self) -> bool:
        """Whether all have said that they do."""
        return all(motor.follows for motor in self._motors)

    def set_home(self, turns: list[float | None]) -> None:
        """Nothing to do: an ODrive does not say whether it still knows."""

    def prove_watchdog(self) -> None:
        """Fall silent while all follow a torque of 0, and see that they let go by themselves in time."""
        if self._watchdog_s is None:
            return
        self.enable()
        end_s = time.monotonic() + OBEYS_S
        while not self.follow() and time.monotonic() < end_s:
            self.push([0.0] * len(self._motors))
            self.link.wait(_LOOK_S)
            self.hear()
        problem = self.problem()
        if problem is not None:
            raise problem
        end_s = time.monotonic() + WATCHDOG_MARGIN * self._watchdog_s + 2.0 * HEARTBEAT_S
        while not all(motor.error & WATCHDOG_EXPIRED for motor in self._motors):
            left_s = end_s - time.monotonic()
            if left_s <= 0.0:
                without = ", ".join(str(motor.address) for motor in self._motors if not motor.error & WATCHDOG_EXPIRED)
                raise NoWatchdogError(
                    f"{self._name}: ODrive {without} goes on when nothing is said to it for "
                    f"{1e3 * self._watchdog_s:g} ms: set axis0.config.enable_watchdog = True and "
                    f"axis0.config.watchdog_timeout = {self._watchdog_s:g}, and save (docs/odrive.md)"
                )
            self.link.wait(left_s)
            self.hear()

    def _count_heartbeats(self) -> None:
        for motor in self._motors:
            motor.beats = 0
        end_s = time.monotonic() + LOOKED_S
        while slow := [motor for motor in self._motors if motor.beats < LEAST_BEATS]:
            left_s = end_s - time.monotonic()
            if left_s <= 0.0:
                raise DeviceProtocolError(
                    f"{self._name}: ODrive {slow[0].address} sends {slow[0].beats} heartbeats in {LOOKED_S:g} s, too "
                    "few: set axis0.config.can.heartbeat_msg_rate_ms = 10"
                )
            self.link.wait(left_s)
            self.hear()

    def _close_loop(self, index: int) -> None:
        address = self._motors[index].address
        for message, data in (
            (CLEAR_ERRORS, cansimple.CLEAR),
            (SET_MODE, cansimple.TORQUE_MODE),
            (SET_TORQUE, cansimple.torque(0.0)),
            (SET_STATE, cansimple.state(CLOSED_LOOP)),
        ):
            self.link.send(cansimple.identifier(address, message), data)

    def _let_go(self, index: int) -> None:
        address = self._motors[index].address
        self.link.send(cansimple.identifier(address, SET_TORQUE), cansimple.torque(0.0))
        self.link.send(cansimple.identifier(address, SET_STATE), cansimple.state(IDLE))

    def _take(self, identifier: int, data: bytes) -> bool:
        motor = self._by_address.get(identifier >> 5)
        if motor is None or identifier > 0x7FF:
            return False
        message = identifier & 0x1F
        try:
            if message == ESTIMATES:
                motor.turns, motor.turns_per_s = cansimple.pair(data)
                motor.states += 1
                motor.heard = True
            elif message == HEARTBEAT:
                motor.error, motor.state = cansimple.heartbeat(data)
                motor.beats += 1
                motor.beat_ns = time.monotonic_ns()
                if motor.state == CLOSED_LOOP and not motor.error:
                    motor.follows = True
            elif message == ERRORS:
                motor.error, motor.reason = cansimple.errors(data)
            elif message == BUS:
                motor.voltage_v, _ = cansimple.pair(data)
            elif message == TEMPERATURES:
                motor.temperature_c, _ = cansimple.pair(data)
            elif message == TORQUES:
                _, motor.torque_n_m = cansimple.pair(data)
            elif message == VERSION:
                motor.version = " firmware ".join(cansimple.version(data))
        except struct.error:
            return False
        return True
