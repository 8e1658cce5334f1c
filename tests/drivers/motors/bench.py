"""Motors on a bus that are not there: what every family of controllers has in common."""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Literal, Self

from hapticd_drivers.motors.driver import MotorDriver
from tests.drivers.motors.shaft import Shaft
from tests.drivers.motors.wire import Frames, SocketEnd, TtyEnd
from tests.drivers.urgent import be_urgent

TICK_S = 0.001
PATIENCE_S = 3.0
"""How long a driver waits for a controller that is silent, in tests of something else."""

MARK = 0x7EE
"""A frame that is for no controller: what was sent before it has come when it has."""


class Controller(ABC):
    """One controller: what it says to a frame, and what it does while time passes.

    Attributes:
        shaft: its motor.
        deaf: says nothing, as one without power or with its cable out.
        peak_n_m: largest torque that it has given since this was set to 0.
        preparing: milliseconds for which it gets ready before it follows a torque.
    """

    def __init__(self, address: int, shaft: Shaft) -> None:
        self.address = address
        self.shaft = shaft
        self.deaf = False
        self.peak_n_m = 0.0
        self.preparing = 0

    @property
    @abstractmethod
    def torque_n_m(self) -> float:
        """What it drives its motor with now."""

    @property
    @abstractmethod
    def follows(self) -> bool:
        """Whether it gives the torque that it is told, and does not only get ready for it."""

    @abstractmethod
    def hear(self, identifier: int, data: bytes) -> Frames:
        """Its answers to a frame on the bus."""

    @abstractmethod
    def pass_time(self, duration_s: float) -> None:
        """Run its watchdog."""

    @abstractmethod
    def is_tick(self, identifier: int) -> bool:
        """Whether this is the frame that comes to it once a tick."""

    def tell(self) -> Frames:
        """What it says by itself, after a millisecond."""
        return []

    def advance(self, duration_s: float) -> None:
        self.pass_time(duration_s)
        torque_n_m = self.torque_n_m
        self.peak_n_m = max(self.peak_n_m, abs(torque_n_m))
        self.shaft.advance(torque_n_m, duration_s)


class Bench:
    """Controllers behind an adapter, served by a thread of its own.

    Args:
        end: the adapter's far end.
        controllers: on its bus.
        pace: "frames": 1 ms passes with each tick of the computer, so that load on it means nothing to the motors;
            "real": time passes.

    Attributes:
        spoil: what becomes of the frames that controllers send.
        marks: frames that have come and were only to show that what was sent before them has.
        idle_passes: a millisecond passes for each that the computer says nothing, at the pace "frames" as well.
    """

    def __init__(
        self, end: TtyEnd | SocketEnd, controllers: list[Any], pace: Literal["frames", "real"] = "frames"
    ) -> None:
        self.end = end
        self.controllers = controllers
        self.spoil: Callable[[Frames], Frames] = list
        self.marks = 0
        self.idle_passes = False
        self.lock = threading.RLock()
        self._pace = pace
        self._running = True
        self._heard_ns = self._real_ns = time.monotonic_ns()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.unplug()

    def unplug(self) -> None:
        """Pull the adapter's cable."""
        if self._running:
            self._running = False
            self._thread.join(10.0)
            self.end.close()

    def pass_time(self, duration_s: float) -> None:
        """Let time pass without a frame."""
        with self.lock:
            for _ in range(round(duration_s / TICK_S)):
                self._advance(TICK_S)

    def settle(self, driver: MotorDriver[Any]) -> None:
        """Return when all that the driver, which is open, has sent has come, and what it caused has been sent."""
        end_s = time.monotonic() + 10.0 * PATIENCE_S
        marks = self.marks
        driver._opened().link.send(MARK, b"")
        while self.marks == marks:
            assert time.monotonic() < end_s, "the controllers have not heard the driver"
            time.sleep(0.0005)

    def _serve(self) -> None:
        be_urgent()
        while self._running:
            frames = self.end.receive(0.0005 if self._pace == "real" else 0.001)
            with self.lock:
                now_ns = time.monotonic_ns()
                if self._pace == "real":
                    while self._real_ns + 1_000_000 <= now_ns:
                        self._real_ns = max(self._real_ns + 1_000_000, now_ns - 10_000_000)
                        self._advance(TICK_S)
                for identifier, data in frames:
                    self._take(identifier, data)
                if frames:
                    self._heard_ns = now_ns
                elif self._pace == "frames" and now_ns - self._heard_ns > 5_000_000:
                    self._idle()

    def _take(self, identifier: int, data: bytes) -> None:
        if identifier == MARK:
            self.marks += 1
            return
        first = self.controllers[0]
        if self._pace == "frames" and first.is_tick(identifier):
            self._advance(TICK_S)
        for controller in self.controllers:
            answers = controller.hear(identifier, data)
            if not controller.deaf:
                self._send(answers)

    def _advance(self, duration_s: float) -> None:
        for controller in self.controllers:
            controller.advance(duration_s)
            told = controller.tell()
            if not controller.deaf:
                self._send(told)

    def _idle(self) -> None:
        """Nothing has come from the computer for long: what is told by itself is told."""
        if self.idle_passes:
            self._advance(TICK_S)
            return
        for controller in self.controllers:
            if not controller.deaf:
                self._send(controller.tell())

    def _send(self, frames: Frames) -> None:
        for identifier, data in self.spoil(frames):
            self.end.send(identifier, data)
