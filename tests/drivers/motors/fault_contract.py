"""Each thing that can go wrong with motor controllers: how soon it is noticed, its name, and what push is left."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import pytest

from hapticd.driver import DriverState
from hapticd.errors import DeviceBusyError, DeviceFaultError, DriverError
from hapticd_drivers.motors.driver import MotorDriver
from hapticd_drivers.motors.metrics import DAMAGED, UNKNOWN
from tests.drivers.motors.bench import PATIENCE_S
from tests.drivers.motors.lab import RADIUS_M, MotorLab
from tests.drivers.motors.wire import Frames

PUSH_N = 2.0
WATCHDOG_MS = 20.0

_PAGES = Path(__file__).parents[3] / "docs"
_TICK_S = 0.25
"""What a tick waits for a state while a fault is looked for, as long as a busy computer may take: it is no fault."""


@dataclass(frozen=True)
class MotorFault:
    """Something that goes wrong.

    Attributes:
        name: in the table of the family's page.
        happen: brings it about.
        kind, text: the error, and what is in its text.
        most_ticks: the fault is reported within this many ticks.
        tick_s: what a tick waits for a state [s].
    """

    name: str
    happen: Callable[[Any], object]
    kind: type[DriverError]
    text: str
    most_ticks: int
    tick_s: float = _TICK_S


def nothing_heard(made: MotorLab) -> None:
    """The computer says nothing for longer than the watchdog allows."""
    made.bench.pass_time(1.2e-3 * WATCHDOG_MS)


def unplug(made: MotorLab) -> None:
    """The adapter's cable is pulled."""
    made.bench.unplug()


def deafen(made: MotorLab) -> None:
    """The first controller is silent, as one without power."""
    made.first.deaf = True


def brown_out(made: MotorLab) -> None:
    """The supply of the first controller falls."""
    made.first.voltage_v = 8.0


def pressing(made: MotorLab) -> MotorDriver[Any]:
    """A driver that pushes with `PUSH_N` on two motors."""
    driver = made.driver()
    driver._state_wait_s = PATIENCE_S  # a busy computer is no fault
    driver.open()
    driver.enable()
    for _ in range(25):
        driver.read()
        driver.write([PUSH_N, -PUSH_N])
    made.bench.settle(driver)
    assert made.first.torque_n_m == pytest.approx(PUSH_N * RADIUS_M)
    return driver


def ticks_until(driver: MotorDriver[Any], kind: type[DriverError], text: str, tick_s: float = _TICK_S) -> int:
    """Ticks of the loop until the error, which has to come."""
    driver._state_wait_s = tick_s
    ticks = 0

    def press_on() -> None:
        nonlocal ticks
        while ticks < 2000:
            ticks += 1
            driver.read()
            driver.write([PUSH_N, -PUSH_N])

    with pytest.raises(kind, match=re.escape(text)):
        press_on()
    return ticks


