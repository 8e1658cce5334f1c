"""What every family of motor controllers has to show where one takes a moment to follow: the hand feels the ramp."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from types import ModuleType
from typing import ClassVar

import pytest

from hapticd.config.loading import parse
from hapticd.driver import DriverState
from hapticd.errors import DeviceFaultError
from hapticd.loop.loop import ControlLoop
from hapticd.loop.memory import DISARM, DISARMED, SUPERVISOR_BEAT, EventReader, RecordReader, SharedMemory
from hapticd.tick.assemble import make_tick
from hapticd.tick.event import EventCode
from hapticd.tick.record import RecordLayout, TickRecord
from tests.drivers.device_time import DeviceTime
from tests.drivers.motors.bench import PATIENCE_S, Controller
from tests.drivers.motors.lab import MOST_N_M, RADIUS_M, MotorLab

HELD_N = 3.0
STIFFNESS_N_PER_M = 600.0
MOST_STEP_N = 1.1 * HELD_N / 50.0
"""From one millisecond to the next, by `safety.ramp_s`."""

ASKED = 5
TICKS = 250

CONFIG = f"""
[device]
driver = "{{family}}"
[device.options]
channel = "/dev/null"
[[device.options.axes]]
id = 1
radius_m = {RADIUS_M}
max_torque_n_m = {MOST_N_M}
lowest_m = -0.05
highest_m = 0.05
[[scene.walls]]
axis = "x"
stiffness_n_per_m = {STIFFNESS_N_PER_M}
[[scene.walls]]
axis = "y"
stiffness_n_per_m = {STIFFNESS_N_PER_M}
[controller]
law = "none"
[safety]
max_speed_m_per_s = 20.0
"""


class Armed:
    """The daemon's own loop on two motors that a hand holds in their walls; it is asked to arm.

    Args:
        bench: where they are.
        family: of their driver.
        monkeypatch: of the test.

    Attributes:
        records: of its ticks.
        codes: of its events.
        given_n: what each shaft was driven with, millisecond by millisecond [N].
        enabled: whether the driver was enabled as each tick began.
        following: from which tick on all motors follow; None: they do not.
    """

    def __init__(self, bench: MotorLab, family: str, monkeypatch: pytest.MonkeyPatch) -> None:
        self.bench = bench
        self.given_n: list[list[float]] = [[] for _ in bench.controllers]
        for controller, given_n in zip(bench.controllers, self.given_n, strict=True):
            noting(controller, given_n, monkeypatch)
            shaft = controller.shaft
            shaft.grip_n_per_m, shaft.grip_n_s_per_m = 20000.0, 60.0
            shaft.x_m = shaft.grip_m = -HELD_N / STIFFNESS_N_PER_M
        self.driver = bench.driver()
        self.driver._state_wait_s = PATIENCE_S  # a busy computer is no fault
        loaded = parse(CONFIG.format(family=family), "test")
        tick = make_tick(loaded, self.driver.open())
        self.shared = SharedMemory(RecordLayout(2, False, 8), 1000.0)
        self.shared.words[SUPERVISOR_BEAT] = 1 << 62
        self.records: list[TickRecord] = []
        self.codes: list[int] = []
        self.enabled: list[bool] = []
        self.following: int | None = None
        self._clock = DeviceTime(TICKS)
        monkeypatch.setattr("hapticd.loop.loop.time", self._clock)
        settings = loaded.config
        self._loop = ControlLoop(
            self.driver, tick, self.shared, settings.loop, settings.safety, False, self._sleep_until
        )
        self._clock.loop = self._loop
        self._reader = RecordReader(self.shared)
        self._at: dict[int, Callable[[], None]] = {}

    def run(self, at: dict[int, Callable[[], None]] | None = None) -> None:
        """Run, with something done before some ticks."""
        self._at = at or {}
        events = EventReader(self.shared)
        try:
            self._loop.run()
        finally:
            self.codes = [event.code for event in events.read()]
            self.shared.close()

    def _sleep_until(self, deadline_ns: int) -> int:
        number = len(self.enabled)
        self.records += self._reader.read()
        self.enabled.append(self.driver.state is DriverState.ENABLED)
        if self.following is None and all(controller.follows for controller in self.bench.controllers):
            self.following = number
        if number == ASKED:
            self.shared.post({"do": "arm"})
        if number in self._at:
            self._at[number]()
        return self._clock.sleep_until(deadline_ns)


def noting(controller: Controller, given_n: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    """Have what a controller drives its shaft with be written down, millisecond by millisecond [N]."""
    advance = controller.advance

    def advance_and_note(duration_s: float) -> None:
        advance(duration_s)
        given_n.append(controller.torque_n_m / RADIUS_M)

    monkeypatch.setattr(controller, "advance", advance_and_note)


class MotorArmingContract:
    """A family inherits it, and has a fixture `bench` of two motors whose states are waited for with patience."""

    FAMILY: ClassVar[str]

    CREW: ClassVar[ModuleType]
    """Where its patience is."""

    PATIENCE: ClassVar[str]
    """Its name there."""

    @pytest.fixture
    def armed(self, bench: MotorLab, monkeypatch: pytest.MonkeyPatch) -> Armed:
        monkeypatch.setattr(self.CREW, self.PATIENCE, PATIENCE_S)
        return Armed(bench, self.FAMILY, monkeypatch)

    @pytest.mark.parametrize("prepare", [(0, 0), (5, 5), (60, 60), (5, 90), (90, 0)], ids=str)
    def test_the_force_comes_in_by_the_ramp_once_all_follow_and_none_is_told_before(
        self, armed: Armed, prepare: tuple[int, int]
    ) -> None:
        """It came in one step: all of it, where the ramp was over by then."""
        for controller, preparing in zip(armed.bench.controllers, prepare, strict=True):
            controller.preparing = preparing
        armed.run()
        following = armed.following
        assert following is not None
        assert following >= max(prepare)
        for record in armed.records[:following]:
            assert not any(record.force_n)
            assert not record.energy_j
        for axis, given_n in enumerate(armed.given_n):
            assert armed.records[TICKS - 5].force_n[axis] == pytest.approx(HELD_N, rel=0.1)
            rising = given_n[: given_n.index(max(given_n)) + 1]
            assert rising[-1] == pytest.approx(HELD_N, rel=0.1)
            assert max(after - before for before, after in itertools.pairwise(rising)) <= MOST_STEP_N
        assert armed.codes[:2] == [EventCode.STARTED, EventCode.ARMED]

    def test_one_that_has_followed_before_is_waited_for_again(self, armed: Armed) -> None:
        driver, zero_n = armed.driver, [0.0, 0.0]
        for preparing in (0, 20, 0):
            armed.bench.controllers[1].preparing = preparing
            driver.enable()
            flows = [driver.forces_flow]
            for _ in range(60):
                driver.write(zero_n)
                driver.read()
                flows.append(driver.forces_flow)
                assert armed.bench.controllers[1].follows or not flows[-1]
            assert flows[-1]
            assert sum(not flow for flow in flows) >= preparing
            driver.disable()
        armed.shared.close()

    def test_disarming_while_one_gets_ready_lets_go_at_once_and_no_force_comes(self, armed: Armed) -> None:
        armed.bench.controllers[1].preparing = 60
        words = armed.shared.words
        answered: list[int] = []

        def disarm() -> None:
            words[DISARM] += 1

        armed.run({30: disarm, 31: lambda: answered.append(words[DISARMED])})
        assert answered == [1]
        assert armed.enabled[ASKED + 1 : 32] == [True] * (30 - ASKED) + [False]
        assert not any(newton for given_n in armed.given_n for newton in given_n)
        assert armed.codes == [EventCode.STARTED, EventCode.DISARMED]

    def test_one_that_never_follows_is_a_fault_after_its_time_and_no_force_comes(
        self, armed: Armed, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(self.CREW, self.PATIENCE, 0.02)
        armed.bench.first.preparing = 100_000
        with pytest.raises(DeviceFaultError, match="has let go"):
            armed.run()
        assert not any(newton for given_n in armed.given_n for newton in given_n)
        assert armed.codes == [EventCode.STARTED, EventCode.DEVICE_FAULT]
