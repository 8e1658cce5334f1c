"""Requests, faults and losses in any order: what is acknowledged is done, and nothing arms that was told not to.

The loop itself runs, in a thread that stands still between ticks; its clock, its device and the supervisor's words are
the test's.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from hapticd import plugins
from hapticd.config.loading import parse
from hapticd.device import DeviceInfo, Sample
from hapticd.driver import Driver, DriverOptions
from hapticd.errors import DeviceDisconnectedError, DeviceFaultError, DriverError
from hapticd.loop.loop import ControlLoop
from hapticd.loop.memory import (
    ANSWERED,
    DISARM,
    DISARMED,
    DISARMED_SINCE,
    REQUESTS,
    SUPERVISOR_BEAT,
    EventReader,
    SharedMemory,
)
from hapticd.loop.resume import FROM_START, left_by
from hapticd.supervisor.reload import switch_request
from hapticd.tick.assemble import make_tick
from hapticd.tick.event import EventCode
from hapticd.tick.guard import Mode
from hapticd.tick.record import RecordLayout
from tests.examples import TIMES
from tests.loop.clock import Clock
from tests.tick.rig import device

PERIOD_S = 1e-3
RAMP_S = 0.02
WALL = "[[scene.walls]]\nstiffness_n_per_m = {}\n[safety]\nramp_s = 0.02\n[controller]\nlaw = '{}'\n"
SCENES = [parse(WALL.format(*each), "x") for each in ((1000.0, "none"), (2000.0, "none"), (1000.0, "tdpa"))]
ERRORS = (DeviceDisconnectedError, DeviceFaultError)
FATES = st.tuples(st.sampled_from(["read", "write"]), st.sampled_from(ERRORS))


class Fated(Driver[DriverOptions]):
    """A pressed device; what befalls it at its next read or write is set from outside.

    Args:
        clock: the loop's.
        prepares: reads after it was enabled before it follows what is written.
    """

    def __init__(self, clock: Clock, prepares: int) -> None:
        super().__init__(DriverOptions(), PERIOD_S)
        self.clock = clock
        self.prepares = prepares
        self.left = 0
        self.read_s = 0.0
        self.frozen = False
        self.fate: tuple[str, type[DriverError]] | None = None
        self.force_n = 0.0
        self.sample = Sample(1)
        self.sample.position_m[0] = -3e-3

    def _open(self) -> DeviceInfo:
        return device(has_sequence=True)

    def _enable(self) -> None:
        self.force_n = 0.0
        self.left = self.prepares
        self.forces_flow = not self.left

    def _read(self) -> Sample:
        self._befall("read")
        self.clock.pass_s(self.read_s)
        self.left -= 1
        if self.left <= 0:
            self.forces_flow = True
        if not self.frozen:
            self.sample.sequence += 1
        return self.sample

    def _write(self, force_n: Sequence[float]) -> None:
        self._befall("write")
        assert self.forces_flow or not any(force_n), "it would come in one step"
        self.force_n = force_n[0]

    def _disable(self) -> None:
        self.force_n = 0.0

    def _close(self) -> None: ...

    def _befall(self, where: str) -> None:
        if self.fate is not None and self.fate[0] == where:
            raise self.fate[1]("gone")


class AnyOrder(RuleBasedStateMachine):
    """The model: whether forces may be on, and whether a fault waits to be cleared."""

    def __init__(self) -> None:
        super().__init__()
        self.patch = pytest.MonkeyPatch()
        self.clock = Clock(self.patch)
        self.may_be_armed = False
        self.latched = False
        self.tared = False
        self.asked: dict[str, Any] | None = None
        self.config = SCENES[0]
        self.let_go_s = -math.inf
        self.resume = FROM_START
        self.auto_arm = False
        self.prepares = 0

    @initialize(auto_arm=st.booleans())
    def begin(self, auto_arm: bool) -> None:
        self.auto_arm = auto_arm
        self.may_be_armed = auto_arm
        self.start()

    def start(self) -> None:
        """A loop on the device, from what the one before has left."""
        self.driver = Fated(self.clock, self.prepares)
        info = self.driver.open()
        self.shared = SharedMemory(RecordLayout(1, False, 8), 1000.0)
        self.events = EventReader(self.shared)
        self.beat()
        settings = self.config.config
        self.tick = make_tick(self.config, info)
        self.loop = ControlLoop(
            self.driver,
            self.tick,
            self.shared,
            settings.loop,
            settings.safety,
            self.auto_arm and self.resume.may_arm,
            self.sleep_until,
            self.resume,
        )
        for name in plugins.names(plugins.CONTROLLERS):
            self.loop.requests.know(name, plugins.law(name))
        self.go, self.stands = threading.Semaphore(0), threading.Semaphore(0)
        self.thread = threading.Thread(target=self.run_loop, daemon=True)
        self.thread.start()
        self.stands.acquire()
        self.hear()

    def run_loop(self) -> None:
        try:
            self.loop.run()
        except DriverError:
            pass
        finally:
            self.ended = True
            self.stands.release()

    ended = False

    def sleep_until(self, deadline_ns: int) -> int:
        self.stands.release()
        self.go.acquire()
        return self.clock.sleep_until(deadline_ns)

    def beat(self) -> None:
        self.shared.words[SUPERVISOR_BEAT] = self.clock.now_ns

    def one_tick(self, beat: bool = True) -> None:
        if beat:
            self.beat()
        self.go.release()
        self.stands.acquire()
        self.hear()
        if self.ended:
            self.go_on()

    def hear(self) -> None:
        """What the loop tells, and what follows for the model."""
        for event in self.events.read():
            if event.is_fault and event.code != EventCode.DEVICE_LOST:
                self.fault()
            if event.code == EventCode.CLEARED:
                self.latched = False
            if event.code == EventCode.ARMED:
                assert self.may_be_armed, "it armed, and was told not to"
                if self.asked is not None:
                    self.asked["armed"] = True
        if self.tick.fault:  # told with the next tick
            self.fault()
        if self.asked is not None and self.answered:
            asked, self.asked = self.asked, None
            self.hear_verdict(asked, self.shared.verdict())

    def fault(self) -> None:
        self.latched = True
        self.let_go()

    def let_go(self) -> None:
        if self.may_be_armed:
            self.let_go_s = self.clock.now_s
        self.may_be_armed = False

    def hear_verdict(self, asked: dict[str, Any], verdict: str) -> None:
        do, done = asked["do"], verdict == ""
        if do == "arm":
            if done:
                assert not asked["withdrawn"] or asked["armed"], "disarming was asked for before it was done"
                assert not asked["latched"], "a fault waits to be cleared"
            elif asked["withdrawn"]:
                assert self.latched or verdict == DISARMED_SINCE
            if not done and not asked["was_armed"]:
                self.may_be_armed = False
        elif do == "clear":
            assert done  # and what `latched_until_cleared` says
        elif do == "tare":
            assert not done or self.tick.guard.mode is Mode.DISARMED, "tared while forces are let through"
            self.tared = self.tared or done
        else:
            assert done
            self.config = asked["config"]
            assert self.tick.contacts[0].wall.stiffness_n_per_m == self.config.config.scene.walls[0].stiffness_n_per_m

    @property
    def answered(self) -> bool:
        return bool(self.shared.words[REQUESTS] == self.shared.words[ANSWERED])

    def go_on(self) -> None:
        """The device is found again."""
        self.thread.join()
        left = left_by(self.shared, self.driver._info or device())
        assert left.latched == self.latched, "a fault stays until it is cleared"
        may_arm = left.may_arm and not left.latched
        assert not may_arm or (self.may_be_armed and not self.tared)
        if not (may_arm and self.auto_arm):
            self.may_be_armed = False
        self.asked = None
        self.tared = False
        self.resume = left
        self.ended = False
        self.let_go_s = -math.inf
        self.shared.close()
        self.start()

    # What may happen

    def ask(self, request: dict[str, Any], **known: Any) -> None:
        self.shared.post(dict(request))
        self.asked = {**request, "withdrawn": False, "armed": False, "latched": self.latched, **known}

    @precondition(lambda self: self.asked is None)
    @rule()
    def arm(self) -> None:
        was_armed = self.may_be_armed
        self.may_be_armed = self.may_be_armed or not self.latched
        self.ask({"do": "arm"}, was_armed=was_armed)

    @precondition(lambda self: self.asked is None)
    @rule()
    def arm_and_disarm(self) -> None:
        """Before the loop looks at either."""
        self.arm()
        self.disarm()

    @precondition(lambda self: self.asked is None)
    @rule()
    def mend_and_arm(self) -> None:
        """A healthy device, cleared and armed, lets forces through."""
        self.driver.frozen, self.driver.fate, self.driver.read_s = False, None, 0.0
        self.driver.sample.position_m[0] = -3e-3
        self.device_prepares(0)
        self.ticks(100)
        self.clear()
        self.ticks(2)
        self.arm()
        self.ticks(2)
        assert self.tick.guard.mode is Mode.ARMED

    @precondition(lambda self: self.asked is None)
    @rule()
    def clear(self) -> None:
        self.ask({"do": "clear"})

    @precondition(lambda self: self.asked is None)
    @rule()
    def tare(self) -> None:
        self.ask({"do": "tare"})

    @precondition(lambda self: self.asked is None)
    @rule(to=st.integers(0, len(SCENES) - 1))
    def switch(self, to: int) -> None:
        self.ask(switch_request(self.config, SCENES[to]), config=SCENES[to])

    @rule()
    def disarm(self) -> None:
        self.shared.words[DISARM] += 1
        self.let_go()
        if self.asked is not None:
            self.asked["withdrawn"] = True

    @rule(count=st.integers(1, 30))
    def ticks(self, count: int) -> None:
        for _ in range(count):
            self.one_tick()

    @rule()
    def supervisor_stalls(self) -> None:
        self.clock.pass_s(10.0)
        self.let_go_s += 10.0  # the loop stood still as well
        self.one_tick(beat=False)

    @rule(read_s=st.sampled_from([0.0, 0.0, 2e-3, 0.03, 0.09]))
    def reads_take(self, read_s: float) -> None:
        self.driver.read_s = read_s

    @rule(prepares=st.sampled_from([0, 0, 1, 10, 60]))
    def device_prepares(self, prepares: int) -> None:
        """From the next time on that it is enabled."""
        self.prepares = self.driver.prepares = prepares

    @rule(frozen=st.booleans())
    def device_is_frozen(self, frozen: bool) -> None:
        self.driver.frozen = frozen

    @rule(at_m=st.sampled_from([-3e-3, -3e-3, 0.01, math.nan, 5.0]))
    def device_is_at(self, at_m: float) -> None:
        self.driver.sample.position_m[0] = at_m

    @rule(fate=FATES)
    def device_is_lost(self, fate: tuple[str, type[DriverError]]) -> None:
        self.driver.fate = fate
        self.one_tick()

    @rule()
    def law_fails(self) -> None:
        self.tick.fail_law(EventCode.LAW_OVER_BUDGET, "slow")
        self.fault()

    # What always holds

    @invariant()
    def armed_only_if_it_may_be(self) -> None:
        words = self.shared.words
        if words[DISARM] == words[DISARMED] and self.tick.guard.mode is Mode.ARMED:
            assert self.may_be_armed

    @invariant()
    def latched_until_cleared(self) -> None:
        assert self.tick.guard.latched == self.latched

    @invariant()
    def no_force_is_left_once_a_ramp_is_over(self) -> None:
        """A disarm that is asked for is seen one tick later; then the ramp, and the read during which it ends."""
        if not self.may_be_armed and self.driver.force_n != 0.0:
            assert self.clock.now_s - self.let_go_s <= RAMP_S + 3.0 * (0.09 + PERIOD_S)

    def teardown(self) -> None:
        if hasattr(self, "thread"):
            self.loop.session.stop_requested = True
            self.driver.read_s = 0.0
            while not self.ended:
                self.go.release()
                self.stands.acquire()
            self.thread.join()
            self.shared.close()
        self.patch.undo()


AnyOrder.TestCase.settings = settings(max_examples=60 * TIMES, stateful_step_count=40, deadline=None)


class TestAnyOrder(AnyOrder.TestCase):  # type: ignore[misc, valid-type]  # hypothesis makes the class
    """Runs it."""
