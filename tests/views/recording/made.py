"""Recordings made of known records, a daemon that says what a test wants, and the real `hapticd record`."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import struct
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgpack
import zmq

from hapticd.telemetry.records import Cycle, Damping, Energy, Event, Gap, Position, Sent, Status, Timing
from hapticd.telemetry.wire import Topic
from hapticd_views.recording.file import RecordingFile
from hapticd_views.recording.messages import Note, recorded_gap
from hapticd_views.recording.receipt import METADATA, as_texts, make_receipt
from tests.daemon.running import HAPTICD, PATIENCE_S

BEGAN_S = 1.7e9
STATUS = Status(
    timestamp=BEGAN_S, version="0", rate_hz=1000.0, law="none", device="model", driver="loopback", axes=("z", "x"),
    wall_axis=("z",), wall_position_m=(0.0,), wall_stiffness_n_per_m=(1e3,), warnings=("a line",), config_hash="abc",
    config_file="/etc/hapticd/lab.toml",
)  # fmt: skip
CONFIG = "[loop]\nrate_hz = 1000.0\n"
ANSWER = {**STATUS.as_map(), "config_text": CONFIG, "kernel": "Linux", "machine": "x", "python": "3"}


def odd(dice: random.Random) -> float:
    """A finite float of any bits."""
    while True:
        (number,) = struct.unpack("<d", dice.randbytes(8))
        if number - number == 0.0:
            return float(number)


def tick(seq: int, dice: random.Random) -> list[Sent]:
    """The records of one tick, of any finite numbers."""
    at = BEGAN_S + seq * 1e-3
    a, b, c, d = (odd(dice) for _ in range(4))
    return [
        Position(at, seq, (a, b), (b, c), (c, d), (d, a)),
        Energy(at, seq, a, b, c, d, invalid=seq == 7),
        Damping(at, seq, (a,), (seq % 2 == 0,), (b,)),
        Timing(at, seq, seq * 1_000_000 + 2**60, a, b, c),
    ]


def make(path: Path, ticks: int = 300, chunk_ticks: int = 40, end: bool = True) -> list[list[Sent]]:
    """Write a recording; what is in its ticks."""
    dice = random.Random(1)
    written = []
    file = RecordingFile(path)
    file.describe(METADATA, as_texts(make_receipt(STATUS, ANSWER)))
    for seq in range(ticks):
        written.append(tick(seq, dice))
        for record in written[-1]:
            file.add(record, record.timestamp)
        at = written[-1][0].timestamp
        if seq == 50:
            file.add(STATUS, at)
            file.add(Event(at, seq, 111, 'said "so" – µ', {"axis": "z", "depth_m": 0.1}), at)
            file.add(Cycle(at, seq, 0, 3, 0.1, 0.2, 0.3, 0.4), at)
            file.add(recorded_gap(Gap(Topic.POSITION, 10, 12, 1), at), at)
            file.add(Note(at, "seen"), at)
        if seq % chunk_ticks == chunk_ticks - 1:
            file.commit()
    file.commit()
    if end:
        file.close()
    return written


class Publisher:
    """A daemon's telemetry as far as a subscriber can tell, which says whatever it is told to."""

    def __init__(self, folder: Path) -> None:
        self.endpoint = f"ipc://{folder}/said"
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.XPUB)
        self._socket.setsockopt(zmq.XPUB_VERBOSE, 1)
        self._socket.setsockopt(zmq.SNDHWM, 0)
        self._socket.bind(self.endpoint)

    def __enter__(self) -> Publisher:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close(0)
        self._context.term()

    def await_subscriber(self) -> None:
        """Return when the subscriber has asked for all topics."""
        for _ in Topic:
            assert self._socket.poll(int(PATIENCE_S * 1e3)), "no subscriber came"
            self._socket.recv()

    def say(self, *records: Sent, **wrong: Any) -> None:
        """Send each record as the daemon would, but for what is wrong."""
        for record in records:
            fields = {name: getattr(record, name) for name in record.__slots__ if name != "fields"}
            self.say_bytes(record.topic, msgpack.packb([{**fields, **wrong}]))

    def say_bytes(self, *frames: str | bytes) -> None:
        """Send a message of any frames."""
        self._socket.send_multipart([frame.encode() if isinstance(frame, str) else frame for frame in frames])


class Recording:
    """`hapticd record` in a process of its own."""

    def __init__(
        self, output: Path, *arguments: str, environment: Mapping[str, str], prefix: Sequence[str] = ()
    ) -> None:
        self.output = output
        self.process = subprocess.Popen(
            [*prefix, HAPTICD, "record", "--output", str(output), *arguments],
            env={**os.environ, **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(ProcessLookupError):
            self.process.kill()
        self.process.communicate()

    def has(self, size: int) -> Recording:
        """Return when its file has that many bytes."""
        await_true(lambda: self.output.exists() and self.output.stat().st_size >= size, f"{size} bytes", self.process)
        return self

    def end(self, number: int = signal.SIGINT) -> tuple[int, str, str]:
        """Ask it to end: exit code, output, errors."""
        self.process.send_signal(number)
        return self.ended()

    def ended(self) -> tuple[int, str, str]:
        """Wait for its end: exit code, output, errors."""
        output, errors = self.process.communicate(timeout=PATIENCE_S)
        return self.process.returncode, output, errors


def await_true(condition: Callable[[], bool], what: str, process: subprocess.Popen[str] | None = None) -> None:
    """Return when something is true."""
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        if process is not None and process.poll() is not None:
            raise AssertionError(f"ended before {what}: {process.communicate()}")
        assert time.monotonic() < end_s, f"waited in vain for {what}"
        time.sleep(0.01)


def files_up_to(size: int) -> list[str]:
    """A prefix of a command under which no file gets larger [bytes]."""
    return ["prlimit", f"--fsize={size}:{size}"]
