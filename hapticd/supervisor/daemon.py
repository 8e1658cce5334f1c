"""The daemon: what `hapticd run` does until it is to stop.

Its turn and all ways to its end are in one module: the order in which a force is taken away, told of and answered for
is what the others rely on.
"""

from __future__ import annotations

import asyncio
import contextlib
import signal
import time

from hapticd.config.loading import LoadedConfig
from hapticd.keys.connections import raise_descriptor_limit
from hapticd.keys.policy import key_ring
from hapticd.loop.resume import identity
from hapticd.paths import CONTROL, TELEMETRY, fault_directory, hold_file
from hapticd.supervisor.arm_hold import ArmHold
from hapticd.supervisor.child import END_TIMEOUT_S, LoopProcess, LoopStart
from hapticd.supervisor.command_handler import CommandHandler
from hapticd.supervisor.commands import CommandSocket
from hapticd.supervisor.events import EventLog, log
from hapticd.supervisor.force_release import ForceRelease
from hapticd.supervisor.lock import InstanceLock
from hapticd.supervisor.recovery import Recovery
from hapticd.supervisor.reload import Reload
from hapticd.supervisor.remote_process import RemoteProcess
from hapticd.supervisor.request_queue import RequestQueue
from hapticd.supervisor.sleep import SleepWatch
from hapticd.supervisor.state import DaemonState
from hapticd.supervisor.status import StatusBuilder
from hapticd.supervisor.systemd import Notifier
from hapticd.supervisor.terminal import Terminal
from hapticd.telemetry.clock import followed_offset_ns, measure_epoch_offset_ns
from hapticd.telemetry.publisher import Publisher
from hapticd.tick.event import EventCode, LoopEvent
from hapticd.tick.flags import FORCES, Flag
from hapticd.tick.record import TickRecord

DRAIN_S = 0.01
"""How often tick records are fetched and published, at least [s]."""

WAKE_NS = 4_000_000
"""How late a turn may come without a tick waiting for longer than the telemetry promises [ns]."""

STATUS_S = 1.0
STOP_TIMEOUT_S = 3.0
"""How long the loop may take to ramp the force out and to let go of the device [s]."""

RECORD_TIMEOUT_S = 3.0
"""How long the end of the daemon waits for a fault record that is being written [s]."""


def pause_s(flush_due_ns: int | None, now_ns: int) -> float:
    """How long to sleep until the next turn, which comes early when ticks wait to be sent [s]."""
    return DRAIN_S if flush_due_ns is None else max(0.0, min(DRAIN_S, (flush_due_ns - WAKE_NS - now_ns) * 1e-9))


def _noted(record: TickRecord) -> tuple[object, ...]:
    """What of a tick has a status published when it changes."""
    return record.flags & ~Flag.LIMITED, *(wall.stiffness_n_per_m for wall in record.walls)


