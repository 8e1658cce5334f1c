"""The loop: sleep to the deadline, read, tick, write, record. Nothing else may wait, log or send here."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from hapticd.config.models import LoopConfig
from hapticd.config.safety import SafetyConfig
from hapticd.driver import Driver, DriverState
from hapticd.errors import DeviceFaultError, DeviceProtocolError, DriverError, HapticdError, PluginError, in_words
from hapticd.loop.law_budget import BUDGET_MISSES, BUDGET_TICKS, LawBudget
from hapticd.loop.memory import (
    ANSWERED,
    DISARM,
    DISARMED,
    RECORDS,
    REMOTE,
    REQUESTS,
    SKIPPED,
    SUPERVISOR_BEAT,
    SharedMemory,
)
from hapticd.loop.requests import RequestHandler
from hapticd.loop.resume import FROM_START, ResumeState
from hapticd.loop.session import Session
from hapticd.tick.event import EventCode
from hapticd.tick.guard import Mode
from hapticd.tick.tick import ControlTick

STOP_RAMP_S = 0.05
"""Longest ramp to zero at a stop [s]: what killed the supervisor may not wait for more."""

BURST_TICKS = 10
"""Deadlines skipped in one go that are worth an event, one a second at most."""

LATE_S = 0.05
"""A real device is released when this much more time was skipped than kept: its last force was held for it [s]."""


class ControlLoop:
    """Owns the driver and runs the tick.

    Args:
        driver: an open driver.
        tick: what happens between sample and force.
        shared: the memory shared with the supervisor.
        loop: the [loop] table.
        safety: the [safety] table.
        auto_arm: arm as soon as the loop runs.
        sleep_until: sleeps to a CLOCK_MONOTONIC time and returns when it woke [ns].
        resume: where the loop before stopped, when this one goes on for it.

    Attributes:
        session: what it shares with the requests that change it.
        requests: works off what the supervisor asks for.
    """

    def __init__(
        self,
        driver: Driver[Any],
        tick: ControlTick,
        shared: SharedMemory,
        loop: LoopConfig,
        safety: SafetyConfig,
        auto_arm: bool,
        sleep_until: Callable[[int], int],
        resume: ResumeState = FROM_START,
    ) -> None:
        self.session = Session(driver, tick, shared, safety.supervisor_stall_s, resume)
        self.requests = RequestHandler(self.session)
        self._loop = loop
        self._auto_arm = auto_arm
        self._sleep_until = sleep_until
        self._burst_due_ns = 0
        self._stopping = False
        self._stalled = False
        driver.share_metrics(shared.metrics)
        driver.trace.share(shared.trace)

    def run(self) -> None:
        """Tick until a stop is requested; whatever happens, the device is left without force.

        Raises:
            DriverError: the device was lost.
        """
        session = self.session
        try:
            self.requests.worker.start()
            self._start()
            try:
                self._run()
            finally:
                self._leave()
        except DriverError as error:
            if isinstance(error, DeviceFaultError):
                session.latch()
                session.event(EventCode.DEVICE_FAULT, f"the device reports a fault: {error}")
            else:
                session.event(EventCode.DEVICE_LOST, f"device lost: {error}")
            raise
        finally:
            session.driver.close()
            self.requests.worker.end()

    def _start(self) -> None:
        """Find out where the device is, and arm it where that needs no one's word."""
        session = self.session
        try:
            session.tick.start(session.driver.read())
        except PluginError as error:  # warmed up, but not where the device is
            session.tick.fail_law(EventCode.LAW_FAILED, str(error))
        except HapticdError:
            raise
        except Exception as error:
            raise _nonsense(error, session.driver) from error
        rate_hz = self._loop.rate_hz
        session.event(EventCode.STARTED, f"the loop runs at {rate_hz:g} Hz", rate_hz=rate_hz)
        if self._auto_arm:
            session.enable_or_tell()

    def _run(self) -> None:
        session = self.session
        driver = session.driver
        tick = session.tick
        guard = tick.guard
        shared = session.shared
        words = shared.words
        requests = self.requests
        wait = self._waiting()
        read = driver.read
        write = driver.write
        monotonic_ns = time.monotonic_ns
        period_ns = self._loop.period_ns
        disarmed = Mode.DISARMED
        enabled = DriverState.ENABLED
        budget_ns = int(self._loop.law_budget * period_ns)
        budget = LawBudget(budget_ns)
        most_late = int(LATE_S * 1e9) // period_ns
        late = 0
        skipped = session.skipped
        area = shared.record_area
        slots = shared.slots
        size = shared.layout.size
        layout = shared.layout
        layout.serve(tick)

        # Deadlines are whole multiples of the period, so that an outside witness can share them.
        deadline_ns = monotonic_ns() // period_ns * period_ns + 2 * period_ns
        last_ns = deadline_ns - period_ns
        while True:
            woke_ns = wait(deadline_ns)
            session.deadline_ns = deadline_ns

            try:
                sample = read()
                read_ns = monotonic_ns()  # a read may have taken long, and a force is held from write to write
                force_n = tick.advance(sample, (read_ns - last_ns) * 1e-9)
                if driver.state is enabled:  # the zero at the end of a release as well
                    write(force_n)
                last_ns = read_ns

                if tick.fault:
                    session.report_fault()
                busy_us = (monotonic_ns() - woke_ns) * 1e-3
                written = words[RECORDS]
                layout.pack(
                    area,
                    written % slots * size,
                    tick,
                    sample,
                    session.seq,
                    deadline_ns,
                    (woke_ns - deadline_ns) * 1e-3,
                    busy_us,
                    skipped,
                    session.law_count,
                )
                words[RECORDS] = written + 1
            except HapticdError:
                raise
            except Exception as error:  # a law's are caught in the tick, so this is the driver's
                raise _nonsense(error, session.driver) from error

            forceless = guard.mode is disarmed
            if words[DISARM] != words[DISARMED]:
                session.disarm()
            if words[REQUESTS] != words[ANSWERED]:
                requests.work()
                late_ns = monotonic_ns() - read_ns
                if late_ns > period_ns:  # a law's start is anybody's code, and a write may have stood still
                    tick.begin_late(late_ns * 1e-9)
                wait = self._waiting()
            if not driver.forces_flow and guard.mode is not disarmed:  # all of the force would be back at once
                raise DeviceFaultError("it follows no more: see what took the force away, then arm")
            if session.arming:
                session.go_on_arming()
            if session.stop_requested and not self._stopping:
                self._stopping = True
                tick.release(min(tick.ramp_s, STOP_RAMP_S))
            if guard.mode is disarmed:
                late = 0  # what was missed of a force that has been let go counts for no other
                if driver.state is enabled and not session.arming:
                    driver.disable()
                if self._stopping:
                    return
                if driver.force_left:  # also after an arm that failed; whoever opens it anew has other ways
                    raise DeviceProtocolError(f"it may not have let go: {driver.force_left}")
            if words[SUPERVISOR_BEAT] + session.stall_ns < woke_ns:
                if not self._stalled:
                    self._stalled = True
                    tick.fail(
                        EventCode.SUPERVISOR_STALLED, f"no sign of the supervisor for {session.stall_ns * 1e-9:g} s"
                    )
            elif self._stalled:
                self._stalled = False

            session.seq += 1
            deadline_ns += period_ns
            now_ns = monotonic_ns()
            if deadline_ns < now_ns:
                behind = (now_ns - deadline_ns) // period_ns + 1
                skipped += behind
                deadline_ns += behind * period_ns
                words[SKIPPED] = session.skipped = skipped
                if not (forceless or guard.mode is disarmed):  # to enable a device takes its time, without force
                    late += behind
                if late >= most_late and guard.mode is Mode.ARMED and not tick.info.simulated:
                    tick.fail(EventCode.LOOP_LATE, f"{late} more deadlines were missed than met")
                elif behind >= BURST_TICKS and now_ns >= self._burst_due_ns:
                    self._burst_due_ns = now_ns + 1_000_000_000
                    session.event(EventCode.OVERRUN_BURST, f"{behind} deadlines were missed at once", skipped=behind)
            elif late:
                late -= 1

            took_ns = now_ns - woke_ns
            if budget.watched or took_ns > budget_ns:
                if budget.is_exceeded(took_ns, tick.law_ns):
                    tick.fail_law(
                        EventCode.LAW_OVER_BUDGET,
                        f"the law computed for more than {budget_ns * 1e-3:.0f} us in {BUDGET_MISSES} of "
                        f"{BUDGET_TICKS} ticks",
                    )
                    tick.begin_late((now_ns - read_ns) * 1e-9)
                    session.report_fault()
                tick.law_clock = time.thread_time_ns if budget.watched else None
                tick.law_ns = 0

    def _waiting(self) -> Callable[[int], int]:
        """How to wait for a deadline: where clients drive something, with a look at what they have said until then."""
        session = self.session
        sleep_until = self._sleep_until
        ports = session.tick.ports
        if not ports:
            return sleep_until
        words = session.shared.words
        said = session.said

        def wait(deadline_ns: int) -> int:
            woke_ns = sleep_until(deadline_ns)
            if words[REMOTE] != said.seen:
                said.take(woke_ns)
            for port in ports:
                if port.news is not None:
                    session.report_port(port)
            return woke_ns

        return wait

    def _leave(self) -> None:
        """Tell of a fault of the last tick, and leave what the next loop on this device goes on from."""
        self.session.report_fault()
        self.session.leave()


def _nonsense(error: Exception, driver: Driver[Any]) -> DriverError:
    """What a driver raised that is no error of a driver, or what came of a sample that is none."""
    return DeviceProtocolError(f"its driver failed: {in_words(error, type(driver).__module__)}")
