"""What a live view knows of a daemon."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from hapticd.cli.watch.plot import Trace
from hapticd.cli.watch.space import Trail
from hapticd.client import Cycle, Damping, Energy, Event, Gap, Position, Record, Status, Touch

_HISTORY_S = 1.0  # between two bars of a wall's damping


class ScreenState:
    """What is known of a daemon from the records that have come.

    Attributes:
        status: its latest status, None before the first.
        position, energy, damping: its latest tick.
        cycles, events: the latest ones, newest first.
        heard_s: when anything came last, on the caller's clock [s].
        lost: ticks that this viewer did not get.
        trail: where a device with three axes was, and what it touches.
        pushes: what each coupling and force did when it was last in force, by its index among what clients drive.
    """

    def __init__(self) -> None:
        self.status: Status | None = None
        self.position: Position | None = None
        self.energy: Energy | None = None
        self.damping: Damping | None = None
        self.cycles: deque[Cycle] = deque(maxlen=100)
        self.events: deque[Event] = deque(maxlen=100)
        self.heard_s = -math.inf
        self.lost = 0
        self.trail = Trail()
        self.pushes: dict[int, Touch] = {}
        self.positions = Trace(0)
        self.forces = Trace(0)
        self.dampings: list[deque[float]] = []
        self._damping_due_s = 0.0

    def take(self, records: Sequence[Record], now_s: float) -> None:
        """Take records over.

        Args:
            records: in the order in which they came.
            now_s: the caller's clock [s].
        """
        if records:
            self.heard_s = now_s
        for record in records:
            match record:
                case Position():
                    self._take_position(record)
                case Energy():
                    self.energy = record
                case Touch() if record.object < 0:
                    self.pushes[record.remote] = record
                case Touch():
                    self.trail.touch(record)
                case Damping():
                    self._take_damping(record)
                case Cycle():
                    self.cycles.appendleft(record)
                case Event():
                    self.events.appendleft(record)
                case Status():
                    self.status = record
                case Gap() if record.topic == Position.topic:
                    self.lost += record.missing
                case _:
                    pass

    def _take_position(self, position: Position) -> None:
        if self.positions.series != len(position.position_m):
            self.positions = Trace(len(position.position_m))
            self.forces = Trace(2 * len(position.position_m))
        self.positions.add(position.timestamp, position.position_m)
        self.forces.add(position.timestamp, position.force_requested_n + position.force_n)
        self.position = position
        if len(position.position_m) == 3:
            self.trail.pass_by(position.timestamp, position.position_m)

    def _take_damping(self, damping: Damping) -> None:
        self.damping = damping
        if len(self.dampings) != len(damping.damping_n_s_per_m):
            self.dampings = [deque(maxlen=8) for _ in damping.damping_n_s_per_m]
        if abs(damping.timestamp - self._damping_due_s) >= _HISTORY_S:
            self._damping_due_s = damping.timestamp
            for history, value in zip(self.dampings, damping.damping_n_s_per_m, strict=True):
                history.append(value)
