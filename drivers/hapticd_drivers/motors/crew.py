"""The motors of one device behind one adapter: what a family of controllers fills in."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, Protocol

from hapticd.errors import DeviceFaultError, DeviceTimeoutError, DriverError
from hapticd_drivers.motors.link import BusLink
from hapticd_drivers.motors.metrics import (
    ANSWER_US,
    DAMAGED,
    HOTTEST_C,
    LONGEST_ANSWER_US,
    LOWEST_V,
    UNKNOWN,
    UNSENT,
)

URGENT_S = 0.005
URGENT_PATIENCE_S = 0.04
"""A command is repeated after the first time, and a motor counts as silent after the second: a loop waits [s]."""

GREETING_S = 0.05
GREETING_PATIENCE_S = 1.0
"""The same while a device is opened [s]."""

RESTARTED_S = 0.05
"""A controller that says nothing for this time may have been switched off and on, and count from elsewhere [s]."""


class NoWatchdogError(DeviceFaultError):
    """A controller goes on when nothing is said to it."""


class Metered(Protocol):
    """Keeps the metrics, which may move to other memory at any time."""

    metrics: memoryview[float]


class Motor:
    """What is known of a motor.

    Attributes:
        address: of its controller on the bus.
        turns, turns_per_s, torque_n_m: of its shaft, as its controller reports them.
        states: how many of its states have come.
        heard: one of them has come since the last command.
    """

    __slots__ = ("address", "heard", "states", "temperature_c", "torque_n_m", "turns", "turns_per_s", "voltage_v")

    def __init__(self, address: int) -> None:
        self.address = address
        self.turns = 0.0
        self.turns_per_s = 0.0
        self.torque_n_m = 0.0
        self.temperature_c = 0.0
        self.voltage_v = 0.0
        self.states = 0
        self.heard = False

    @property
    def home_turns(self) -> float | None:
        """Where its controller counts the home that it was told by hapticd [turns]; None: it has none, or lost it."""
        return None

    @property
    def needs_mark(self) -> bool:
        """Whether only a place that it is told can show that its controller restarts: `Crew.mark`."""
        return False


class Crew(ABC):
    """The motors on a bus.

    Args:
        link: the adapter.
        meter: keeps the metrics.
        name: of the driver, which errors begin with.

    Attributes:
        REMEMBERS: the controllers know where home is until they are switched off, once they were told.
        model, serial: of the controllers, once greeted.
    """

    REMEMBERS: ClassVar[bool]

    def __init__(self, link: BusLink, meter: Metered, name: str) -> None:
        self.link = link
        self.model = name
        self.serial = ""
        self._meter = meter
        self._name = name
        self._sent_ns = 0
        self._damaged = 0
        self._unsent = 0

    @property
    @abstractmethod
    def motors(self) -> list[Motor]:
        """The motors, in the order of the axes."""

    @abstractmethod
    def greet(self) -> None:
        """Learn that all are there, and where they are; no force.

        Raises:
            ConfigError: an axis is to know by itself where it is, and its controller does not.
            DriverError: one does not answer, or cannot be used.
        """

    @abstractmethod
    def enable(self) -> None:
        """Let torques through, zero at first; waits no longer than a loop can bear.

        Raises:
            DriverError: one refuses.
        """

    @abstractmethod
    def disable(self) -> None:
        """Let go, from any state.

        Raises:
            DriverError: it is not known that all have.
        """

    @abstractmethod
    def accept_restarts(self) -> None:
        """Forget who was switched off and on: the driver has looked whether all still know their home."""

    @abstractmethod
    def ask(self) -> None:
        """Ask for the states where they do not come by themselves, and leave the torque alone."""

    @abstractmethod
    def push(self, torque_n_m: list[float]) -> None:
        """Set the torques, and have the states come."""

    @abstractmethod
    def problem(self) -> DriverError | None:
        """Why a motor that was enabled lets no torque through; None when all do."""

    @abstractmethod
    def follow(self) -> bool:
        """Whether all motors follow torques since they were enabled, as far as they have said so."""

    @abstractmethod
    def set_home(self, turns: list[float | None]) -> None:
        """Tell the controllers their homes, which are at these turns now, if they can remember that.

        They may count from elsewhere then: `Motor.home_turns`.

        Args:
            turns: one an axis; None where home is not to be changed.

        Raises:
            DriverError: one has not taken it, or has been switched off and on.
        """

    def mark(self, index: int) -> float:
        """Have a controller that needs it count from a place that a restart loses; its home of before is lost.

        Args:
            index: of the motor.

        Returns:
            Where it counts the place at which it was last seen now [turns].

        Raises:
            DriverError: it has not taken it, or has been switched off and on.
        """
        raise NotImplementedError

    @abstractmethod
    def prove_watchdog(self) -> None:
        """Say nothing while torques of 0 hold, and see that the motors let go by themselves in time.

        Raises:
            NoWatchdogError: one does not.
            DriverError: one is silent, faulty or gone.
        """

    @abstractmethod
    def _take(self, identifier: int, data: bytes) -> bool:
        """Take a frame in; whether it is one of ours."""

    def hear(self) -> bool:
        """Take in what has come; whether a new state of every motor is among what came since the last command.

        Raises:
            DriverError: the adapter is gone, or a motor says what cannot be.
        """
        link = self.link
        metrics = self._meter.metrics
        for identifier, data in link.receive():
            if not self._take(identifier, data):
                metrics[UNKNOWN] += 1.0
        if link.damaged != self._damaged:
            metrics[DAMAGED] += float(link.damaged - self._damaged)
            self._damaged = link.damaged
        if link.unsent != self._unsent:
            metrics[UNSENT] += float(link.unsent - self._unsent)
            self._unsent = link.unsent
        return all(motor.heard for motor in self.motors)

    def await_states(self, timeout_s: float) -> bool:
        """Whether a new state of every motor is there, waited for this time [s] at most."""
        fresh = self.hear()
        if not fresh:
            end_ns = time.monotonic_ns() + round(timeout_s * 1e9)
            while not fresh:
                left_ns = end_ns - time.monotonic_ns()
                if left_ns <= 0:
                    return False
                self.link.wait(left_ns * 1e-9)
                fresh = self.hear()
        return True

    def note(self) -> None:
        """Write down how long the states took, how hot the motors are, and begin to wait for new ones."""
        metrics = self._meter.metrics
        hottest_c, lowest_v = -1e9, 1e9
        for motor in self.motors:
            motor.heard = False
            hottest_c = max(hottest_c, motor.temperature_c)
            lowest_v = min(lowest_v, motor.voltage_v)
        metrics[HOTTEST_C] = hottest_c
        metrics[LOWEST_V] = lowest_v
        if self._sent_ns:
            answer_us = (time.monotonic_ns() - self._sent_ns) * 1e-3
            self._sent_ns = 0
            metrics[ANSWER_US] = answer_us
            if answer_us > metrics[LONGEST_ANSWER_US]:
                metrics[LONGEST_ANSWER_US] = answer_us

    def _say_until(self, say: Callable[[int], None], done: Callable[[int], bool], urgent: bool = False) -> None:
        """Say something to each motor until what came after it shows that it was heard.

        Args:
            say: says it to one, given its index.
            done: whether it has been heard.
            urgent: a loop waits for it.

        Raises:
            DeviceTimeoutError: one has not obeyed in time.
        """
        each_s, patience_s = (URGENT_S, URGENT_PATIENCE_S) if urgent else (GREETING_S, GREETING_PATIENCE_S)
        end_s = time.monotonic() + patience_s
        self.link.receive()  # what was said before is no answer
        for motor in self.motors:
            motor.heard = False
        waiting = list(range(len(self.motors)))
        while True:
            for index in waiting:
                say(index)
            next_s = min(time.monotonic() + each_s, end_s)
            while waiting:
                self.hear()
                waiting = [index for index in waiting if not done(index)]
                left_s = next_s - time.monotonic()
                if left_s <= 0.0:
                    break
                if waiting:
                    self.link.wait(left_s)
            if not waiting:
                return
            if time.monotonic() >= end_s:
                problem = self.problem() if urgent and all(motor.heard for motor in self.motors) else None
                raise problem or self._silent(waiting, patience_s)

    def _silent(self, waiting: list[int], patience_s: float) -> DeviceTimeoutError:
        addresses = " and ".join(str(self.motors[index].address) for index in waiting)
        return DeviceTimeoutError(
            f"{self._name}: motor controller {addresses} on {self.link.where} did not answer within {patience_s:g} s: "
            "is its supply on, its address that of device.options.axes, and the bus terminated?"
        )
