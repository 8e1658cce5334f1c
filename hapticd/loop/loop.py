"""The loop: sleep to the deadline, read, tick, write, record. Nothing else may wait, log or send here."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from hapticd.config.models import LoopConfig, SafetyConfig
from hapticd.device import Sample
from hapticd.driver import Driver, DriverState
from hapticd.errors import DeviceFaultError, DeviceProtocolError, DriverError, HapticdError
from hapticd.loop.memory import (
    CONTROL_BEAT,
    DISARM,
    DISARMED,
    DONE,
    MAIL,
    RECORDS,
    SKIPPED,
    SUPERVISOR_BEAT,
    SharedMemory,
)
from hapticd.loop.requests import RequestHandler
from hapticd.loop.resume import FROM_START, ResumeState
from hapticd.tick.event import EventCode, LoopEvent
from hapticd.tick.guard import Mode
from hapticd.tick.record import Flag
from hapticd.tick.tick import ControlTick

BUDGET_TICKS = 10
BUDGET_MISSES = 3
"""A law fails when this many of the last `BUDGET_TICKS` ticks computed for longer than the budget."""

STOP_RAMP_S = 0.05
"""Longest ramp to zero at a stop [s]: whoever killed the supervisor may not have the patience for more."""

BURST_TICKS = 10
"""Deadlines skipped in one go that are worth an event, one a second at most."""

LATE_S = 0.05
"""A real device is released when so much more time was skipped than kept: its last force was held all the while [s]."""

_UNCALIBRATED = int(Flag.UNCALIBRATED)


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
        before: where the loop before stopped, when this one goes on for it.

    Attributes:
        stop_requested: set by a signal or a letter; the force is ramped to zero and the loop ends.
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
        before: ResumeState = FROM_START,
    ) -> None:
        self.driver = driver
        self.tick = tick
        self.shared = shared
        self.loop = loop
        self.stop_requested = False
        self.law_count = before.law
        self.seq = before.seq
        self._skipped = before.skipped
        tick.guard.latched = before.latched
        self._deadline_ns = 0
        self._burst_due_ns = 0
        self._sleep_until = sleep_until
        self._auto_arm = auto_arm
        layout = shared.layout
        self._area = shared.record_area
        self._slots = shared.slots
        self._slot_size = layout.size
        self._has_orientation = layout.orientation
        self._packs = [layout.struct(walls).pack_into for walls in range(layout.max_walls + 1)]
        driver.share_metrics(shared.metrics)
        self.requests = RequestHandler(self)
        self.stall_ns = int(safety.supervisor_stall_s * 1e9)
        self._stopping = False
        self._stalled = False

    def event(self, code: EventCode, text: str, **fields: float | int | str) -> None:
        """Tell the supervisor that something happened."""
        at_ns = self._deadline_ns or time.monotonic_ns()  # before the first tick there is no deadline
        self.shared.write_event(LoopEvent(code, text, self.seq, at_ns, fields))

    def arm(self) -> bool:
        """Enable the device and let forces through; False while latched or on the way out.

        Raises:
            DriverError: the device refuses.
        """
        if self.tick.guard.latched or self.stop_requested:
            return False
        self.driver.enable()
        self.tick.arm()
        self.event(EventCode.ARMED, "armed: forces are let through")
        return True

    def run(self) -> None:
        """Tick until a stop is requested; whatever happens, the device is left without force.

        Raises:
            DriverError: the device was lost.
        """
        try:
            self.requests.worker.start()
            self._run()
        except DriverError as error:
            if isinstance(error, DeviceFaultError):
                self.event(EventCode.DEVICE_FAULT, f"the device reports a fault: {error}")
            else:
                self.event(EventCode.DEVICE_LOST, f"device lost: {error}")
            raise
        finally:
            self.driver.close()
            self.requests.worker.end()

    def _start(self) -> None:
        """Find out where the device is, and arm it where that needs no one's word."""
        try:
            self.tick.start(self.driver.read())
        except HapticdError:
            raise
        except Exception as error:
            raise _nonsense(error) from error
        self.event(EventCode.STARTED, f"the loop runs at {self.loop.rate_hz:g} Hz", rate_hz=self.loop.rate_hz)
        if self._auto_arm:
            try:
                self.arm()
            except DriverError as error:
                self.event(EventCode.DISARMED, f"stays disarmed: {error}")

    def _run(self) -> None:
        driver = self.driver
        tick = self.tick
        guard = tick.guard
        shared = self.shared
        words = shared.words
        sleep_until = self._sleep_until
        read = driver.read
        write = driver.write
        step = tick.step
        monotonic_ns = time.monotonic_ns
        thread_time_ns = time.thread_time_ns
        period_ns = self.loop.period_ns
        disarmed = Mode.DISARMED
        enabled = DriverState.ENABLED
        budget_ns = int(self.loop.law_budget * period_ns)
        all_ticks = (1 << BUDGET_TICKS) - 1
        most_late = max(BURST_TICKS, int(LATE_S * 1e9) // period_ns)
        misses = 0
        late = 0
        words[SKIPPED] = skipped = self._skipped
        busy_us = 0.0

        self._start()
        # Deadlines are whole multiples of the period, so that an outside witness can share them.
        deadline_ns = monotonic_ns() // period_ns * period_ns + 2 * period_ns
        last_ns = deadline_ns - period_ns
        cpu_ns = thread_time_ns()
        while True:
            woke_ns = sleep_until(deadline_ns)
            self._deadline_ns = deadline_ns

            try:
                sample = read()
                force_n = step(sample, (woke_ns - last_ns) * 1e-9)
                if driver.state is enabled:  # the zero at the end of a release as well
                    write(force_n)
                last_ns = woke_ns

                if tick.fault:
                    self._report_fault()
                busy_us = (monotonic_ns() - woke_ns) * 1e-3
                self._record(sample, deadline_ns, (woke_ns - deadline_ns) * 1e-3, busy_us, skipped)
            except HapticdError:
                raise
            except Exception as error:  # a law's are caught in the tick, so this is the driver's
                raise _nonsense(error) from error
            words[CONTROL_BEAT] = woke_ns

            if words[MAIL] != words[DONE]:
                used_ns = thread_time_ns()
                self.requests.work()
                cpu_ns += thread_time_ns() - used_ns  # no law is to answer for what somebody asked for
            if words[DISARM] != words[DISARMED]:
                self.requests.disarm()
            if self.stop_requested and not self._stopping:
                self._stopping = True
                tick.release(min(tick.ramp_s, STOP_RAMP_S))
            if guard.mode is disarmed:
                if driver.state is enabled:
                    driver.disable()
                if self._stopping:
                    return
            if words[SUPERVISOR_BEAT] + self.stall_ns < woke_ns:
                if not self._stalled:
                    self._stalled = True
                    tick.fail(EventCode.SUPERVISOR_STALLED, f"no sign of the supervisor for {self.stall_ns * 1e-9:g} s")
            elif self._stalled:
                self._stalled = False

            self.seq += 1
            deadline_ns += period_ns
            now_ns = monotonic_ns()
            if deadline_ns < now_ns:
                behind = (now_ns - deadline_ns) // period_ns + 1
                skipped += behind
                deadline_ns += behind * period_ns
                words[SKIPPED] = skipped
                late += behind
                if late >= most_late and guard.mode is Mode.ARMED and not tick.info.simulated:
                    tick.fail(EventCode.LOOP_LATE, f"{late} more deadlines were missed than met")
                elif behind >= BURST_TICKS and now_ns >= self._burst_due_ns:
                    self._burst_due_ns = now_ns + 1_000_000_000
                    self.event(EventCode.OVERRUN_BURST, f"{behind} deadlines were missed at once", skipped=behind)
            elif late:
                late -= 1

            used_ns = thread_time_ns()
            misses = misses << 1 & all_ticks
            # Getting in and out of the sleep costs processor time as well, and is not the law's.
            if used_ns - cpu_ns > budget_ns and now_ns - woke_ns > budget_ns:
                misses |= 1
                if misses.bit_count() >= BUDGET_MISSES:
                    tick.fail_law(
                        EventCode.LAW_OVER_BUDGET,
                        f"the tick computed for more than {budget_ns * 1e-3:.0f} us in {BUDGET_MISSES} of "
                        f"{BUDGET_TICKS} ticks",
                    )
                    self._report_fault()
            cpu_ns = used_ns

    def _record(self, sample: Sample, deadline_ns: int, late_us: float, busy_us: float, skipped: int) -> None:
        tick = self.tick
        motion = tick.motion
        past = tick.past
        energy_j = past.energy_j
        stored_j = past.stored_j
        dissipated_j = past.dissipated_j
        generated_j = past.generated_j
        walls: list[float] = []
        for contact in tick.contacts:
            ledger = contact.ledger
            energy_j += ledger.energy_j
            stored_j += ledger.stored_j
            dissipated_j += ledger.dissipated_j
            generated_j += ledger.generated_j
            walls += (
                contact.in_contact,
                contact.damping_n_s_per_m,
                contact.felt_mass_kg,
                ledger.cycle,
                ledger.cycle_energy_j,
                ledger.cycle_generated_j,
                ledger.cycle_damping_n_s_per_m,
                ledger.cycle_duration_s,
            )
        for contact in tick.leaving:
            ledger = contact.ledger
            energy_j += ledger.energy_j
            stored_j += ledger.stored_j
            dissipated_j += ledger.dissipated_j
            generated_j += ledger.generated_j
        words = self.shared.words
        written = words[RECORDS]
        count = len(tick.contacts)
        self._packs[count](
            self._area,
            written % self._slots * self._slot_size,
            self.seq,
            deadline_ns,
            late_us,
            busy_us,
            motion.dt_s,
            skipped,
            tick.flags if sample.calibrated else tick.flags | _UNCALIBRATED,
            self.law_count,
            sample.buttons,
            sample.gripper_m,
            energy_j,
            stored_j,
            dissipated_j,
            generated_j,
            count,
            *motion.position_m,
            *motion.velocity_m_per_s,
            *tick.force_n,
            *tick.requested_n,
            *(sample.orientation if self._has_orientation else ()),
            *walls,
        )
        words[RECORDS] = written + 1

    def _report_fault(self) -> None:
        tick = self.tick
        if tick.fault:
            self.event(EventCode(tick.fault), tick.fault_text)
            tick.fault = 0


def _nonsense(error: Exception) -> DriverError:
    """What a driver raised that is no error of a driver, or what came of a sample that is none."""
    return DeviceProtocolError(f"its driver failed: {type(error).__name__}: {error}")
