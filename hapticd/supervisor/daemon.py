"""The daemon: what `hapticd run` does until it is told to stop."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import time

from hapticd.config.loading import LoadedConfig
from hapticd.keys.policy import key_ring
from hapticd.keys.store import KeyRing
from hapticd.paths import CONTROL, TELEMETRY, fault_directory
from hapticd.supervisor.child import END_TIMEOUT_S, LoopStart
from hapticd.supervisor.commands import CommandHandler, CommandSocket
from hapticd.supervisor.events import EventLog, log
from hapticd.supervisor.force_release import ForceRelease
from hapticd.supervisor.lock import InstanceLock
from hapticd.supervisor.recovery import Recovery
from hapticd.supervisor.reload import Reload
from hapticd.supervisor.request_queue import RequestQueue
from hapticd.supervisor.status import StatusBuilder
from hapticd.supervisor.systemd import Notifier
from hapticd.supervisor.terminal import Terminal
from hapticd.telemetry.publisher import Publisher
from hapticd.telemetry.wire import measure_epoch_offset_ns
from hapticd.tick.event import EventCode, LoopEvent
from hapticd.tick.record import Flag, TickRecord

DRAIN_S = 0.01
"""How often tick records are fetched and published, at least [s]."""

WAKE_NS = 4_000_000
"""How late a turn may come without a tick waiting for longer than the telemetry promises [ns]."""

STATUS_S = 1.0
STOP_TIMEOUT_S = 3.0
"""How long the loop may take to ramp the force out and to let go of the device [s]."""

RECORD_TIMEOUT_S = 3.0
"""How long the end of the daemon waits for a fault record that is being written [s]."""

_FORCES = Flag.ARMED | Flag.RELEASING


def pause_s(flush_due_ns: int | None, now_ns: int) -> float:
    """How long to sleep until the next turn, which comes early when ticks wait to be sent [s]."""
    return DRAIN_S if flush_due_ns is None else max(0.0, min(DRAIN_S, (flush_due_ns - WAKE_NS - now_ns) * 1e-9))


class Daemon:
    """One running daemon.

    Args:
        config: what to run.
        instance: name of the instance, which is also that of its runtime directory.

    Raises:
        HapticdError: it cannot start; nothing is left behind.
    """

    def __init__(self, config: LoadedConfig, instance: str) -> None:
        self.config = config
        self.instance = instance
        self.notifier = Notifier()
        self.exit_code: int | None = None
        self._terminal = Terminal()
        offset_ns = measure_epoch_offset_ns()
        ring = key_ring(config)
        with contextlib.ExitStack() as undo:
            self.lock = InstanceLock(instance)
            undo.callback(self.lock.close)
            self.release = ForceRelease(config)
            undo.callback(self.release.close)
            self.release.wait_ready()  # before there can be a force to take away; that nobody stands by is told later
            self.control = LoopStart(config).wait()
            undo.callback(self._end_control)
            self.publisher = Publisher(
                config.config.telemetry, self.lock.directory / TELEMETRY, self.control.info, offset_ns, ring
            )
            undo.callback(self.publisher.close)
            self.commands = CommandSocket(self.lock.directory / CONTROL, config.config.control.tcp, ring)
            undo.callback(self.commands.close)
            self.requests = RequestQueue(self.control.shared)
            self.recovery = Recovery()
            self.report = StatusBuilder(instance, offset_ns, config.path.absolute())
            self.event_log = EventLog(instance, self.publisher, self.report, fault_directory(instance), offset_ns)
            self.orders = CommandHandler(self)
            self.reload = Reload(self)
            undo.callback(self.reload.close)
            self._undo = undo.pop_all()
        self._device_lost: LoopEvent | None = None
        self._problem = ""
        self._status_due_s = 0.0
        self._stopping = False
        self._stop_by_s = 0.0

    def run(self) -> int:
        """Serve until told to stop; returns the exit code."""
        try:
            return asyncio.run(self._serve())
        finally:
            self._undo.close()

    def adopt(self, config: LoadedConfig, ring: KeyRing | None) -> None:
        """Go on with another configuration and other keys; the loop has its part already."""
        self.config = config
        self.publisher.reconfigure(config.config.telemetry)
        if ring is not None:
            self.publisher.admit(ring)
            self.commands.admit(ring)
        self._status_due_s = 0.0

    def stop(self, why: str) -> None:
        """Let the loop ramp the force out, and end.

        Args:
            why: who or what wants it.
        """
        if self._stopping:
            return
        self._stopping = True
        self._stop_by_s = time.monotonic() + STOP_TIMEOUT_S
        self.notifier.send("STOPPING=1")
        self.tell_now(EventCode.STOPPING, f"{why}: ramping the force out")
        if self.recovery.lost:
            self.exit_code = 0
        self.control.stop()

    def tell_now(self, code: EventCode, text: str, **fields: float | int | str) -> None:
        """Tell of an event that the supervisor itself has to report.

        Args:
            code: what it is.
            text: in a line.
            fields: what programs may want to know of it.
        """
        self.event_log.tell_now(code, text, self.config, self.control, **fields)

    def _end_control(self) -> None:
        """See that nobody holds a force any more, whatever the daemon ends for."""
        if not self.control.end() and self.exit_code != 1:  # else it has been seen to
            log.error("the control loop did not end and was killed; %s", self.release.release())
        self.control.close()

    async def _serve(self) -> int:
        loop = asyncio.get_running_loop()
        loop.add_signal_handler(signal.SIGTERM, self.stop, "SIGTERM")
        loop.add_signal_handler(signal.SIGINT, self.stop, "interrupt")
        loop.add_signal_handler(signal.SIGHUP, self._hang_up)
        settings = self.config.config
        log.info(
            "%s: %s on %s at %g Hz, law %s, publishing on %s",
            self.instance,
            self.control.info.model,
            settings.device.driver,
            settings.loop.rate_hz,
            settings.controller.law,
            " and ".join(self.publisher.endpoints) or "nothing",
        )
        if self.commands.endpoint is not None:
            log.info("%s: taking commands on %s", self.instance, self.commands.endpoint)
        if self.control.realtime:
            for warning in self.control.warnings:
                log.warning("%s", warning)
        else:
            self.tell_now(EventCode.NOT_REALTIME, f"not real-time: {'; '.join(self.control.warnings)}")
        for note in self.control.info.notes:
            log.warning("%s", note)
        while self.exit_code is None:
            self._turn()
            await asyncio.sleep(pause_s(self.publisher.flush_due_ns, time.monotonic_ns()))
        self.recovery.stop()
        self.requests.abandon("the daemon has stopped")
        self.event_log.close(self.config, self.control, RECORD_TIMEOUT_S)
        return self.exit_code

    def _turn(self) -> None:
        """One round: show that we live, fetch and publish, look after the loop or for its device."""
        now_s = time.monotonic()
        self.control.beat()
        self._publish()
        if self.recovery.lost:
            self._look_for_device()
        else:
            self._look_after_loop(now_s)
        # After it is known whether there is a device: whoever was told that it is lost may say what shall be when it is
        # back.
        self.orders.turn()
        self.reload.turn()
        self.requests.turn()  # last, so that whoever gets an answer finds it in the status as well
        self.event_log.turn(self.config, self.control)
        if now_s >= self._status_due_s:
            self._look_after_helper()
        if (now_s >= self._status_due_s or self.event_log.news) and self.exit_code is None:
            self._status_due_s = now_s + STATUS_S
            self.event_log.news = False
            self._publish_status()

    def _publish(self) -> int:
        """Fetch and publish what the loop has recorded; how many ticks."""
        before = self.report.last
        records = self.control.reader.read()
        self.report.add(records)
        if records:
            if before is None:
                self.notifier.send("READY=1")
            self.notifier.feed_watchdog()
            if before is None or (before.flags ^ records[-1].flags) & ~Flag.LIMITED:
                self._status_due_s = 0.0
        self.publisher.publish(records)
        self.publisher.flush(time.monotonic_ns() + WAKE_NS)
        for event in self.control.events.read():
            self.event_log.tell(event, self.config, self.control)
            if event.code in (EventCode.DEVICE_LOST, EventCode.DEVICE_FAULT):
                self._device_lost = event
                self.control.stall_s = END_TIMEOUT_S
        ticks, events = self.control.newly_dropped()
        self.report.add_dropped(ticks, events)
        for lost, what in ((ticks, "ticks"), (events, "events")):
            if lost:
                self.tell_now(EventCode.RING_DROPPED, f"{lost} {what} were overwritten before they were published")
        return len(records)

    def _look_after_loop(self, now_s: float) -> None:
        ended = self.control.exit_code is not None
        while ended and self._publish():
            pass
        if self._stopping and not (self.report.last and self.report.last.flags & _FORCES):
            self.control.stall_s = STOP_TIMEOUT_S  # without a force, and a driver may take its time to let go
        if self._device_lost is not None and self.report.last is not None and not self._stopping:
            self._begin_recovery(self._device_lost, self.report.last)
        elif ended:
            self._control_ended()
        elif self.control.stalled():
            self._control_lost(f"the control loop stood still for more than {self.control.stall_s:g} s")
        elif self._stopping and now_s > self._stop_by_s:
            self._control_lost(f"the control loop did not stop within {STOP_TIMEOUT_S:g} s")

    def _look_after_helper(self) -> None:
        """Tell when nobody stands by to take the force away; the status says so as long as it is so."""
        before, self._problem = self._problem, self.release.problem if self.exit_code is None else ""
        if self._problem and not before:
            self.tell_now(EventCode.NOBODY_STANDS_BY, self._problem)

    def _look_for_device(self) -> None:
        """Try again when it is time; that nothing ticks meanwhile is no reason for systemd to intervene."""
        self.notifier.feed_watchdog()
        control = self.recovery.turn(self.control, self.config)
        if control is None:
            return
        self.control.close()
        self.control = control
        self.requests = RequestQueue(control.shared)
        self.report.expect(self.recovery.before)
        away_s = time.monotonic() - self.recovery.lost_s
        self.tell_now(EventCode.DEVICE_FOUND, f"the device is back after {away_s:.1f} s", away_s=away_s)

    def _hang_up(self) -> None:
        """SIGHUP: from a person a reload, from a terminal that is closed the end."""
        if self._terminal.closed():
            self.stop("the terminal was closed")
        else:
            self.reload.ask()

    def _control_ended(self) -> None:
        self.event_log.recorder.loop_ended()
        code = self.control.exit_code
        if self._stopping and (code == 0 or self._device_lost is not None):
            log.info("stopped")
            self.exit_code = 0
        else:
            how = f"was killed by signal {-code}" if code and code < 0 else f"ended with exit code {code}"
            self._control_lost(f"the control process {how}")

    def _begin_recovery(self, event: LoopEvent, last: TickRecord) -> None:
        """The loop has told that its device is gone; it is just ending."""
        self._device_lost = None
        while self._publish():
            pass
        self.event_log.recorder.loop_ended()
        self.requests.turn()  # what the loop has still answered
        self.requests.abandon(event.text)
        why = event.text.removeprefix("device lost: ")
        report = self.report
        self.recovery.begin(self.control, report.last or last, self.event_log.latched, report.tared, why)

    def _control_lost(self, text: str) -> None:
        """The loop no longer looks after the device: take the force away from outside, and end."""
        self.control.kill()
        outcome = self.release.release()
        self.tell_now(EventCode.CONTROL_LOST, f"{text}; {outcome}")
        self.exit_code = 1

    def _publish_status(self) -> None:
        written = self.event_log.recorder.written
        status = self.report.make(self.config, self.control, self.recovery, written, self._problem)
        self.publisher.status(status.as_map())
        doing = f"no device: {self.recovery.why}" if self.recovery.lost else f"{self.report.rate_hz:.0f} Hz"
        self.notifier.send(f"STATUS={doing}, law {status.law}")
