"""Walls that change over time, as they were where a replayed part begins, with the changes that were still to come."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from hapticd.config.loading import LoadedConfig
from hapticd.config.timing import first_tick
from hapticd.config.walls import WallConfig
from hapticd.errors import HapticdError
from hapticd.tick.event import EventCode
from hapticd_views.recording import Recording
from hapticd_views.recording.loop import seqs_of
from hapticd_views.replay.stretch import Stretch

_NEAR = 3  # periods that the time of a status may be off


def begun(recording: Recording, stretch: Stretch, config: LoadedConfig) -> LoadedConfig:
    """The recorded configuration with its walls as they were where a part begins.

    A wall counts from the first tick of its loop, or from the reload that brought or changed it. Which of them it was
    is told by the stiffness in the statuses.

    Args:
        recording: the whole.
        stretch: the part.
        config: what was in force there, under whatever law.

    Raises:
        HapticdError: it is not known how far the changes of a wall had come.
    """
    scene = config.config.scene
    if not any(wall.changes for wall in scene.walls):
        return config
    past = _Past(recording, stretch, config.config.loop.period_s)
    walls = tuple(past.wall(index, wall) if wall.changes else wall for index, wall in enumerate(scene.walls))
    changed = config.config.model_copy(update={"scene": scene.model_copy(update={"walls": walls})})
    return replace(config, config=changed)


class _Past:
    """What a recording tells of the time before a part of it, in periods of the loop."""

    def __init__(self, recording: Recording, stretch: Stretch, period_s: float) -> None:
        self._recording = recording
        self._period_s = period_s
        self._run = int(stretch.ticks["run"][0])
        self._start, self._end = int(stretch.ticks["seq"][0]), int(stretch.ticks["seq"][-1])
        ticks, loops = recording.ticks, recording.loops
        at = (ticks["run"] == self._run) & (ticks["seq"] == self._start)
        own = loops == loops[int(np.argmax(at))]
        self._seq, self._deadline_ns = ticks["seq"][own], ticks["deadline_ns"][own]
        self._simulated = bool(stretch.receipt["simulated"])

    def wall(self, index: int, wall: WallConfig) -> WallConfig:
        """A wall as it was where the part begins."""
        found = {
            _after(wall, self._periods(self._start, first), self._period_s)
            for first in self._firsts()
            if all(self._agrees(wall, self._periods(seq, first), told) for seq, told in self._told(index))
        }
        if len(found) != 1:
            raise HapticdError(
                f"{self._recording.path}: scene.walls[{index}] changes over time, and how far it had come is not told: "
                "name a --config with the wall as it was"
            )
        return found.pop()

    def _firsts(self) -> list[int]:
        """Ticks that may have been the first one of a wall."""
        started, switched = [0], []
        event: dict[str, Any] = self._recording.topics.get("event", {"code": [], "seq": [], "run": []})
        for code, seq, run in zip(event["code"], event["seq"], event["run"], strict=True):
            if run == self._run and seq <= self._start:
                if code == EventCode.STARTED:
                    started.append(int(seq))
                elif code == EventCode.SWITCHED and seq < self._start:
                    switched.append(int(seq) + 1)
        loop = max(started)
        return [loop, *(seq for seq in switched if seq > loop)]

    def _periods(self, seq: int, first: int) -> int:
        """Time from one tick to a later one: of a simulated device a period a tick, of a real one by the clock."""
        if self._simulated:
            return seq - first
        return round((self._due_ns(seq) - self._due_ns(first)) * 1e-9 / self._period_s)

    def _due_ns(self, seq: int) -> float:
        """When a tick was due; one from before the recording as far as the deadlines tell that were skipped [ns]."""
        row = int(np.searchsorted(self._seq, seq))
        if row or self._seq[0] == seq:
            return float(self._deadline_ns[min(row, len(self._seq) - 1)])
        status: dict[str, Any] = self._recording.topics.get("status", {})
        counts = zip(status.get("run", ()), status.get("overruns", ()), strict=False)
        skipped = next((int(count) for run, count in counts if run == self._run), 0)
        return float(self._deadline_ns[0]) - (float(self._seq[0]) - seq + skipped) * self._period_s * 1e9

    def _told(self, index: int) -> Iterator[tuple[int, float]]:
        """Tick and stiffness by the last status before the part, and by those in it."""
        status = self._recording.topics.get("status", {})
        if "wall_stiffness_n_per_m" not in status:
            return
        seqs = seqs_of(status)
        own = (status["run"] == self._run) & np.isin(seqs, self._seq) & (seqs <= self._end)
        seqs, told = seqs[own], status["wall_stiffness_n_per_m"][own]
        since = max((int(seq) for seq in seqs if seq <= self._start), default=self._start)
        for seq, stiffness in zip(seqs.tolist(), told.tolist(), strict=True):
            if seq >= since:
                yield seq, stiffness[index]

    def _agrees(self, wall: WallConfig, periods: int, told_n_per_m: float) -> bool:
        """Whether a wall that is so old may have the stiffness that a status tells."""
        ages = range(periods - _NEAR, periods + _NEAR + 1)
        return told_n_per_m in {_after(wall, age, self._period_s).stiffness_n_per_m for age in ages}


def _after(wall: WallConfig, periods: int, period_s: float) -> WallConfig:
    """A wall that has been there for so long: what has changed is in force, the rest comes so much sooner."""
    stiffness_n_per_m, damping_n_s_per_m, later = wall.stiffness_n_per_m, wall.damping_n_s_per_m, []
    for change in wall.changes:
        left = first_tick(change.at_s, period_s) - periods
        if left > 0:
            later.append(change.model_copy(update={"at_s": left * period_s}))
            continue
        if change.stiffness_n_per_m is not None:
            stiffness_n_per_m = change.stiffness_n_per_m
        if change.damping_n_s_per_m is not None:
            damping_n_s_per_m = change.damping_n_s_per_m
    now = {
        "stiffness_n_per_m": stiffness_n_per_m, "damping_n_s_per_m": damping_n_s_per_m, "changes": tuple(later)
    }  # fmt: skip
    return wall.model_copy(update=now)
