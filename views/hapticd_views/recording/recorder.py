"""Record a running daemon: what it publishes goes into MCAP files, through restarts of the daemon, until it is over."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hapticd.client import DaemonClient, RefusedKeyError
from hapticd.errors import ConfigError, HapticdError, SchemaError, WireError
from hapticd.telemetry.records import Gap, Position, Record, Status, Tick
from hapticd.telemetry.wire import Topic
from hapticd_views.recording.file import RecordingFile
from hapticd_views.recording.messages import Note, recorded_gap
from hapticd_views.recording.output import place
from hapticd_views.recording.receipt import METADATA, as_texts, make_receipt

CHUNK_S = 0.4
"""Time of the ticks in a chunk at most; with one message more less than the half second that a kill may lose [s]."""

SYNC_S = 5.0
"""Time between two syncs: what a power cut may lose [s]."""

MOST_UNREAD = 50_000
"""Messages that may wait while the computer is too busy for the recorder: three minutes of them at 1 kHz, 100 MB."""

CATCH_UP_S = 10.0
"""How long the end may take where the computer was too busy for what has come to be read [s]."""

_WAIT_S = 0.05
_UNEVEN_S = 1.0  # where some topics stay behind, the next file begins all the same
_REFUSED_S = 1.0  # notes of messages that cannot be used come no faster


@dataclass(frozen=True, slots=True)
class Limits:
    """When a file ends and the next one begins.

    Attributes:
        size_bytes: at this size; None: never.
        duration_s: after this time [s]; None: never.
    """

    size_bytes: float | None = None
    duration_s: float | None = None

    @property
    def rotate(self) -> bool:
        """Whether there may be several files."""
        return self.size_bytes is not None or self.duration_s is not None


@dataclass(slots=True)
class Progress:
    """How far a recording is.

    Attributes:
        files: written so far, the present one last.
        duration_s: since it began [s].
        ticks: recorded.
        bytes: on the disk, in all files.
        gaps, missing: gaps, and the ticks that did not arrive.
        refused: messages that were not what the contract says.
        restarts: of the daemon.
    """

    files: list[Path] = field(default_factory=list)
    duration_s: float = 0.0
    ticks: int = 0
    bytes: int = 0
    gaps: int = 0
    missing: int = 0
    refused: int = 0
    restarts: int = 0


class Recorder:
    """Writes what a daemon publishes.

    Args:
        daemon: the daemon; which topics it was asked for decides what is recorded.
        output: the file; with limits that rotate, `F.mcap` stands for `F-001.mcap` and so on.
        limits: when the next file begins.
        overwrite: whether files may be replaced.

    Attributes:
        progress: how far it is.
    """

    def __init__(self, daemon: DaemonClient, output: Path, limits: Limits, overwrite: bool = False) -> None:
        self.progress = Progress()
        self._daemon = daemon
        self._output = output
        self._limits = limits
        self._overwrite = overwrite
        self._in_force: tuple[str, float] | None = None
        self._receipt: dict[str, Any] = {}
        self._gaps: list[Gap] = []
        self._seqs: dict[Topic, int] = {}  # the last tick of each topic that has every one
        self._written_bytes = 0
        self._refused_due_s = 0.0

    def run(
        self,
        stopped: Callable[[], bool],
        duration_s: float | None = None,
        tell: Callable[[Progress], object] | None = None,
    ) -> Progress:
        """Record until it is stopped, or this time has passed.

        Args:
            stopped: asked every 50 ms at least.
            duration_s: how long to record [s]; None: until stopped.
            tell: hears of the progress with every chunk.

        Raises:
            ConfigError: the file cannot be created, or one of those that may follow it is there.
            DiskError: the disk does not take any more; what was recorded is readable.
            RefusedKeyError: the daemon does not list this key any more; the file is complete.
            SchemaError: the daemon was replaced by one whose schema is not known; the file is complete.
        """
        began_s = self._synced_s = time.monotonic()
        self._refuse_taken()
        self._begin_file()
        self._drop_left()
        try:
            while not stopped() and (duration_s is None or time.monotonic() - began_s < duration_s):
                self._take(self._receive(_WAIT_S))
                now_s = time.monotonic()
                self.progress.duration_s = now_s - began_s
                if now_s - self._committed_s >= CHUNK_S:
                    self._commit()
                    if tell is not None:
                        tell(self.progress)
                self._rotate(now_s)
            self._catch_up()
        except (SchemaError, RefusedKeyError) as error:
            self._note(str(error))
            self._end_file()
            raise
        self._note("recording stopped")
        self._end_file()
        return self.progress

    def _refuse_taken(self) -> None:
        """A file of an older recording would end this one when its turn comes, hours later perhaps."""
        if not self._limits.rotate or not self._output.parent.is_dir():
            return
        like = re.compile(rf"{re.escape(self._output.stem)}-\d{{3,}}{re.escape(self._output.suffix)}")
        taken = sorted(path.name for path in self._output.parent.iterdir() if like.fullmatch(path.name))
        if self._overwrite:
            for name in taken:
                place(self._output.with_name(name), overwrite=True)  # another recorder may be writing it
        elif taken:
            raise ConfigError(
                f"{self._output.with_name(taken[0])}: exists, and would be one of the files; name another --output, or "
                "add --overwrite"
            )

    def _drop_left(self) -> None:
        """Files of a recording that is replaced are no part of this one, which may have fewer."""
        number = 2
        while self._limits.rotate and (left := self._part(number)).is_file():
            try:
                left.unlink()
            except OSError as error:
                raise ConfigError(
                    f"{left}: is of the recording before and cannot be removed: {error.strerror}"
                ) from None
            number += 1

    def _part(self, number: int) -> Path:
        return self._output.with_stem(f"{self._output.stem}-{number:03d}")

    def _begin_file(self) -> None:
        path = self._part(len(self.progress.files) + 1) if self._limits.rotate else self._output
        self._file = RecordingFile(path, self._overwrite)
        self.progress.files.append(path)
        self._committed_s = self._file_since_s = time.monotonic()
        self._span_s: tuple[float, float] | None = None  # the first and the last time in the chunk
        self._full_since_s: float | None = None
        self._last_s = time.time()
        if self._receipt:
            self._file.describe(METADATA, as_texts({**self._receipt, "timestamp": self._last_s}))
        elif self._daemon.latest_status is not None:
            self._look_at(self._daemon.latest_status)

    def _catch_up(self) -> None:
        """Take what came before the end and has not been read."""
        end_s = time.monotonic() + CATCH_UP_S
        refused = -1
        while refused != self.progress.refused and time.monotonic() < end_s:
            refused = self.progress.refused
            while (records := self._receive(0.0)) and time.monotonic() < end_s:
                self._take(records)

    def _receive(self, wait_s: float) -> list[Record]:
        try:
            return self._daemon.receive(wait_s)
        except SchemaError:
            raise
        except WireError as error:
            self.progress.refused += 1
            if time.monotonic() >= self._refused_due_s:
                self._refused_due_s = time.monotonic() + _REFUSED_S
                self._note(f"message refused, {self.progress.refused} so far: {error}")
            return []

    def _take(self, records: list[Record]) -> None:
        for record in records:
            if isinstance(record, Gap):
                self._gaps.append(record)
                continue
            if isinstance(record, Status):
                self._look_at(record)
            self._widen(record.timestamp)
            for gap in self._gaps:
                self._file.add(recorded_gap(gap, record.timestamp), record.timestamp)
                if gap.topic is Position.topic:
                    self.progress.gaps += 1
                    self.progress.missing += gap.missing
            self._gaps.clear()
            self._file.add(record, record.timestamp)
            self._last_s = record.timestamp
            if isinstance(record, Position):
                self.progress.ticks += 1
            if isinstance(record, Tick):
                self._seqs[record.topic] = record.seq

    def _widen(self, timestamp: float) -> None:
        """Begin a chunk where this one would get too long; one topic may come behind another."""
        span = self._span_s
        if span is not None:
            span = min(span[0], timestamp), max(span[1], timestamp)
            if span[1] - span[0] >= CHUNK_S:
                self._commit()
                span = None
        self._span_s = span or (timestamp, timestamp)

    def _look_at(self, status: Status) -> None:
        """Write a receipt where another configuration is in force, or another daemon."""
        in_force = (status.config_hash, status.started_timestamp)
        if in_force == self._in_force:
            return
        restarted = self._in_force is not None and self._in_force[1] != status.started_timestamp
        self._in_force = in_force
        if restarted:
            self._commit()
            self.progress.restarts += 1
            pause_s = max(0.0, status.timestamp - self._last_s)
            self._note(f"the daemon was started anew; nothing came for {pause_s:.1f} s", restart=True)
        asked: dict[str, Any] | HapticdError
        try:
            asked = self._daemon.receipt()
        except HapticdError as error:
            asked = error
        self._receipt = make_receipt(status, asked)
        self._file.describe(METADATA, as_texts(self._receipt))

    def _note(self, text: str, restart: bool = False) -> None:
        self._file.add(Note(self._last_s, text, restart), self._last_s)

    def _commit(self) -> None:
        self._file.commit()
        self._span_s = None
        now_s = self._committed_s = time.monotonic()
        self.progress.bytes = self._written_bytes + self._file.size
        if now_s - self._synced_s >= SYNC_S:
            self._file.sync()
            self._synced_s = now_s

    def _rotate(self, now_s: float) -> None:
        """Begin the next file where this one has its size or time, if possible between two ticks."""
        limits, age_s = self._limits, now_s - self._file_since_s
        if self._full_since_s is None and (
            (limits.size_bytes is not None and self._file.size >= limits.size_bytes)
            or (limits.duration_s is not None and age_s >= limits.duration_s)
        ):
            self._full_since_s = now_s
        if self._full_since_s is None:
            return
        between = len(set(self._seqs.values())) <= 1
        if between or now_s - self._full_since_s > _UNEVEN_S:
            self._end_file()
            self._begin_file()

    def _end_file(self) -> None:
        self._file.close()
        self._written_bytes += self._file.size
        self.progress.bytes = self._written_bytes
