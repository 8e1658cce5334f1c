"""What a loop leaves to the next one on the same device, whatever happened in its last tick."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import pytest

from hapticd.config.loading import parse
from hapticd.device import DeviceInfo, Sample
from hapticd.driver import Driver, DriverOptions
from hapticd.errors import DeviceDisconnectedError, DeviceFaultError, DriverError
from hapticd.loop.loop import ControlLoop
from hapticd.loop.memory import DISARM, DISARMED, SUPERVISOR_BEAT, EventReader, SharedMemory
from hapticd.loop.resume import FROM_START, ResumeState, identity, left_by
from hapticd.tick.assemble import make_tick
from hapticd.tick.event import EventCode
from hapticd.tick.record import RecordLayout
from tests.tick.rig import device

LOST_AT = 50
WALL = "[[scene.walls]]\nstiffness_n_per_m = 1000.0\n"
BEFORE = ResumeState(seq=700, skipped=3, law=2, may_arm=True, latched=True, device="")


class Vanishing(Driver[DriverOptions]):
    """A device that is pressed into a wall and gone at a read or a write."""

    def __init__(self, error: Exception, at: int, where: str) -> None:
        super().__init__(DriverOptions(), 1e-3)
        self._sample = Sample(1)
        self._sample.position_m[0] = -5e-3
        self._left = at
        self._error = error
        self._where = where

    def _open(self) -> DeviceInfo:
        return device()

    def _enable(self) -> None: ...

    def _read(self) -> Sample:
        self._count("read")
        return self._sample

    def _write(self, force_n: Sequence[float]) -> None:
        self._count("write")

    def _disable(self) -> None: ...

    def _close(self) -> None: ...

    def _count(self, where: str) -> None:
        if where == self._where:
            self._left -= 1
            if self._left < 0:
                raise self._error


@pytest.fixture
def shared() -> Iterator[SharedMemory]:
    memory = SharedMemory(RecordLayout(1, False, 8), 1000.0)
    memory.words[SUPERVISOR_BEAT] = time.monotonic_ns() + 10**15
    yield memory
    memory.close()


def nothing(_loop: ControlLoop, _number: int) -> None: ...


def lose(
    shared: SharedMemory,
    each_tick: Callable[[ControlLoop, int], None] = nothing,
    error: Exception | None = None,
    at: int = LOST_AT,
    where: str = "read",
    resume: ResumeState = FROM_START,
    auto_arm: bool = True,
) -> ResumeState:
    """Run until the device is gone; what is left. `each_tick` is told the number of the tick to come."""
    loaded = parse(WALL, "x")
    driver = Vanishing(error or DeviceDisconnectedError("unplugged"), at, where)
    info = driver.open()
    ticks = iter(range(10_000))

    def sleep_until(_deadline_ns: int) -> int:
        each_tick(loop, next(ticks))
        return time.monotonic_ns()

    settings = loaded.config
    tick = make_tick(loaded, info)
    loop = ControlLoop(driver, tick, shared, settings.loop, settings.safety, auto_arm, sleep_until, resume)
    with pytest.raises(DriverError):
        loop.run()
    return left_by(shared, info)


def last_tick(do: Callable[[ControlLoop], object]) -> Callable[[ControlLoop, int], None]:
    """Do something right before the read that fails: the first read is that of the start."""

    def each_tick(loop: ControlLoop, number: int) -> None:
        if number == LOST_AT - 1:
            do(loop)

    return each_tick


@pytest.mark.parametrize("where", ["read", "write"])
def test_a_device_that_was_armed_may_arm_again_and_ticks_count_on(shared: SharedMemory, where: str) -> None:
    left = lose(shared, where=where)
    assert (left.may_arm, left.latched, left.law) == (True, False, 0)
    assert left.seq == LOST_AT - (where == "read")


@pytest.mark.parametrize("error", [DeviceDisconnectedError, DeviceFaultError])
def test_a_device_that_goes_before_it_follows_may_arm_again_unless_that_is_a_fault(
    shared: SharedMemory, monkeypatch: pytest.MonkeyPatch, error: type[DriverError]
) -> None:
    monkeypatch.setattr(Vanishing, "_enable", lambda self: setattr(self, "forces_flow", False))
    left = lose(shared, error=error("gone"))
    assert (left.may_arm, left.latched) == (error is DeviceDisconnectedError, error is DeviceFaultError)


def test_a_device_that_was_disarmed_stays_disarmed(shared: SharedMemory) -> None:
    def each_tick(_loop: ControlLoop, number: int) -> None:
        if number == 5:
            shared.words[DISARM] += 1

    assert not lose(shared, each_tick).may_arm


def test_disarming_asked_for_in_the_tick_in_which_the_device_goes_is_kept(shared: SharedMemory) -> None:
    """C3: it was forgotten, and the device armed by itself when it came back."""

    def ask(_loop: ControlLoop) -> None:
        shared.words[DISARM] += 1

    assert not lose(shared, last_tick(ask)).may_arm


def test_disarming_that_was_acknowledged_right_before_the_device_goes_is_kept(shared: SharedMemory) -> None:
    """C3: what was left said that the device may arm, since the last record did."""

    def each_tick(_loop: ControlLoop, number: int) -> None:
        if number == LOST_AT - 2:
            shared.words[DISARM] += 1
        elif number == LOST_AT - 1:
            assert shared.words[DISARMED] == shared.words[DISARM]

    assert not lose(shared, each_tick).may_arm


def test_a_fault_in_the_tick_in_which_the_device_goes_is_told_and_latched(shared: SharedMemory) -> None:
    """C3: as a loop that is late because its device does not answer any more."""
    left = lose(shared, last_tick(lambda loop: loop.session.tick.fail(EventCode.LOOP_LATE, "late")))
    assert (left.may_arm, left.latched) == (False, True)
    codes = [event.code for event in EventReader(shared).read()]
    assert codes[-2:] == [EventCode.LOOP_LATE, EventCode.DEVICE_LOST]


@pytest.mark.parametrize("at", [0, LOST_AT])
def test_a_fault_of_the_device_itself_is_latched_from_its_first_sample_on(shared: SharedMemory, at: int) -> None:
    left = lose(shared, error=DeviceFaultError("too hot"), at=at)
    assert (left.latched, left.may_arm) == (True, False), "to clear it while the device is away does not arm"


@pytest.mark.parametrize(("where", "at"), [("read", 0), ("read", LOST_AT), ("write", LOST_AT)])
def test_a_driver_that_raises_anything_else_has_lost_its_device(shared: SharedMemory, where: str, at: int) -> None:
    """Its fault is the driver's, and neither the loop's nor the law's."""
    left = lose(shared, error=ZeroDivisionError("its own"), at=at, where=where)
    (*_, last) = EventReader(shared).read()
    assert last.code == EventCode.DEVICE_LOST
    said, _, place = last.text.partition(" (")
    assert said == "device lost: its driver failed: ZeroDivisionError: its own"
    assert place.startswith("test_leaving.py:")
    assert not left.latched