class MotorFaultContract:
    """A family inherits it, has a fixture `bench` of two motors, and one `fault`, whose parameters are `FAULTS`."""

    PAGE: ClassVar[str]
    """The family's page in docs/."""

    FAULTS: ClassVar[tuple[MotorFault, ...]]
    """Everything that its table names."""

    TIMED_OUT: ClassVar[str]
    """What the error says of a controller that let go by its own watchdog."""

    STRANGER: ClassVar[int]
    """Identifier of a frame from a controller that is none of ours."""

    BROKEN_LINE: ClassVar[bytes]
    """What an adapter never says."""

    LONGEST_CUT: ClassVar[int]
    """Bytes that a frame may be cut to and then makes no sense."""

    def calm(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """What a test that is about something else has to wait for longer; nothing unless a family says so."""

    def test_what_goes_wrong_is_named_soon_and_leaves_no_force(
        self, bench: MotorLab, fault: MotorFault, record_property: Callable[[str, object], None]
    ) -> None:
        driver = pressing(bench)
        bench.first.peak_n_m = 0.0
        fault.happen(bench)
        ticks = ticks_until(driver, fault.kind, fault.text, fault.tick_s)
        assert ticks <= fault.most_ticks
        assert bench.first.peak_n_m <= PUSH_N * RADIUS_M * 1.001
        driver.disable()
        assert driver.state is DriverState.OPEN
        for controller in bench.controllers:
            controller.advance(0.05)  # those that heard nothing of it have their watchdogs
            assert controller.torque_n_m == 0.0
        driver.close()
        peak_n = bench.first.peak_n_m / RADIUS_M
        record_property("ticks", ticks)
        record_property("peak_n", peak_n)
        print(f"| {fault.name} | {ticks} | {peak_n:.2f} |")  # noqa: T201 - the table of the family's page

    def test_the_page_names_each_of_them(self) -> None:
        page = (_PAGES / self.PAGE).read_text()
        assert [fault.name for fault in self.FAULTS if f"| {fault.name} |" not in page] == []

    def test_the_watchdog_is_the_one_that_is_declared(self, bench: MotorLab) -> None:
        """It holds for as long as it says, and not longer, while the computer is silent."""
        driver = pressing(bench)
        assert driver.info.host_silence_ms == WATCHDOG_MS
        bench.first.pass_time(1e-3 * (WATCHDOG_MS - 2.0))
        assert bench.first.torque_n_m != 0.0
        bench.first.pass_time(0.01)
        assert bench.first.torque_n_m == 0.0
        driver.close()

    def test_a_second_program_is_refused_and_the_first_pushes_on(self, bench: MotorLab) -> None:
        """A CAN interface lets any number of programs in, and the greeting of a second has the motors let go."""
        first = pressing(bench)
        second = bench.driver()
        with pytest.raises(DeviceBusyError, match="end it first"):
            second.open()
        bench.bench.settle(first)
        assert bench.first.torque_n_m == pytest.approx(PUSH_N * RADIUS_M)

    def test_a_controller_that_let_go_follows_again_only_when_it_is_enabled(self, bench: MotorLab) -> None:
        driver = pressing(bench)
        nothing_heard(bench)
        ticks_until(driver, DeviceFaultError, self.TIMED_OUT)
        driver.disable()
        driver._state_wait_s = PATIENCE_S
        for _ in range(10):
            driver.read()
        assert bench.first.torque_n_m == 0.0
        driver.enable()
        for _ in range(3):
            driver.read()
            driver.write([PUSH_N, 0.0])
        bench.bench.settle(driver)
        assert bench.first.torque_n_m == pytest.approx(PUSH_N * RADIUS_M)
        driver.close()

    def test_frames_that_are_damaged_or_of_others_are_counted_and_never_believed(
        self, bench: MotorLab, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        driver = pressing(bench)
        self.calm(monkeypatch)  # what is waited for is spoilt as well
        driver._state_wait_s = 0.004
        bench.bench.spoil = self._spoiler(bench)
        for _ in range(200):
            sample = driver.read()
            assert all(abs(position_m) < 0.06 for position_m in sample.position_m)
            driver.write([PUSH_N, -PUSH_N])
        bench.bench.spoil = list
        bench.bench.settle(driver)
        assert driver.metrics[DAMAGED] > 10
        assert driver.metrics[UNKNOWN] > 10
        driver._state_wait_s = PATIENCE_S
        before = driver.read().sequence
        driver.write([0.0, 0.0])
        bench.bench.settle(driver)
        assert driver.read().sequence > before
        driver.close()

    def _spoiler(self, bench: MotorLab) -> Callable[[Frames], Frames]:
        """Makes half of the frames another's, shorter, or no frames."""
        dice = random.Random(1)
        end = bench.bench.end

        def spoil(frames: Frames) -> Frames:
            spoilt: Frames = []
            for identifier, data in frames:
                kind = dice.randrange(6)
                if kind == 0:
                    spoilt.append((self.STRANGER, data))
                elif kind == 1:
                    spoilt.append((identifier, data[: dice.randrange(self.LONGEST_CUT)]))
                elif kind == 2:
                    end.send_raw(self.BROKEN_LINE if bench.channel.startswith("/") else b"\x01\x02")
                else:
                    spoilt.append((identifier, data))
            return spoilt

        return spoil
