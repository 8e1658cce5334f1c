"""Arming a device that takes a moment to follow: no force before it does, and all of the ramp from then on."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from hapticd import plugins
from hapticd.driver import DriverState
from hapticd.errors import DeviceFaultError
from hapticd.loop.memory import (
    ANSWERED,
    DISARM,
    DISARMED_SINCE,
    REQUESTS,
    SUPERVISOR_BEAT,
    RecordReader,
)
from hapticd.tick.event import EventCode
from hapticd.tick.flags import Flag
from hapticd.tick.record import TickRecord
from tests.loop.clock import Clock
from tests.loop.started import WALL, Started

ASKED = 5
LATER = 20
FOLLOWS = 45
"""The tick with whose sample the device says so."""

TICKS = 120
AT_M = -0.01
RAMP_N = 0.2
"""From one tick to the next, by `safety.ramp_s`, at that place."""


class Slow(Started):
    """A loop whose device, pressed into a wall by a hand that trembles, follows from some tick on and not before.

    Args:
        monkeypatch: of the test.
        auto_arm: whether it arms by itself; it is asked to otherwise.

    Attributes:
        written: every force that was written [N].
        records: of every tick but the last.
        enabled: whether the device was enabled as each tick began.
        verdict: what came of the request; None: nothing yet.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, auto_arm: bool) -> None:
        super().__init__(Clock(monkeypatch), auto_arm, WALL + '[controller]\nlaw = "none"\n')
        driver = self.driver
        driver.sample.position_m[0] = AT_M
        self.auto_arm = auto_arm
        self.written: list[float] = []
        self.records: list[TickRecord] = []
        self.enabled: list[bool] = []
        self.verdict: str | None = None
        monkeypatch.setattr(driver, "_enable", lambda: setattr(driver, "forces_flow", False))
        monkeypatch.setattr(driver, "_write", lambda force_n: self.written.append(force_n[0]))
        self.shared.words[SUPERVISOR_BEAT] = 1 << 62

    def go(self, later: Callable[[], object] = lambda: None, ticks: int = TICKS) -> None:
        """Run, with something done while the device gets ready."""
        words = self.shared.words
        reader = RecordReader(self.shared)

        def each_tick(number: int) -> None:
            self.records += reader.read()
            self.enabled.append(self.driver.state is DriverState.ENABLED)
            if number == ASKED and not self.auto_arm:
                self.shared.post({"do": "arm"})
            if number > ASKED and self.verdict is None and words[REQUESTS] and words[REQUESTS] == words[ANSWERED]:
                self.verdict = self.shared.verdict()
                assert self.verdict or number > FOLLOWS
            self.driver.sample.position_m[0] = AT_M + (1e-4 * (number % 3) if number < FOLLOWS - 5 else 0.0)
            if number == FOLLOWS:
                self.driver.forces_flow = True
            if number == LATER:
                later()

        self.run(each_tick, ticks)

    @property
    def codes(self) -> list[int]:
        """Of the events."""
        return [event.code for event in self.told]

    @property
    def stays_disarmed(self) -> bool:
        """Whether no force came of it, and the device was let go in the tick after `LATER` at the latest."""
        none = not any(self.written) and not any(record.force_n[0] for record in self.records)
        return none and EventCode.ARMED not in self.codes and not any(self.enabled[LATER + 2 :])


