"""What a running daemon is made of, for the parts that act on it: the configuration, the loop, who hears of what."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from hapticd.config.loading import LoadedConfig
from hapticd.keys.store import KeyRing
from hapticd.supervisor.arm_hold import ArmHold
from hapticd.supervisor.child import LoopProcess
from hapticd.supervisor.commands import CommandSocket
from hapticd.supervisor.events import EventLog
from hapticd.supervisor.force_release import ForceRelease
from hapticd.supervisor.recovery import Recovery
from hapticd.supervisor.remote_process import RemoteProcess
from hapticd.supervisor.request_queue import MOST_WAITING, Answer, RequestQueue
from hapticd.supervisor.status import StatusBuilder
from hapticd.supervisor.systemd import Notifier
from hapticd.telemetry.publisher import Publisher
from hapticd.tick.event import EventCode


@dataclass(slots=True)
class DaemonState:
    """The parts of a running daemon; each is replaced or changed by one part of the supervisor only.

    Attributes:
        config: what is in force.
        loop: the process that has the device, or had it last.
        requests: what the loop is asked.
        recovery: looks for a device that is lost.
        release: takes the force away from outside.
        publisher: telemetry.
        commands: the control socket.
        remote: the process that hears clients of the scene.
        ring: the keys that TCP endpoints take.
        epoch_offset_ns: what to add to CLOCK_MONOTONIC to get nanoseconds since the epoch.
        status: counts, and the status made of them.
        event_log: tells of events.
        arm_hold: keeps that the device was let go for a daemon that is started anew.
        notifier: tells systemd.
        reload_asked: answers to those who asked for a reload that has not begun.
        stop_reason: why the daemon is to end; "" as long as it is not.
        status_due_s: when the status is published next [s of CLOCK_MONOTONIC].
        ready_due: systemd hears that the daemon is ready, once the status tells of ticks: who comes after that finds
            none of before them, and after a reload none of the configuration before.
    """

    config: LoadedConfig
    loop: LoopProcess
    requests: RequestQueue
    recovery: Recovery
    release: ForceRelease
    publisher: Publisher
    commands: CommandSocket
    remote: RemoteProcess
    ring: KeyRing | None
    epoch_offset_ns: int
    status: StatusBuilder
    event_log: EventLog
    arm_hold: ArmHold
    notifier: Notifier
    reload_asked: list[Answer] = field(default_factory=list)
    stop_reason: str = ""
    status_due_s: float = 0.0
    ready_due: bool = True

    def tell(self, code: EventCode, text: str, **fields: float | int | str) -> None:
        """Tell of an event that the supervisor itself has to report.

        Args:
            code: what it is.
            text: in a line.
            fields: what programs may want to know of it.
        """
        self.event_log.tell_now(code, text, self.config, self.loop, **fields)

    def ask_reload(self, answer: Answer | None = None) -> None:
        """Have the file taken over, once for all who ask before that begins.

        Args:
            answer: called with the verdict; None: who asks does not wait for it.
        """
        if answer is None and not self.reload_asked:
            self.reload_asked.append(lambda _verdict: None)
        elif answer is not None and len(self.reload_asked) < MOST_WAITING:
            self.reload_asked.append(answer)
        elif answer is not None:
            answer("too many are waiting for a verdict on the file; try again")

    def adopt(self, config: LoadedConfig, ring: KeyRing | None) -> None:
        """Go on with another configuration and other keys; the loop has its part already."""
        self.config = config
        self.publisher.reconfigure(config.config.telemetry)
        if ring is not None:
            self.publisher.admit(ring)
            self.commands.admit(ring)
            self.ring = ring
        self.serve_clients()
        self.status_due_s = 0.0

    def serve_clients(self) -> None:
        """Have clients drive what the scene has for them, with the loop that there is."""
        self.remote.serve(self.config, self.loop, self.ring, self.epoch_offset_ns)

    def follow_clock(self, epoch_offset_ns: int) -> None:
        """Go on with another difference between CLOCK_MONOTONIC and the time of day."""
        self.epoch_offset_ns = epoch_offset_ns
        self.publisher.follow_clock(epoch_offset_ns)
        self.status.follow_clock(epoch_offset_ns)
        self.event_log.follow_clock(epoch_offset_ns)
        self.serve_clients()

    def take_loop(self, loop: LoopProcess) -> None:
        """Go on with the loop that has found the device again."""
        self.loop.close()
        self.loop = loop
        self.requests = RequestQueue(loop.shared)
        self.publisher.take_loop()
        self.serve_clients()
        self.status.expect(self.recovery.resume)
        away_s = time.monotonic() - self.recovery.lost_s
        self.tell(EventCode.DEVICE_FOUND, f"the device is back after {away_s:.1f} s", away_s=away_s)
