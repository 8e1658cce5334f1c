"""Read a recording."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Channel, Message, Metadata, Schema

from hapticd.errors import HapticdError
from hapticd_views.recording.columns import Values, columns_of, rows_of
from hapticd_views.recording.fit import checked
from hapticd_views.recording.messages import GAP, NOTE, Note, RecordedGap
from hapticd_views.recording.receipt import METADATA, from_texts
from hapticd_views.recording.recording import Recording
from hapticd_views.recording.scan import Scan

_TELEMETRY = "hapticd/"
_START_S = 0.1  # no daemon ends and is started anew in less


def read(path: Path | str) -> Recording:
    """Read a recording; of one that was cut, everything up to the cut.

    Raises:
        HapticdError: it cannot be read, or is no recording of ours.
    """
    scan = Scan(Path(path))
    read_in = _ReadIn()
    try:
        for piece in scan.pieces():
            if isinstance(piece, Metadata):
                read_in.describe(piece)
            else:
                for record in piece:
                    read_in.add(record)
        return read_in.recording(scan)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise HapticdError(f"{path}: is no recording of hapticd: {str(error) or type(error).__name__}") from error


@dataclass(slots=True)
class _Topic:
    """Messages of one topic."""

    schema: dict[str, Any]
    payloads: list[bytes] = field(default_factory=list)
    runs: list[int] = field(default_factory=list)


class _ReadIn:
    """What has been read so far."""

    def __init__(self) -> None:
        self._receipts: list[dict[str, Any]] = []
        self._schemas: dict[int, dict[str, Any]] = {}
        self._channels: dict[int, str] = {}
        self._topics: dict[str, _Topic] = {}
        self._run = 0
        self._begun = False  # the present run began at a gap, and the note of its restart has not come

    def describe(self, record: Metadata) -> None:
        if record.name == METADATA:
            self._receipts.append(from_texts(record.metadata))

    def add(self, record: Schema | Channel | Message) -> None:
        if isinstance(record, Schema):
            if record.encoding == "jsonschema":
                self._schemas[record.id] = json.loads(record.data)
        elif isinstance(record, Channel):
            if record.message_encoding == "json" and record.schema_id in self._schemas:
                self._channels[record.id] = record.topic
                self._topics.setdefault(record.topic, _Topic(self._schemas[record.schema_id]))
        elif record.channel_id in self._channels:
            name = self._channels[record.channel_id]
            if name == GAP:
                self._look_at_gap(RecordedGap(**json.loads(record.data)))
            elif name == NOTE and json.loads(record.data).get("restart"):
                if not self._begun:
                    self._run += 1
                self._begun = False
            self._topics[name].payloads.append(record.data)
            self._topics[name].runs.append(self._run)

    def _look_at_gap(self, gap: RecordedGap) -> None:
        """Begin a run where a daemon counts anew: ticks come before its first status, and with that the note."""
        topic = self._topics.get(gap.topic)
        if not self._receipts or topic is None or not topic.runs or topic.runs[-1] != self._run:
            return  # the first tick of its topic in a run that has begun
        if gap.missing:  # a client that has no status yet takes what a new daemon has counted further for lost
            since_s = json.loads(topic.payloads[-1])["timestamp"] + _START_S
            anew = gap.seq < (gap.timestamp - since_s) * self._receipts[-1]["rate_hz"]
        else:
            anew = gap.seq <= gap.after
        if anew:
            self._run += 1
            self._begun = True

    def recording(self, scan: Scan) -> Recording:
        if not self._receipts:
            raise HapticdError(
                f"{scan.path}: has no receipt: it is no recording of `hapticd record`, or was cut at its very beginning"
            )
        return Recording(
            path=scan.path,
            receipts=tuple(sorted(self._receipts, key=itemgetter("timestamp"))),
            topics={
                name.removeprefix(_TELEMETRY): checked(name, _table(topic))
                for name, topic in self._topics.items()
                if name.startswith(_TELEMETRY) and topic.payloads
            },
            gaps=tuple(RecordedGap(**row) for row in self._rows(GAP)),
            notes=tuple(Note(**row) for row in self._rows(NOTE)),
            cut=scan.cut,
        )

    def _rows(self, name: str) -> list[dict[str, Any]]:
        return rows_of(self._topics[name].payloads) if name in self._topics else []


def _table(topic: _Topic) -> dict[str, Values]:
    rows = rows_of(topic.payloads)
    table = columns_of(rows, topic.schema)
    known = topic.schema.get("properties", {})
    if topic.schema.get("title") == "hapticd/event":
        table["fields"] = [{key: value for key, value in row.items() if key not in known} for row in rows]
    first: dict[str, Values] = {name: table[name] for name in ("timestamp", "seq") if name in table}
    return {**first, "run": np.array(topic.runs, np.int64), **table}
