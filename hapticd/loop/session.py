"""What the loop and the requests that change it have in common: the device, the tick, the counts, the events."""

from __future__ import annotations

import time
from typing import Any

from hapticd.driver import Driver
from hapticd.errors import DriverError, PluginError
from hapticd.loop.memory import (
    DISARM,
    DISARMED,
    DISARMED_SINCE,
    FIELDS,
    LATCHED,
    LAW,
    LAW_CODE,
    MAY_ARM,
    NEXT_SEQ,
    PORT_LAW_CODE,
    SKIPPED,
    SharedMemory,
)
from hapticd.loop.remote_slots import SlotReader
from hapticd.loop.resume import ResumeState
from hapticd.tick.event import EventCode, LoopEvent
from hapticd.tick.guard import Mode
from hapticd.tick.remote.port import Port
from hapticd.tick.remote.port_state import PortState
from hapticd.tick.tick import ControlTick


class Session:
    """One loop on one device, from its first tick to its last.

    Args:
        driver: an open driver.
        tick: what happens between sample and force.
        shared: the memory shared with the supervisor.
        stall_s: how long the supervisor may be silent [s].
        resume: where the loop before stopped, when this one goes on for it.

    Attributes:
        seq: number of the tick under way.
        skipped: deadlines skipped so far.
        law_count: index of the law activation, counted up at each switch.
        deadline_ns: when the tick under way was due [ns of CLOCK_MONOTONIC]; 0 before the first.
        stall_ns: how long the supervisor may be silent [ns].
        stop_requested: the force is to be ramped to zero and the loop to end.
        arming: the device has been enabled and does not follow yet: the tick stays disarmed, and zero is written.
        refusal: why the last arming has come to nothing; "" when it has not.
        said: what clients say of what they may drive.
    """

    def __init__(
        self, driver: Driver[Any], tick: ControlTick, shared: SharedMemory, stall_s: float, resume: ResumeState
    ) -> None:
        self.driver = driver
        self.tick = tick
        self.shared = shared
        self.seq = resume.seq
        self.skipped = resume.skipped
        self.law_count = resume.law
        self.deadline_ns = 0
        self.stall_ns = int(stall_s * 1e9)
        self.stop_requested = False
        self.arming = False
        self.refusal = ""
        self.said = SlotReader(shared)
        self.said.serve(tick.ports, 0)
        tick.guard.latched = resume.latched
        words = shared.words
        words[NEXT_SEQ] = resume.seq
        words[SKIPPED] = resume.skipped
        words[LAW] = resume.law
        words[MAY_ARM] = resume.may_arm
        words[LATCHED] = resume.latched
        words[LAW_CODE] = resume.law_code
        words[PORT_LAW_CODE] = resume.port_law_code
        words[FIELDS] = resume.fields

    def event(self, code: EventCode, text: str, **fields: float | int | str) -> None:
        """Tell the supervisor that something happened."""
        at_ns = self.deadline_ns or time.monotonic_ns()  # before the first tick there is no deadline
        self.shared.write_event(LoopEvent(code, text, self.seq, at_ns, fields))

    def arm(self) -> bool:
        """Enable the device and let forces through: now, or once it follows; False while latched or on the way out.

        Raises:
            DriverError: the device refuses.
            PluginError: the law cannot start.
        """
        self.refusal = self._stopped()
        if self.refusal:
            return False
        self.driver.enable()
        self.arming = True
        self._let_through()
        return True

    def go_on_arming(self) -> None:
        """Let forces through once the device follows, unless something has come between: called after each tick."""
        self.refusal = self._stopped()
        if self.refusal:
            self.arming = False
            return
        try:
            self._let_through()
        except PluginError as error:
            self.refusal = str(error)
            self.event(EventCode.DISARMED, f"stays disarmed: {error}")

    def disarm(self) -> None:
        """Let go: the request that waits behind no other."""
        words = self.shared.words
        asked = words[DISARM]
        if self.arming:
            self.arming = False
            self.refusal = DISARMED_SINCE
        self.tick.release()
        self.event(EventCode.DISARMED, "disarmed: the force is ramped to zero")
        words[DISARMED] = asked

    def report_fault(self) -> None:
        """Tell of the fault that the tick has raised, if any."""
        tick = self.tick
        if tick.fault:
            self.event(EventCode(tick.fault), tick.fault_text)
            tick.fault = 0

    def report_port(self, port: Port) -> None:
        """Tell that what a client drives was let go, or is in force again."""
        news, port.news = port.news, None
        if news is PortState.STALE:
            text = (
                f"{port.name}: its client is silent or says the same for too long, or the device was tared, calibrated "
                "or found again: let go until it says more"
            )
            self.event(EventCode.REMOTE_STALE, text, name=port.name)
        elif news is not None:
            self.event(EventCode.REMOTE_BACK, f"{port.name}: in force again", name=port.name)

    def leave(self) -> None:
        """Write down what the next loop on this device goes on from; the tick has been started.

        A device that was tared counts elsewhere once it is opened anew, so it does not arm by itself.
        """
        tick = self.tick
        words = self.shared.words
        words[NEXT_SEQ] = self.seq
        words[SKIPPED] = self.skipped
        words[LAW] = self.law_count
        armed = self.arming or tick.guard.mode is Mode.ARMED
        words[MAY_ARM] = armed and not any(tick.motion.origin_m)
        words[LATCHED] = tick.guard.latched

    def latch(self) -> None:
        """Have the device stay disarmed until the fault that ended the loop is cleared, and somebody arms it."""
        self.tick.guard.latched = True
        words = self.shared.words
        words[LATCHED] = True
        words[MAY_ARM] = False

    def enable_or_tell(self) -> None:
        """Arm, where that needs no one's word; a device or a law that refuses: it stays disarmed and says why."""
        try:
            self.arm()
        except (DriverError, PluginError) as error:
            self.event(EventCode.DISARMED, f"stays disarmed: {error}")

    def _stopped(self) -> str:
        """Why nothing may be armed; "" when it may."""
        if self.stop_requested:
            return "the daemon is ending"
        return "stopped by a fault: `hapticd clear` first" if self.tick.guard.latched else ""

    def _let_through(self) -> None:
        """Arm the tick if the device follows: else all of the force would come at once when it does."""
        if self.driver.forces_flow:
            self.arming = False
            self.tick.arm()
            self.event(EventCode.ARMED, "armed: forces are let through")
