"""A recording that was read: columns a topic, and what happened in it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hapticd.config.loading import LoadedConfig, parse, parse_keys
from hapticd.config.models import Config
from hapticd.errors import HapticdError
from hapticd.telemetry.records import Cycle, Event
from hapticd.tick.event import EventCode
from hapticd_views.recording.columns import Values
from hapticd_views.recording.fit import widened
from hapticd_views.recording.loop import FAULTS, armed, loop_numbers
from hapticd_views.recording.messages import Note, RecordedGap

PER_TICK = ("position", "energy", "damping", "timing")
"""Topics with a message every tick."""


@dataclass(frozen=True, repr=False, eq=False)
class Recording:
    """A recording.

    Attributes:
        path: the file.
        receipts: what was in force, from the beginning on and from each change on; `timestamp` says since when.
        topics: columns by topic, without "hapticd/", and by key of docs/telemetry.md; a row a message. A key with an
            element an axis or a wall is a table. `run` counts the daemon's restarts, at each of which `seq` begins
            anew.
        gaps: ticks that did not arrive.
        notes: what the recorder itself has seen.
        cut: why the file ends before its proper end; "" when it does not.
    """

    path: Path
    receipts: tuple[dict[str, Any], ...]
    topics: dict[str, dict[str, Values]]
    gaps: tuple[RecordedGap, ...]
    notes: tuple[Note, ...]
    cut: str

    @property
    def receipt(self) -> dict[str, Any]:
        """What was in force when it began."""
        return self.receipts[0]

    @property
    def complete(self) -> bool:
        """Whether it ends where its recorder ended it."""
        return not self.cut

    @property
    def config(self) -> LoadedConfig:
        """The configuration that was in force when it began.

        Raises:
            HapticdError: the recorder could not get it.
            ConfigError: this installation cannot use it, for example for want of a driver.
        """
        return self.config_of(self.receipt)

    def config_of(self, receipt: dict[str, Any]) -> LoadedConfig:
        """The configuration of one of its receipts.

        Raises:
            HapticdError: the recorder could not get it.
            ConfigError: this installation cannot use it, for example for want of a driver.
        """
        return parse(*self._text_of(receipt))

    def keys_of(self, receipt: dict[str, Any]) -> Config:
        """The same as far as it takes neither driver nor law, which may be installed elsewhere only.

        Raises:
            HapticdError: the recorder could not get it.
            ConfigError: this version cannot use it.
        """
        return parse_keys(*self._text_of(receipt))

    @property
    def missing(self) -> int:
        """Ticks that did not arrive, by the topic that lost most."""
        topics = {gap.topic for gap in self.gaps}
        return max((sum(gap.missing for gap in self.gaps if gap.topic == topic) for topic in topics), default=0)

    @cached_property
    def ticks(self) -> dict[str, Values]:
        """The topics with a message every tick side by side: the ticks that are in all of them.

        Raises:
            HapticdError: they have fewer columns than the device axes, or the scene walls.
        """
        try:
            tables = [widened(name, self.topics[name], self.receipts) for name in PER_TICK if name in self.topics]
        except ValueError as error:
            raise HapticdError(
                f"{self.path}: {error}: the file was changed, or what was recorded is no hapticd"
            ) from None
        if not tables:
            return {}
        keys = [list(zip(table["run"].tolist(), table["seq"].tolist(), strict=True)) for table in tables]
        places = [{key: row for row, key in enumerate(column)} for column in keys]
        both = sorted(set.intersection(*(set(place) for place in places)))
        joined: dict[str, Values] = {}
        for table, place in zip(tables, places, strict=True):
            rows = np.array([place[key] for key in both], np.int64)
            for name, values in table.items():
                if name == "invalid" and name in joined:
                    joined[name] = joined[name] | values[rows]
                elif name not in joined:
                    joined[name] = values[rows]
        return joined

    @cached_property
    def in_force(self) -> npt.NDArray[np.int64]:
        """Which of `receipts` was in force in each of `ticks`.

        A receipt follows the status that tells of a reload; which tick was the last one before it, its event says.
        That of a daemon that was started anew holds from its first tick on, which may have come before its status.
        """
        since: list[float] = []
        before = -np.inf
        for former, receipt in pairwise(self.receipts):
            if receipt.get("started_timestamp") != former.get("started_timestamp"):
                before = receipt["timestamp"]
                since.append(self._first_s(receipt))
                continue
            told = [
                event.timestamp
                for event in self.events
                if event.code == EventCode.SWITCHED
                and event.fields.get("config") == receipt["config_hash"]
                and before < event.timestamp <= receipt["timestamp"]
            ]
            before = receipt["timestamp"]
            since.append(float(np.nextafter(told[-1], np.inf)) if told else before)
        return np.asarray(np.searchsorted(since, self.ticks["timestamp"], side="right"), np.int64)

    @cached_property
    def loops(self) -> npt.NDArray[np.int64]:
        """Which loop each of `ticks` is of: a restart begins another one, and so does a lost device that is found."""
        return loop_numbers(self.ticks, self.topics)

    @cached_property
    def armed(self) -> npt.NDArray[np.bool_]:
        """Whether forces were let through in each of `ticks`."""
        return armed(self.ticks, self.topics)

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """What happened."""
        return tuple(_records(Event, self.topics.get("event", {})))

    @cached_property
    def faults(self) -> tuple[Event, ...]:
        """The faults in it: those of its events, and those that a status tells of and no event."""
        found = [event for event in self.events if event.code in FAULTS]
        told = {event.timestamp for event in found}
        status = self.topics.get("status", {})
        if "fault_timestamp" in status and self.ticks:
            first_s = float(self.ticks["timestamp"][0])
            rows = zip(*(status[name] for name in ("fault_timestamp", "fault_code", "fault_text", "seq")), strict=True)
            for at_s, code, text, seq in rows:
                if at_s >= first_s and at_s not in told:
                    told.add(at_s)
                    found.append(Event(float(at_s), int(seq), int(code), str(text), {}))
        return tuple(sorted(found, key=lambda event: event.timestamp))

    @property
    def markers(self) -> tuple[Event, ...]:
        """The events that `hapticd mark` made; `text` is the marker."""
        return tuple(event for event in self.events if event.code == EventCode.MARKED)

    @cached_property
    def cycles(self) -> tuple[Cycle, ...]:
        """The cycles of energy exchange that were completed."""
        return tuple(_records(Cycle, self.topics.get("cycle", {})))

    @property
    def duration_s(self) -> float:
        """From its first tick to its last [s]."""
        times = [table["timestamp"] for name, table in self.topics.items() if name in PER_TICK]
        return float(max(one.max() for one in times) - min(one.min() for one in times)) if times else 0.0

    def wall(self, index: int = 0) -> dict[str, Values]:
        """What happened at one wall, as columns named as those of `hapticd.simulate`.

        `x_m` is measured, relative to the wall and negative inside it; forces push out of it when positive; `t_s`
        counts from the first tick, across restarts too. Energies are of all contacts. Where it was reloaded, each tick
        has the wall of its own configuration, and NaN where that has none.

        Raises:
            HapticdError: no such wall, or without its configuration it is not known which side of it is free.
        """
        walls = max(len(receipt["wall_axis"]) for receipt in self.receipts)
        if not 0 <= index < walls:
            raise HapticdError(f"{self.path}: has {walls} walls, and no wall {index}")
        ticks = self.ticks
        rows = np.arange(len(ticks["timestamp"]))
        axis, outward, place_m = np.zeros(len(rows), np.int64), *np.full((2, len(rows)), np.nan)
        for number in np.unique(self.in_force).tolist():
            receipt = self.receipts[number]
            if index < len(receipt["wall_axis"]):
                its, axes = self.in_force == number, receipt["axes"]
                axis[its] = axes.index(receipt["wall_axis"][index]) if len(axes) > 1 else 0
                free_side = self.keys_of(receipt).scene.walls[index].free_side
                outward[its] = 1.0 if free_side == "positive" else -1.0
                place_m[its] = receipt["wall_position_m"][index]
        found = {"t_s": ticks["timestamp"] - ticks["timestamp"][0]}
        if "position_m" in ticks:
            found["x_m"] = outward * (ticks["position_m"][rows, axis] - place_m)
            found["v_m_per_s"] = outward * ticks["velocity_m_per_s"][rows, axis]
            found["force_n"] = outward * ticks["force_n"][rows, axis]
            found["force_requested_n"] = outward * ticks["force_requested_n"][rows, axis]
        for name in ("energy_j", "spring_energy_j", "dissipated_j", "generated_j", "late_us", "busy_us", "dt_s"):
            if name in ticks:
                found[name] = ticks[name]
        for name in ("damping_n_s_per_m", "in_contact", "felt_mass_kg"):
            if name in ticks:
                found[name] = ticks[name][:, index]
        return found

    def _first_s(self, receipt: dict[str, Any]) -> float:
        """Time of the first tick in the run of the status that a receipt is of [s since the epoch]."""
        status, ticks = self.topics.get("status", {"timestamp": [], "run": []}), self.ticks
        runs = dict(zip(status["timestamp"], status["run"], strict=True))
        times = ticks["timestamp"][ticks["run"] == runs.get(receipt["timestamp"], -1)]
        return float(times[0]) if len(times) else float(receipt["timestamp"])

    def _text_of(self, receipt: dict[str, Any]) -> tuple[str, str, Path]:
        """The text of a configuration, what errors call it, and where its files lie."""
        if not receipt["config_text"]:
            raise HapticdError(f"{self.path}: has no configuration: {receipt['config_missing']}")
        file = Path(receipt["config_file"])
        return receipt["config_text"], f"{self.path}: {file.name}", file.parent

    def __repr__(self) -> str:
        return (
            f"<Recording {self.path}: {self.duration_s:.1f} s of {self.receipt['device']} with {self.receipt['law']}>"
        )


def _records(kind: type[Any], table: dict[str, Values]) -> list[Any]:
    """Rows of a table as records again."""
    names = [field.name for field in dataclasses.fields(kind) if field.name in table]
    columns = [table[name].tolist() if isinstance(table[name], np.ndarray) else table[name] for name in names]
    own = table.get("fields")
    rows = [dict(zip(names, values, strict=True)) for values in zip(*columns, strict=True)]
    if own is not None:
        rows = [{**row, "fields": fields} for row, fields in zip(rows, own, strict=True)]
    return [kind(**row) for row in rows]
