"""What a haptic device is: five states, checks in the public methods, hooks that a device fills in.

    open -> (calibrate) -> enable -> read/write ... -> disable -> close

Each step may be called twice; `disable` leaves the device without force whatever has happened, or says that it could
not. Public methods own order and checks, so that a driver only fills in the hooks whose names start with an underscore.
"""

from __future__ import annotations

import contextlib
import enum
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import Any, ClassVar, Generic, Self, TypeVar

from pydantic import Field

from hapticd.device import MOST_METRICS, DeviceInfo, Diagnosis, FoundDevice, Metric, Sample
from hapticd.errors import (
    DeviceDisconnectedError,
    DeviceProtocolError,
    DriverError,
    DriverStateError,
    HapticdError,
    in_words,
)
from hapticd.settings import Table
from hapticd.trace import DriverTrace

__all__ = [
    "DeviceInfo",
    "Diagnosis",
    "Driver",
    "DriverOptions",
    "DriverState",
    "Field",
    "FoundDevice",
    "Metric",
    "Sample",
]


class DriverOptions(Table):
    """Base of every driver's options, the keys of [device.options]: strict, frozen, finite, no unknown keys."""


OptionsT = TypeVar("OptionsT", bound=DriverOptions)


class DriverState(enum.Enum):
    """Where in its life a driver is."""

    CLOSED = "closed"
    OPEN = "open"
    ENABLED = "enabled"


_LATE_ANSWER_S = 0.5
"""How long a device that is given back may take to say that it has let go, where a tick could not wait for it [s]."""

_CLOSED, _ENABLED = DriverState.CLOSED, DriverState.ENABLED  # Python 3.11 takes 0.1 us to look a member up, each time


