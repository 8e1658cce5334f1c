"""The event log: what happened goes to the log, to subscribers, into the status and into fault records."""

from __future__ import annotations

import logging
import time
from pathlib import Path

from hapticd.config.loading import LoadedConfig
from hapticd.faults.record import receipt
from hapticd.supervisor.child import LoopProcess
from hapticd.supervisor.fault_recorder import FaultRecorder
from hapticd.supervisor.metrics import MetricWatch
from hapticd.supervisor.status import StatusBuilder
from hapticd.telemetry.clock import timestamp_s
from hapticd.telemetry.publisher import Publisher
from hapticd.tick.event import EventCode, LoopEvent

FLOOD = 1000
"""More subscriptions than this in a second are a flood; a subscriber to everything makes one or eight."""

_FLOOD_WINDOW_S = 1.0
_FLOOD_QUIET_S = 10.0

log = logging.getLogger("hapticd")


class EventLog:
    """Tells events.

    Args:
        instance: name of the daemon's instance.
        publisher: tells subscribers.
        status: tells in the status.
        faults: where fault records lie.
        epoch_offset_ns: what to add to CLOCK_MONOTONIC to get nanoseconds since the epoch.

    Attributes:
        recorder: keeps the ticks around faults.
        news: something was told since the status was published.
    """

    def __init__(
        self, instance: str, publisher: Publisher, status: StatusBuilder, faults: Path, epoch_offset_ns: int
    ) -> None:
        self.recorder = FaultRecorder(faults)
        self.news = False
        self._instance = instance
        self._publisher = publisher
        self._status = status
        self._offset_ns = epoch_offset_ns
        self._metrics = MetricWatch()
        self._subscriptions = (time.monotonic(), 0)
        self._flood_due_s = 0.0

    def follow_clock(self, epoch_offset_ns: int) -> None:
        """Tell times by another offset from now on."""
        self._offset_ns = epoch_offset_ns

    def tell(self, event: LoopEvent, config: LoadedConfig, loop: LoopProcess) -> None:
        """Tell an event.

        Args:
            event: what happened.
            config: what is in force.
            loop: to which loop; the ring of a fault's ticks is its.
        """
        warns = event.code >= 300 or event.code == EventCode.REFUSED
        level = logging.ERROR if event.is_fault else logging.WARNING if warns else logging.INFO
        fields = {"instance": self._instance, "code": int(event.code), "tick": event.seq}
        log.log(level, "%s", event.text, extra=fields | {"law": config.config.controller.law})
        self._publisher.event(event)
        self._status.add_event(event)
        self.news = True
        if event.is_fault and config.config.faults.keep:
            at_s = timestamp_s(event.deadline_ns, self._offset_ns)
            header = receipt(event, at_s, self._instance, config, loop.info)
            self.recorder.begin(event, at_s, loop.shared, config.config.loop.rate_hz, header)

    def tell_now(
        self, code: EventCode, text: str, config: LoadedConfig, loop: LoopProcess, **fields: float | int | str
    ) -> None:
        """Tell what the supervisor itself has seen or done."""
        seq = self._status.last.seq if self._status.last else 0
        self.tell(LoopEvent(code, text, seq, time.monotonic_ns(), fields), config, loop)

    def turn(self, config: LoadedConfig, loop: LoopProcess) -> None:
        """Go on with fault records, and look at subscribers and at the driver's metrics; returns at once."""
        problem = self.recorder.turn(config.config.faults.keep)
        if problem:
            self.tell_now(EventCode.FAULT_RECORD_FAILED, problem, config, loop)
        now_s = time.monotonic()
        for text, fields in self._metrics.grown(config.driver.METRICS, loop.shared.metrics, now_s):
            self.tell_now(EventCode.DEVICE_WARNING, text, config, loop, **fields)
        since_s, before = self._subscriptions
        if now_s - since_s < _FLOOD_WINDOW_S:
            return
        count = self._publisher.counts.subscriptions
        self._subscriptions = (now_s, count)
        if count - before > FLOOD and now_s >= self._flood_due_s:
            self._flood_due_s = now_s + _FLOOD_QUIET_S
            text = f"{count - before} subscriptions in {now_s - since_s:.1f} s"
            self.tell_now(EventCode.SUBSCRIBER_FLOOD, text, config, loop, subscriptions=count - before)

    def close(self, config: LoadedConfig, loop: LoopProcess, timeout_s: float) -> None:
        """Write the fault records that wait; a slow disk has this long [s]."""
        problem = self.recorder.close(config.config.faults.keep, timeout_s)
        if problem:
            self.tell_now(EventCode.FAULT_RECORD_FAILED, problem, config, loop)