def test_a_device_that_was_tared_does_not_arm_by_itself(shared: SharedMemory) -> None:
    def each_tick(loop: ControlLoop, number: int) -> None:
        if number == 5:
            assert loop.session.tick.tare()
        elif number == 10:
            assert loop.session.arm()

    assert not lose(shared, each_tick, auto_arm=False).may_arm


def test_a_device_that_goes_before_its_first_tick_leaves_what_was_left_before(shared: SharedMemory) -> None:
    left = lose(shared, at=0, resume=BEFORE)
    assert (left.seq, left.skipped, left.law) == (BEFORE.seq, BEFORE.skipped, BEFORE.law)
    assert (left.may_arm, left.latched) == (True, True)


def test_a_fault_stays_latched_through_every_loop_until_it_is_cleared(shared: SharedMemory) -> None:
    left = lose(shared, resume=BEFORE)
    assert left.latched
    assert not left.may_arm, "it never armed"
    cleared = lose(shared, last_tick(lambda loop: loop.session.tick.guard.clear()), resume=left)
    assert not cleared.latched
    assert cleared.seq == BEFORE.seq + 2 * (LOST_AT - 1)


def test_an_arm_that_was_sent_before_disarming_was_asked_for_does_not_arm(shared: SharedMemory) -> None:
    """C10: however late the loop finds it: the two words are not read at once."""

    def each_tick(_loop: ControlLoop, number: int) -> None:
        if number == 5:
            shared.post({"do": "arm"})
            shared.words[DISARM] += 1

    left = lose(shared, each_tick, auto_arm=False)
    assert not left.may_arm
    assert "disarming was asked for after it" in shared.verdict()
    assert EventCode.ARMED not in [event.code for event in EventReader(shared).read()]


def test_an_arm_that_is_found_after_a_disarm_was_acknowledged_does_not_arm(
    shared: SharedMemory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """C10: the loop is held up between the look at the one and the look at the other."""

    def each_tick(loop: ControlLoop, number: int) -> None:
        if number == 5:
            monkeypatch.setattr(loop.requests, "work", lambda: None)
            shared.post({"do": "arm"})
            shared.words[DISARM] += 1
        elif number == 6:
            assert shared.words[DISARMED] == shared.words[DISARM]
            monkeypatch.undo()

    left = lose(shared, each_tick, auto_arm=False)
    assert not left.may_arm
    assert "disarming was asked for after it" in shared.verdict()
    assert EventCode.ARMED not in [event.code for event in EventReader(shared).read()]


def test_a_device_is_known_again_by_all_that_subscribers_were_told_of_it() -> None:
    one = device(serial="7")
    assert identity(one) == "a device 7 (z)"
    assert identity(replace(one, serial="", buttons=2)) == "a device (z, 2 buttons)"
    others = [
        replace(one, model="another"),
        replace(one, serial="8"),
        device("x", serial="7"),
        replace(one, buttons=1),
        replace(one, has_gripper=True),
        replace(one, has_orientation=True),
    ]
    assert len({identity(info) for info in (one, *others)}) == 7