class Driver(ABC, Generic[OptionsT]):
    """A device behind a driver.

    As a context manager it opens the device and, whatever happens inside, closes it without force:

        with SerialRig(options, period_s=0.001) as rig:
            rig.enable()

    Args:
        options: the device's options, an instance of `Options`.
        period_s: time between ticks [s].

    Attributes:
        Options: the keys of [device.options].
        METRICS: what it counts and measures.
        ABSENT: what to do when `find` finds nothing, in a few words.
        metrics: one number for each of `METRICS`, in their order; a driver writes them whenever it likes, from any of
            its threads, which costs a tick no more than storing a number.
        trace: what was last said between driver and device, where a driver keeps that; it is in every fault record.
        force_left: why the last `disable` or `close` may have left a force on the device; "" when it did not.
        forces_flow: the device follows what is written. Where it takes a moment for that, `_enable` says that it does
            not yet and `_read` that it does; until then the loop writes no force, and the ramp of arming waits.
    """

    Options: ClassVar[type[DriverOptions]] = DriverOptions
    METRICS: ClassVar[tuple[Metric, ...]] = ()
    ABSENT: ClassVar[str] = "plug it in"

    def __init__(self, options: OptionsT, period_s: float) -> None:
        self.options = options
        self.period_s = period_s
        self.metrics = memoryview(bytearray(8 * MOST_METRICS)).cast("d")
        self.trace = DriverTrace()
        self.state = DriverState.CLOSED
        self.force_left = ""
        self.forces_flow = True
        self._info: DeviceInfo | None = None
        self._limit_squared = 0.0
        self._axes = 0
        self._calibrating = False
        self._called_off = False
        self._may_answer_yet = False

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    @classmethod
    def check(cls, options: OptionsT, period_s: float) -> None:
        """Refuse options that cannot run at this loop rate; most devices refuse nothing.

        Args:
            options: as the configuration gives them.
            period_s: time between ticks [s].

        Raises:
            ValueError: a value goes too far; says `key = value: why`.
        """

    @classmethod
    def find(cls, options: OptionsT | None = None) -> list[FoundDevice]:
        """Every device of this kind that is there, whether it can be used or not; none is moved or kept open.

        `hapticd devices` asks each driver in a process of its own, so that one that fails spoils no other.

        Args:
            options: what is needed to look for it; None: the defaults.
        """
        return []

    @classmethod
    def diagnose(cls, options: OptionsT | None = None) -> list[Diagnosis]:
        """What this computer has and lacks of what the driver needs; opens no device.

        `hapticd doctor` shows it, in a process of its own, and `hapticd devices` its problems where it finds nothing.

        Args:
            options: those of the configuration; None: the defaults.
        """
        return []

    @property
    def info(self) -> DeviceInfo:
        """What the device declares.

        Raises:
            DriverStateError: the driver is not open.
        """
        if self._info is None:
            raise DriverStateError("the device is not open")
        return self._info

    def place(self, wall_m: float, outward: int) -> None:
        """Be told, before `open`, where the first wall stands on the device's single axis.

        Only a simulated device cares: it starts relative to that wall.

        Args:
            wall_m: position of the wall's plane [m].
            outward: +1 when the free side is the positive one, -1 otherwise.
        """

    def share_metrics(self, place: memoryview[float]) -> None:
        """Keep the metrics in this memory from now on, where another process reads them."""
        place[:] = self.metrics
        self.metrics = place

    def open(self) -> DeviceInfo:
        """Find the device and learn what it is; no force, no motion.

        Raises:
            DriverError: not found, not permitted, busy, or it makes no sense; or `_open` raised what is no such error.
        """
        if self.state is DriverState.CLOSED:
            try:
                with naming(type(self), "_open"):
                    self._info = self._open()
                    if self._info.flaw:  # every limit is made of it
                        raise DeviceProtocolError(f"{type(self).__name__}: DeviceInfo.{self._info.flaw}")
            except BaseException:
                self._close()
                raise
            # A simulated device saturates by itself; a hand is protected here, behind the guard.
            limit_n = math.inf if self._info.simulated else self._info.max_force_n
            self._limit_squared = (limit_n * (1.0 + 1e-9)) ** 2
            self._axes = len(self._info.axes)
            self.state = DriverState.OPEN
        return self.info

    def calibrate(self) -> None:
        """Calibrate or home the device. The one call that may move an arm by itself.

        Raises:
            DriverStateError: not open, force is enabled, or it was called off.
            DriverError: the device failed to calibrate; or `_calibrate` raised what is no such error.
        """
        if self.state is not DriverState.OPEN:
            raise DriverStateError(f"calibrate: the device is {self.state.value}, it must be open without force")
        self._called_off = False
        self._calibrating = True
        try:
            with naming(type(self), "_calibrate"):
                self._calibrate()
        except DriverError as error:
            if self._called_off:
                raise DriverStateError("the calibration was called off") from error
            raise
        finally:
            self._calibrating = False

    def call_off(self) -> None:
        """Have a calibration that is under way, in another thread, end early; returns at once and never raises."""
        if self._calibrating:
            self._called_off = True
            with contextlib.suppress(Exception):  # who calibrates gets the error
                self._call_off()

    def enable(self) -> None:
        """Let the device take forces; the force is zero until the first write.

        One that fails halfway is disabled again: where a device has two motors, the first may hold already.

        Raises:
            DriverStateError: not open.
            DriverError: the device refuses, for example while it is not calibrated; or `_enable` raised what is no such
                error.
        """
        if self.state is DriverState.CLOSED:
            raise DriverStateError("enable: the device is not open")
        if self.state is DriverState.OPEN:
            try:
                with naming(type(self), "_enable"):
                    self._enable()
            except BaseException:
                self.disable()
                raise
            self.state = DriverState.ENABLED

    def read(self) -> Sample:
        """The newest state of the device; never waits longer than a tick allows.

        Raises:
            DriverError: lost, late, or it makes no sense.
        """
        if self.state is _CLOSED:
            raise DriverStateError("read: the device is not open")
        return self._read()

    def write(self, force_n: Sequence[float]) -> None:
        """Apply a force until the next write.

        Args:
            force_n: force on the device along each axis [N].

        Raises:
            DriverStateError: not enabled, wrong number of axes, not finite, or beyond the device's limit.
            DriverError: lost or late.
        """
        if self.state is not _ENABLED:
            raise DriverStateError(f"write: the device is {self.state.value}, not enabled")
        squared = 0.0
        for newton in force_n:
            squared += newton * newton
        # A NaN fails every comparison, so it is refused here as well.
        if not (squared <= self._limit_squared and squared < math.inf) or len(force_n) != self._axes:
            raise DriverStateError(f"write: {list(force_n)} N is not a force within {self.info.max_force_n:g} N")
        self._write(force_n)

    def disable(self) -> None:
        """Take the force away, from any state, after any error; never raises: `force_left` says whether it is gone."""
        if self.state is DriverState.CLOSED:
            return
        self.call_off()
        self.state = DriverState.OPEN
        self.force_left, self._may_answer_yet = "", False
        try:
            self._disable()
        except (Exception, SystemExit) as error:  # noqa: BLE001 - who calls is letting go, and may have other ways to
            said = isinstance(error, HapticdError)
            self.force_left = str(error) if said else f"_disable: {in_words(error, type(self).__module__)}"
            self._may_answer_yet = isinstance(error, DriverError) and not isinstance(error, DeviceDisconnectedError)

    def close(self) -> None:
        """Take the force away and give the device back; never raises: `force_left` says whether the force is gone."""
        self.disable()
        end_s = time.monotonic() + _LATE_ANSWER_S
        while self._may_answer_yet and time.monotonic() < end_s:  # no tick waits for it any more
            time.sleep(0.01)
            self.disable()
        self.state = DriverState.CLOSED
        self._info = None
        with contextlib.suppress(Exception):
            self._close()

    @abstractmethod
    def _open(self) -> DeviceInfo:
        """Find the device, greet it, learn its axes and limits."""

    def _calibrate(self) -> None:
        """Calibrate or home; may move."""

    def _call_off(self) -> None:
        """Have `_calibrate` end with an error soon, the arm without force; called from another thread, may not wait.

        Nothing to do for one that looks at `_called_off` between its own steps.
        """

    @abstractmethod
    def _enable(self) -> None:
        """Allow forces; the first force is zero. It does not wait until they flow: a loop may not (`forces_flow`)."""

    @abstractmethod
    def _read(self) -> Sample:
        """Return the newest state, the same object every time."""

    @abstractmethod
    def _write(self, force_n: Sequence[float]) -> None:
        """Apply a force that is finite, within limits, one element an axis."""

    @abstractmethod
    def _disable(self) -> None:
        """Take the force away; must work from any state, twice, after an error.

        Raises:
            Exception: the force may still be there; the daemon then tries other ways.
        """

    @abstractmethod
    def _close(self) -> None:
        """Release what `_open` took, even half opened; must not raise."""


@contextlib.contextmanager
def naming(driver: type[Driver[Any]], place: str) -> Iterator[None]:
    """What a driver raises inside is an error in a line that names it, unless it was meant for people.

    Args:
        driver: what may raise.
        place: in what of it.

    Raises:
        DriverError: it did.
    """
    try:
        yield
    except (HapticdError, KeyboardInterrupt):
        raise
    except BaseException as error:
        said = in_words(error, driver.__module__)
        raise DeviceProtocolError(f"driver {driver.__module__}.{driver.__name__}: {place}: {said}") from error
