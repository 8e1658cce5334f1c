"""The loop itself, on a driver that writes down what it is told."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence

import pytest

from hapticd.config.loading import parse
from hapticd.device import DeviceInfo, Sample
from hapticd.driver import Driver, DriverOptions
from hapticd.loop.loop import ControlLoop
from hapticd.loop.memory import ANSWERED, DISARM, REQUESTS, SUPERVISOR_BEAT, EventReader, SharedMemory
from hapticd.tick.assemble import make_tick
from hapticd.tick.event import EventCode
from hapticd.tick.record import RecordLayout
from tests.loop.clock import Clock
from tests.tick.rig import device

PRESSED_M = -5e-3
RELEASED_FAST = "[safety]\nramp_s = 0.001\n"
WALL = "[[scene.walls]]\nstiffness_n_per_m = 1000.0\n"


class Diary(Driver[DriverOptions]):
    """A device that is pressed into the wall, and writes down forces and what is done with it."""

    def __init__(self) -> None:
        super().__init__(DriverOptions(), 1e-3)
        self.told: list[float | str] = []
        self._sample = Sample(1)

    def _open(self) -> DeviceInfo:
        return device()

    def _enable(self) -> None:
        self.told.append("enable")

    def _read(self) -> Sample:
        self._sample.position_m[0] = PRESSED_M
        return self._sample

    def _write(self, force_n: Sequence[float]) -> None:
        self.told.append(force_n[0])

    def _disable(self) -> None:
        self.told.append("disable")

    def _close(self) -> None:
        self.told.append("close")


Run = Callable[[str, Callable[[ControlLoop, int], None]], Diary]


@pytest.fixture
def shared() -> Iterator[SharedMemory]:
    memory = SharedMemory(RecordLayout(1, False, 8), 1000.0)
    memory.words[SUPERVISOR_BEAT] = time.monotonic_ns() + 10**15  # there is none that could stall
    yield memory
    memory.close()


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


@pytest.fixture
def run(shared: SharedMemory, clock: Clock) -> Run:
    def run(text: str, each_tick: Callable[[ControlLoop, int], None]) -> Diary:
        """Run armed until somebody stops it; `each_tick` is told the loop and the number of the tick to come."""
        loaded = parse(WALL + text, "x")
        settings = loaded.config
        driver = Diary()
        ticks = iter(range(10_000))

        def sleep_until(deadline_ns: int) -> int:
            each_tick(loop, next(ticks))
            return clock.sleep_until(deadline_ns)

        tick = make_tick(loaded, driver.open())
        loop = ControlLoop(driver, tick, shared, settings.loop, settings.safety, True, sleep_until)
        loop.run()
        return driver

    return run


@pytest.mark.parametrize("how", ["disarmed", "stopped", "after a fault"])
def test_the_last_force_that_a_device_is_told_is_zero(run: Run, shared: SharedMemory, how: str) -> None:
    """A device that should ignore being disabled holds nothing then."""

    def each_tick(loop: ControlLoop, number: int) -> None:
        if number == 100 and how == "disarmed":
            shared.words[DISARM] += 1
        elif number == 100 and how == "after a fault":
            loop.session.tick.fail(EventCode.OVER_SPEED, "too fast")
        elif number == 200:
            loop.session.stop_requested = True

    told = run(RELEASED_FAST, each_tick).told
    assert max(force_n for force_n in told if isinstance(force_n, float)) == pytest.approx(5.0)
    assert told[told.index("disable") - 1] == 0.0


def test_the_time_that_a_request_takes_is_not_the_laws(
    run: Run, shared: SharedMemory, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each slice computes for twice a period; a law that did so would be replaced after three ticks."""
    slices = iter(range(10))

    def each_tick(loop: ControlLoop, number: int) -> None:
        def work() -> None:
            end_ns = time.thread_time_ns() + 2_000_000
            while time.thread_time_ns() < end_ns:
                pass
            clock.pass_s(2e-3)
            if next(slices) == 9:
                shared.words[ANSWERED] = shared.words[REQUESTS]

        if number == 20:
            monkeypatch.setattr(loop.requests, "work", work)
            shared.words[REQUESTS] += 1
        loop.session.stop_requested = number == 100

    events = EventReader(shared)
    run("", each_tick)
    codes = [event.code for event in events.read()]
    assert shared.words[ANSWERED] == shared.words[REQUESTS] == 1
    assert EventCode.LAW_OVER_BUDGET not in codes
    assert codes[0] == EventCode.STARTED


def test_disarming_waits_behind_no_request(run: Run, shared: SharedMemory, monkeypatch: pytest.MonkeyPatch) -> None:
    def each_tick(loop: ControlLoop, number: int) -> None:
        if number == 20:
            monkeypatch.setattr(loop.requests, "work", lambda: None)  # one that takes for ever
            shared.words[REQUESTS] += 1
        elif number == 40:
            shared.words[DISARM] += 1
        loop.session.stop_requested = number == 1000

    told = run("", each_tick).told
    assert told.index("disable") < 200


@pytest.mark.parametrize(("ramp_s", "ticks"), [(0.5, 50), (0.02, 20)])
def test_a_stop_lets_go_within_its_own_time_and_within_the_ramp(run: Run, ramp_s: float, ticks: int) -> None:
    """What stops a daemon may not wait for a ramp of half a second."""
    stopped_at: list[int] = []

    def each_tick(loop: ControlLoop, number: int) -> None:
        if number == 700:
            loop.session.stop_requested = True
            assert isinstance(loop.session.driver, Diary)
            stopped_at.append(len(loop.session.driver.told))

    told = run(f"[safety]\nramp_s = {ramp_s}\n", each_tick).told
    after = [force_n for force_n in told[stopped_at[0] :] if isinstance(force_n, float)]
    assert after[0] == pytest.approx(5.0)
    assert after[-1] == 0.0
    assert len(after) == pytest.approx(ticks, abs=2)
