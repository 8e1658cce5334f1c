"""A daemon in a process of its own, with everything that its loop recorded."""

from __future__ import annotations

import logging
import os
import tempfile
import threading
import time
from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any

from hapticd.config.loading import parse
from hapticd.errors import HapticdError
from hapticd.loop.memory import RecordReader, SharedMemory
from hapticd.loop.realtime import die_with_parent
from hapticd.supervisor.daemon import Daemon
from hapticd.tick.record import TickRecord
from hapticd_bench.tick.spawned import Spawned

BURST_S = 0.07
BURST_PAUSE_S = 0.1
"""A heavy publisher computes in pure Python for `BURST_S`, then only publishes for `BURST_PAUSE_S` [s]."""

START_TIMEOUT_S = 30.0


@dataclass(slots=True)
class Ticks:
    """Tick records in columns, and how the process that ran them fared.

    Attributes:
        seq, deadline_ns, late_us, busy_us, skipped: of each record.
        dropped: records that were overwritten before they were read.
        fault: text of the first fault, empty without one.
        warnings: what the loop could not have.
    """

    seq: array[int] = field(default_factory=lambda: array("q"))
    deadline_ns: array[int] = field(default_factory=lambda: array("q"))
    late_us: array[float] = field(default_factory=lambda: array("d"))
    busy_us: array[float] = field(default_factory=lambda: array("d"))
    skipped: array[int] = field(default_factory=lambda: array("q"))
    dropped: int = 0
    fault: str = ""
    warnings: tuple[str, ...] = ()

    def add(self, record: TickRecord) -> None:
        """Keep a record."""
        self.seq.append(record.seq)
        self.deadline_ns.append(record.deadline_ns)
        self.late_us.append(record.late_us)
        self.busy_us.append(record.busy_us)
        self.skipped.append(record.skipped)

    def from_s(self, settle_s: float) -> Ticks:
        """The same without the first seconds."""
        limit_ns = self.deadline_ns[0] + settle_s * 1e9 if self.deadline_ns else 0.0
        first = sum(deadline_ns < limit_ns for deadline_ns in self.deadline_ns)
        return Ticks(
            self.seq[first:],
            self.deadline_ns[first:],
            self.late_us[first:],
            self.busy_us[first:],
            self.skipped[first:],
            self.dropped,
            self.fault,
            self.warnings,
        )


class KeptRecords(RecordReader):
    """A reader of the ring that keeps what it reads, and computes in between if it is to be heavy.

    Args:
        shared: the memory.
        heavy: compute in pure Python for `BURST_S` now and then.

    Attributes:
        ticks: what was read.
    """

    def __init__(self, shared: SharedMemory, heavy: bool) -> None:
        super().__init__(shared)
        self.ticks = Ticks()
        self.started = threading.Event()
        self._burst_at_s = 0.0 if heavy else float("inf")

    def read(self, most: int = 4096) -> list[TickRecord]:
        """The records that are new; a heavy reader takes its time before it says so."""
        records = super().read(most)
        for record in records:
            self.ticks.add(record)
        if records:
            self.started.set()
        if time.monotonic() >= self._burst_at_s:
            _burst(time.monotonic() + BURST_S)
            self._burst_at_s = time.monotonic() + BURST_PAUSE_S
        return records


class RecordedLoop:
    """A control loop in another process, with everything that it recorded.

    Args:
        serve: runs it there: a function of a connection, a configuration's text and `heavy`.
        text: the configuration.
        heavy: with a heavy publisher.

    Raises:
        HapticdError: it could not start.
    """

    def __init__(self, serve: Callable[[Connection, str, bool], None], text: str, heavy: bool = False) -> None:
        self._process = Spawned("the measured loop", serve, text, heavy)
        try:
            self._process.receive(START_TIMEOUT_S)
        except BaseException:
            self.kill()
            raise

    def stop(self) -> Ticks:
        """End it and get its ticks.

        Raises:
            HapticdError: it ended badly.
        """
        try:
            self._process.terminate()
            ticks: Ticks = self._process.receive(START_TIMEOUT_S)
            self._process.join(5.0)
        finally:
            self.kill()
        return ticks

    def kill(self) -> None:
        """End it whatever it does; harmless when it has ended."""
        self._process.kill()


def serve_daemon(connection: Connection, text: str, heavy: bool) -> None:
    """Run the real daemon until SIGTERM: supervisor here, control process of its own."""
    die_with_parent(os.getppid())
    logging.getLogger("hapticd").addHandler(logging.NullHandler())  # its warnings are figures of the report
    with tempfile.TemporaryDirectory(prefix="hapticd-bench-") as runtime:
        os.environ["HAPTICD_RUNTIME_DIR"] = runtime
        try:
            daemon = Daemon(parse(text, "benchmark"), "bench")
            kept = KeptRecords(daemon.state.loop.shared, heavy)
            daemon.state.loop.reader = kept
            threading.Thread(target=_tell_start, args=(connection, kept.started), daemon=True).start()
            read_events = daemon.state.loop.events.read

            def watched() -> Any:
                events = read_events()
                for event in events:
                    if event.is_fault and not kept.ticks.fault:
                        kept.ticks.fault = event.text
                return events

            vars(daemon.state.loop.events)["read"] = watched
            kept.ticks.warnings = tuple(daemon.state.loop.warnings)
            exit_code = daemon.run()
            kept.ticks.dropped = kept.dropped
            if exit_code and not kept.ticks.fault:
                kept.ticks.fault = f"the daemon ended with exit code {exit_code}"
            connection.send(kept.ticks)
        except HapticdError as error:
            connection.send(HapticdError(str(error)))


def _burst(until_s: float) -> None:
    total = 0
    while time.monotonic() < until_s:
        for number in range(2000):
            total += number * number


def _tell_start(connection: Connection, started: threading.Event) -> None:
    if started.wait(START_TIMEOUT_S):
        connection.send(None)