@pytest.fixture(params=[False, True], ids=["asked", "by itself"])
def slow(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Slow:
    return Slow(monkeypatch, request.param)


def test_no_force_is_written_or_told_before_the_device_follows_and_then_the_ramp_begins(slow: Slow) -> None:
    """It began as the device was enabled: one that followed 40 ms later pushed with 8 N of 10 at once."""
    slow.go()
    forces_n = [record.force_n[0] for record in slow.records]
    assert not any(forces_n[: FOLLOWS + 1])
    assert not any(record.energy_j for record in slow.records[: FOLLOWS + 1])
    assert forces_n[FOLLOWS + 1 :][:51] == pytest.approx([RAMP_N * tick for tick in range(51)])
    armed = [bool(record.flags & Flag.ARMED) for record in slow.records[:TICKS]]
    assert armed == [at > FOLLOWS for at in range(TICKS)]
    assert [event.seq for event in slow.told if event.code == EventCode.ARMED] == [FOLLOWS]
    assert slow.verdict == (None if slow.auto_arm else "")


def test_zero_is_written_in_every_tick_until_then_since_the_device_may_watch_for_it(slow: Slow) -> None:
    slow.go()
    before = FOLLOWS if slow.auto_arm else FOLLOWS - ASKED - 1
    assert not any(slow.written[: before + 2])
    assert slow.written[before + 2] == pytest.approx(RAMP_N, rel=1.0)
    assert all(slow.enabled[ASKED + 1 : TICKS])


def test_disarming_lets_go_in_that_tick_and_the_device_is_not_armed_when_it_follows(slow: Slow) -> None:
    words = slow.shared.words

    def disarm() -> None:
        words[DISARM] += 1

    slow.go(disarm)
    assert slow.stays_disarmed
    assert not slow.enabled[LATER + 1]
    assert EventCode.DISARMED in slow.codes
    assert slow.verdict == (None if slow.auto_arm else DISARMED_SINCE)


def test_a_fault_that_latches_lets_go_as_well(slow: Slow) -> None:
    safety = slow.config.config.safety

    def stall() -> None:
        slow.shared.words[SUPERVISOR_BEAT] = round((slow.clock.now_s - safety.supervisor_stall_s - 0.1) * 1e9)

    slow.go(stall)
    assert slow.stays_disarmed
    assert EventCode.SUPERVISOR_STALLED in slow.codes
    assert slow.verdict == (None if slow.auto_arm else "stopped by a fault: `hapticd clear` first")


def test_a_fault_that_latches_in_the_tick_in_which_the_device_follows_comes_first(slow: Slow) -> None:
    def both() -> None:
        slow.tick.guard.latched = slow.driver.forces_flow = True

    slow.go(both)
    assert slow.stays_disarmed


def test_a_device_that_a_fault_has_stopped_is_not_even_enabled(slow: Slow, monkeypatch: pytest.MonkeyPatch) -> None:
    enabled: list[bool] = []
    monkeypatch.setattr(slow.driver, "_enable", lambda: enabled.append(True))
    slow.tick.guard.latched = True
    assert not slow.loop.session.arm()
    slow.go()
    assert enabled == []
    assert EventCode.ARMED not in slow.codes


def test_a_loop_that_is_to_end_ends(slow: Slow) -> None:
    slow.go(ticks=LATER)
    assert not any(slow.written)
    assert EventCode.ARMED not in slow.codes
    assert slow.driver.state is DriverState.CLOSED


def test_a_device_that_never_follows_is_the_fault_that_its_driver_makes_of_it(slow: Slow) -> None:
    def give_up() -> None:
        raise DeviceFaultError("it does not follow")

    with pytest.raises(DeviceFaultError):
        slow.go(lambda: setattr(slow.driver, "before_read", give_up))
    assert slow.tick.guard.latched
    assert not any(slow.written)
    assert slow.codes[-1] == EventCode.DEVICE_FAULT


@pytest.mark.parametrize("asked", [False, True], ids=["", "as somebody asks to arm it"])
def test_one_that_follows_no_more_while_armed_is_a_fault_and_gets_no_force_back(slow: Slow, asked: bool) -> None:
    """Telemetry went on with 10 N, and all of it came back in one tick once the device followed again."""

    def lapse() -> None:
        if len(slow.enabled) in (100, 110):
            slow.driver.forces_flow = len(slow.enabled) == 110
        if len(slow.enabled) == 100 and asked:
            slow.shared.post({"do": "arm"})

    slow.driver.before_read = lapse
    with pytest.raises(DeviceFaultError, match="follows no more"):
        slow.go()
    assert len(slow.enabled) == 100
    assert slow.tick.guard.latched
    assert slow.driver.state is DriverState.CLOSED


def test_a_law_that_cannot_start_when_it_follows_leaves_it_disarmed_and_says_why(
    slow: Slow, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise ZeroDivisionError("not now")

    slow.go(lambda: monkeypatch.setattr(plugins.law("none"), "start", refuse))
    assert not any(slow.written)
    assert not any(slow.enabled[FOLLOWS + 1 :])
    (said,) = [event.text for event in slow.told if event.code == EventCode.DISARMED]
    assert said.startswith("stays disarmed: ")
    assert "not now" in said
    assert slow.verdict == (None if slow.auto_arm else said.removeprefix("stays disarmed: "))


def test_what_needs_a_disarmed_device_waits_for_one_that_arms_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else walls would move under a hand that is about to feel them."""
    slow = Slow(monkeypatch, auto_arm=True)
    slow.go(lambda: slow.shared.post({"do": "tare"}))
    assert slow.verdict is not None
    assert "`hapticd disarm` first" in slow.verdict
    assert EventCode.ARMED in slow.codes
