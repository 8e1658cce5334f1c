"""From a daemon's telemetry to Lab Streaming Layer: messages of one tick are joined, times are of one clock."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hapticd.client import EventCode
from hapticd.telemetry.records import Cycle, Damping, Energy, Event, Gap, Position, Record, Status, Timing
from hapticd_views.lsl.channels import JoinedTick, Layout
from hapticd_views.lsl.outlets import Outlets

TOPICS: tuple[Any, ...] = (Position, Energy, Damping, Timing, Cycle, Event, Status)
"""What the bridge listens to."""

_MOST_WAITING = 4000  # ticks whose other messages have not come: lost, when there are more


@dataclass(slots=True)
class Streamed:
    """What has been streamed.

    Attributes:
        ticks: samples of the stream of ticks.
        texts: samples of the other one.
        missing: ticks that did not come, or not whole.
        layouts: how often the streams were made anew since axes, walls or rate had changed; 1 from the first tick on.
    """

    ticks: int = 0
    texts: int = 0
    missing: int = 0
    layouts: int = 0


class Bridge:
    """Streams what it is given.

    Attributes:
        streamed: how much that was.
    """

    def __init__(self) -> None:
        self.streamed = Streamed()
        self._outlets: Outlets | None = None
        self._waiting: dict[int, dict[type[Any], Any]] = {}
        self._told: list[tuple[dict[str, Any], float]] = []
        self._epoch_s = time.time() - time.monotonic()

    def take(self, records: Sequence[Record], status: Status) -> None:
        """Stream records, in the order in which they came.

        Args:
            records: of `Client.receive`.
            status: the daemon's latest.
        """
        whole: list[JoinedTick] = []
        for record in records:
            match record:
                case Position() | Energy() | Damping() | Timing():
                    tick = self._joined(record)
                    if tick is not None:
                        whole.append(tick)
                case Gap() if record.topic == Position.topic:
                    self._restart(record)
                    self.streamed.missing += record.missing
                    self._tell({"kind": "gap", "seq": record.seq, "missing": record.missing}, time.monotonic())
                case Cycle():
                    wall = {"wall": record.contact, "cycle": record.cycle, "generated_j": record.generated_j}
                    told = {"kind": "cycle", "seq": record.seq, **wall, "damping_n_s_per_m": record.damping_n_s_per_m}
                    self._tell(told, self._local_s(record.timestamp))
                case Event():
                    kind = "marker" if record.code == EventCode.MARKED else "event"
                    told = {"kind": kind, "seq": record.seq, "code": record.code, "text": record.text}
                    self._tell(told, self._local_s(record.timestamp))
                case _:
                    pass
        self._push(whole, status)

    def _local_s(self, timestamp: float) -> float:
        """When that was on LSL's clock, which is CLOCK_MONOTONIC.

        The daemon's timestamps go ahead when the time of day was set or the computer slept, and what is sent then may
        come before the tick that shows it, or without any while the device is gone. What seems to lie ahead is of now.
        """
        now_s = time.monotonic()
        local_s = timestamp - self._epoch_s
        return local_s if local_s <= now_s else min(now_s, timestamp - (time.time() - now_s))

    def _joined(self, record: Position | Energy | Damping | Timing) -> JoinedTick | None:
        """The tick that this message completes."""
        if isinstance(record, Timing):
            self._epoch_s = record.timestamp - record.deadline_ns * 1e-9
        parts = self._waiting.setdefault(record.seq, {})
        parts[type(record)] = record
        if len(parts) < 4:
            while len(self._waiting) > _MOST_WAITING:
                self._waiting.pop(next(iter(self._waiting)))
                self.streamed.missing += 1
            return None
        del self._waiting[record.seq]
        return JoinedTick(parts[Position], parts[Energy], parts[Damping], parts[Timing])

    def _restart(self, gap: Gap) -> None:
        """A daemon that was started anew counts from the beginning: what waits belongs to the one before."""
        if gap.seq <= gap.after:
            self._waiting.clear()

    def _push(self, ticks: list[JoinedTick], status: Status) -> None:
        while ticks:
            layout = Layout.of(ticks[0], status)
            if self._outlets is None or self._outlets.layout != layout:
                self._outlets = None  # liblsl ends the old streams before the new ones take their names
                self._outlets = Outlets(layout, status)
                self.streamed.layouts += 1
            alike = [tick for tick in ticks if Layout.of(tick, status) == layout]
            self._outlets.push(alike)
            self.streamed.ticks += len(alike)
            ticks = [tick for tick in ticks if Layout.of(tick, status) != layout]
        if self._outlets is not None:
            for told, time_s in self._told:
                self._outlets.tell(told, time_s)
            self.streamed.texts += len(self._told)
            self._told.clear()

    def _tell(self, told: dict[str, Any], time_s: float) -> None:
        self._told.append((told, time_s))