class Daemon:
    """One running daemon.

    Args:
        config: what to run.
        instance: name of the instance, which is also that of its runtime directory.

    Raises:
        HapticdError: it cannot start; nothing is left behind.
    """

    def __init__(self, config: LoadedConfig, instance: str) -> None:
        self.exit_code: int | None = None
        self._instance = instance
        self._terminal = Terminal()
        self._offset_ns = offset_ns = measure_epoch_offset_ns()
        self._notifier = Notifier()
        ring, faults = key_ring(config), fault_directory(instance)
        self._few_descriptors = raise_descriptor_limit()
        with contextlib.ExitStack() as undo:
            self.lock = InstanceLock(instance)
            undo.callback(self.lock.close)
            self.release = ForceRelease(config)
            undo.callback(self.release.close)
            remote = RemoteProcess(self.lock)
            undo.callback(remote.close)
            remote.prepare(config)
            hold = ArmHold(hold_file(instance))
            # both import what they need at the same time
            start = LoopStart(config, self._rescue, self.release.mark, hold.resume(config), wait=True)
            with contextlib.ExitStack() as on_the_way:
                on_the_way.callback(start.end)
                self.release.wait_ready()  # before there can be a force to take away; if it is not, that is said later
                on_the_way.pop_all()
            start.go()
            loop = start.wait()
            self.release.name(identity(loop.info))  # no other takes its place for as long as the daemon runs
            starting = undo.enter_context(contextlib.ExitStack())
            starting.callback(self._end, loop)
            hold.follow(loop, 0, config, False)  # it may arm itself now, and this may die before its first turn
            publisher = Publisher(config.config.telemetry, self.lock.directory / TELEMETRY, loop.info, offset_ns, ring)
            undo.callback(publisher.close)
            commands = CommandSocket(self.lock.directory / CONTROL, config.config.control.tcp, ring)
            undo.callback(commands.close)
            remote.serve(config, loop, ring, offset_ns)
            remote.wait_ready()
            status = StatusBuilder(instance, offset_ns, config.path.absolute())
            event_log = EventLog(instance, publisher, status, faults, offset_ns)
            self.state = DaemonState(
                config=config,
                loop=loop,
                requests=RequestQueue(loop.shared),
                recovery=Recovery(self._rescue, self.release.mark),
                release=self.release,
                publisher=publisher,
                commands=commands,
                remote=remote,
                ring=ring,
                epoch_offset_ns=offset_ns,
                status=status,
                event_log=event_log,
                arm_hold=hold,
                notifier=self._notifier,
            )
            starting.pop_all()
            undo.callback(lambda: self._end(self.state.loop))  # by then it may be another one
            self._reload = Reload(self.state)
            undo.callback(self._reload.close)
            self._handler = CommandHandler(self.state)
            self._undo = undo.pop_all()
        self._device_lost: LoopEvent | None = None
        self._problem = ""
        self._stopping = False
        self._stop_code = 0
        self._sleep = SleepWatch()
        self._stop_by_s = 0.0

    def run(self) -> int:
        """Serve until it is to stop; returns the exit code."""
        try:
            return asyncio.run(self._serve())
        finally:
            self._undo.close()  # where it did not come as far as to serve

    def stop(self, why: str, exit_code: int = 0) -> None:
        """Let the loop ramp the force out, and end.

        Args:
            why: who or what wants it.
            exit_code: of the daemon, where nothing goes wrong meanwhile.
        """
        if self._stopping:
            return
        state = self.state
        self._stopping = True
        self._stop_code = exit_code
        self._stop_by_s = time.monotonic() + STOP_TIMEOUT_S
        state.notifier.send("STOPPING=1")
        state.tell(EventCode.STOPPING, f"{why}: ramping the force out")
        if state.recovery.lost:
            self.exit_code = exit_code
        state.loop.stop()

    def _end(self, loop: LoopProcess) -> None:
        """See that no force is left, whatever the daemon ends for."""
        self._end_force(loop)
        loop.close()

    def _end_force(self, loop: LoopProcess) -> None:
        why = loop.end()
        if why and not loop.force_seen_to:
            loop.force_seen_to = True
            log.error("%s; %s", why, self._take_force_away())
        if self.release.force_left:
            self.exit_code = 1

    def _rescue(self, why: str) -> None:
        """Take the force away from outside, and be ready to do so again: the daemon may go on."""
        log.error("%s; %s", why, self._take_force_away())
        with contextlib.suppress(OSError):  # no process can be started: the status warns of that
            self.release.renew()

    def _take_force_away(self) -> str:
        """What came of it, a line for people; helper and driver may hang for seconds, and the daemon does not."""
        return self._notifier.feed_during(self.release.release)

    async def _serve(self) -> int:
        signals = asyncio.get_running_loop()
        signals.add_signal_handler(signal.SIGTERM, self.stop, "SIGTERM")
        signals.add_signal_handler(signal.SIGINT, self.stop, "interrupt")
        signals.add_signal_handler(signal.SIGHUP, self._hang_up)
        try:
            return await self._serve_until_end()
        finally:
            self._undo.close()  # as long as signals are handled: a second Ctrl-C must not leave the force on

    async def _serve_until_end(self) -> int:
        state = self.state
        settings = state.config.config
        log.info(
            "%s: %s on %s at %g Hz, law %s, publishing on %s",
            self._instance,
            state.loop.info.model,
            settings.device.driver,
            settings.loop.rate_hz,
            settings.controller.law,
            " and ".join(state.publisher.endpoints) or "nothing",
        )
        if state.commands.endpoint is not None:
            log.info("%s: taking commands on %s", self._instance, state.commands.endpoint)
        if state.loop.realtime:
            for warning in state.loop.warnings:
                log.warning("%s", warning)
        else:
            state.tell(EventCode.NOT_REALTIME, f"not real-time: {'; '.join(state.loop.warnings)}")
        for line in filter(None, (self._few_descriptors, *state.loop.info.notes, *self._problems())):
            log.warning("%s", line)
        self._publish_status()  # a request that has come already is answered by it
        while self.exit_code is None:
            self._turn()
            await asyncio.sleep(pause_s(state.publisher.flush_due_ns, time.monotonic_ns()))
        self._end_force(state.loop)  # one that lost its device may hang, and no record is to be waited for before
        state.recovery.stop()
        self._handler.end(self.release.force_left)
        state.event_log.close(state.config, state.loop, RECORD_TIMEOUT_S)
        self._handler.end(self.release.force_left)  # for who has asked while that took its time
        if self._stopping and self.exit_code == self._stop_code == 0:
            state.arm_hold.end()
        return self.exit_code

    def _turn(self) -> None:
        """One round: show that we live, fetch and publish, look after the loop or for its device."""
        state = self.state
        now_s = time.monotonic()
        state.loop.beat()
        self._publish()
        if state.recovery.lost:
            self._look_for_device()
        else:
            self._look_after_loop(now_s)
        if not self._stopping and self.exit_code is None:
            self._hold()
        # After it is known whether there is a device: what is asked for then holds for when it is back.
        self._handler.turn()
        if slept_s := self._sleep.slept_s():
            log.warning("the computer slept for %.1f s, and the device is disarmed: `hapticd arm`", slept_s)
            self._handler.disarm()
        if state.stop_reason:
            self.stop(state.stop_reason)
        self._reload.turn()
        for text in state.remote.turn():
            state.tell(EventCode.REMOTE_LOST, text)
        state.requests.turn(state.loop.reader.fetched, state.status.flags)
        state.event_log.turn(state.config, state.loop)
        if now_s >= state.status_due_s:
            self._look_after_lock()
            self._look_after_helper()
            self._follow_clock()
        news = state.event_log.news or state.remote.news
        if (now_s >= state.status_due_s or news) and self.exit_code is None:
            state.status_due_s = now_s + STATUS_S
            state.event_log.news = state.remote.news = False
            self._publish_status()

    def _publish(self) -> int:
        """Fetch and publish what the loop has recorded; how many ticks."""
        state = self.state
        before = state.status.last
        records = state.loop.reader.read()
        state.status.add(records)
        if records:
            state.notifier.feed_watchdog()
            if before is None or _noted(before) != _noted(records[-1]):
                state.status_due_s = 0.0
        state.publisher.publish(records)
        state.publisher.flush(time.monotonic_ns() + WAKE_NS)
        for event in state.loop.events.read():
            state.event_log.tell(event, state.config, state.loop)
            if event.code in (EventCode.DEVICE_LOST, EventCode.DEVICE_FAULT):
                self._device_lost = event
                state.loop.stall_s = END_TIMEOUT_S
        ticks, events = state.loop.newly_dropped()
        state.status.add_dropped(ticks, events)
        for lost, what in ((ticks, "ticks"), (events, "events")):
            if lost:
                state.tell(EventCode.RING_DROPPED, f"{lost} {what} were overwritten before they were published")
        return len(records)

    def _hold(self) -> None:
        """Keep for a daemon that is started anew whether the device was let go, before who asked for it hears of it."""
        state = self.state
        if state.recovery.lost:
            state.arm_hold.follow_lost(state.loop, state.recovery.resume)
        elif not state.requests.disarming:  # it is held, and the newest tick may not know of that
            state.arm_hold.follow(state.loop, state.status.flags, state.config, any(state.status.origin_m.values()))

    def _look_after_loop(self, now_s: float) -> None:
        state = self.state
        ended = state.loop.exit_code is not None
        while ended and self._publish():
            pass
        if self._stopping and not (state.status.last and state.status.last.flags & FORCES):
            state.loop.stall_s = STOP_TIMEOUT_S  # without a force, and a driver may take its time to let go
        if self._device_lost is not None and state.status.last is not None and not self._stopping:
            self._begin_recovery(self._device_lost)
        elif ended:
            self._loop_ended()
        elif state.loop.stalled():
            self._loop_lost(f"the control loop stood still for more than {state.loop.stall_s:g} s")
        elif self._stopping and now_s > self._stop_by_s:
            self._loop_lost(f"the control loop did not stop within {STOP_TIMEOUT_S:g} s")

    def _look_after_lock(self) -> None:
        """End where the way to this daemon was taken away: it could be neither disarmed nor told from a second one."""
        if not self._stopping and not self.lock.keep():
            log.error(
                "%s: this daemon's lock there was removed or replaced: commands may not reach it, and a second daemon "
                "could start beside it, so it ends; keep other programs off that directory, and start hapticd again",
                self.lock.directory,
            )
            self.stop("the runtime directory was taken away", exit_code=1)

    def _look_after_helper(self) -> None:
        """Tell when no helper is ready to take the force away; the status says so as long as it is so."""
        before, self._problem = self._problem, self.release.problem if self.exit_code is None else ""
        if self._problem and not before:
            self.state.tell(EventCode.HELPER_MISSING, self._problem)

    def _follow_clock(self) -> None:
        """Go ahead with the time of day when it was set, or the computer slept and CLOCK_MONOTONIC with it."""
        offset_ns = followed_offset_ns(self._offset_ns, measure_epoch_offset_ns())
        if offset_ns != self._offset_ns:
            log.warning("the clock went ahead by %.1f s, and timestamps with it", (offset_ns - self._offset_ns) * 1e-9)
            self._offset_ns = offset_ns
            self.state.follow_clock(offset_ns)

    def _look_for_device(self) -> None:
        """Try again when it is time; that nothing ticks until then is no reason for systemd to intervene."""
        state = self.state
        state.notifier.feed_watchdog()
        loop = state.recovery.turn(state.loop, state.config)
        if loop is not None:
            self.release.force_left = ""
            state.take_loop(loop)

    def _hang_up(self) -> None:
        """SIGHUP: from a person a reload, from a terminal that is closed the end."""
        if self._terminal.closed():
            self.stop("the terminal was closed")
        else:
            self.state.ask_reload()

    def _loop_ended(self) -> None:
        state = self.state
        state.event_log.recorder.loop_ended()
        left = state.loop.left_behind
        if self._stopping and not left:
            log.info("stopped")
            self.exit_code = self._stop_code
        else:
            self._loop_lost(left or f"the loop's process ended with exit code {state.loop.exit_code}")

    def _begin_recovery(self, event: LoopEvent) -> None:
        """The loop has told that its device is gone; it is just ending."""
        state = self.state
        self._device_lost = None
        while self._publish():
            pass
        state.event_log.recorder.loop_ended()
        state.requests.abandon(event.text, None)  # the next turns look after its force
        state.recovery.begin(state.loop, event.text.removeprefix("device lost: "))

    def _loop_lost(self, text: str) -> None:
        """The loop no longer looks after the device: take the force away from outside, and end."""
        state = self.state
        state.loop.kill()
        state.loop.force_seen_to = True
        outcome = self._take_force_away()
        state.arm_hold.keep(state.loop)
        state.tell(EventCode.CONTROL_LOST, f"{text}; {outcome}")
        self.exit_code = 1

    def _problems(self) -> list[str]:
        """What stands and should be known, each a line."""
        state = self.state
        arms_itself = state.config.config.safety.auto_arm or state.loop.info.simulated
        held = state.arm_hold.inherited if arms_itself else ""
        return [problem for problem in (held, self._problem) if problem]

    def _publish_status(self) -> None:
        state = self.state
        written = state.event_log.recorder.written
        status = state.status.make(
            state.config,
            state.loop,
            state.recovery,
            written,
            state.commands.refused,
            self._problems(),
            state.remote.counts,
        )
        state.publisher.status(status.as_map())
        doing = f"no device: {state.recovery.why}" if state.recovery.lost else f"{state.status.rate_hz:.0f} Hz"
        ready = ("READY=1",) if state.ready_due and state.status.last is not None else ()
        state.ready_due = state.ready_due and not ready
        state.notifier.send(*ready, f"STATUS={doing}, law {status.law}")
