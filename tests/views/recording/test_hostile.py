"""Whatever comes over the wire, the recorder goes on or ends with one line, and its file is readable."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from pathlib import Path

import msgpack
import pytest

from hapticd.telemetry.records import Event, Position
from hapticd_views.recording import read
from tests.views.recording.made import STATUS, Publisher, Recording

HOSTILE = [
    (b"hapticd/position", b""),
    (b"hapticd/position", b"\xc1"),
    (b"hapticd/position", msgpack.packb({"seq": 1})),
    (b"hapticd/position", msgpack.packb([1, 2])),
    (b"hapticd/position", msgpack.packb([{"timestamp": "now", "seq": 1}])),
    (b"hapticd/position", b"\xdd\xff\xff\xff\xff"),
    (b"hapticd/timing", msgpack.packb([{"timestamp": 1.0, "seq": 1, "deadline_ns": 1.5, "late_us": 1, "busy_us": 1}])),
    (b"hapticd/event", msgpack.packb([{"timestamp": float("nan"), "seq": 0, "code": 1, "text": ""}])),
    (b"hapticd/status", msgpack.packb([{"timestamp": 1.0, "seq": 1, "axes": "z"}])),
    (b"hapticd/unknown", msgpack.packb([{"timestamp": 1.0, "seq": 1}])),
    (b"hapticd/position",),
    (b"hapticd/position", b"\x90", b"\x90"),
]
FAR = 1e300


@pytest.fixture
def publisher(tmp_path: Path) -> Iterator[Publisher]:
    with Publisher(tmp_path) as said:
        yield said


def begin(publisher: Publisher, path: Path) -> Recording:
    recording = Recording(path, "--json", "--connect", publisher.endpoint, environment={})
    publisher.await_subscriber()
    publisher.say(STATUS)
    return recording


def position(seq: int, timestamp: float | None = None) -> Position:
    at = STATUS.timestamp + seq * 1e-3 if timestamp is None else timestamp
    return Position(at, seq, (0.5,), (0.0,), (1.0,), (1.0,))


def test_what_is_not_the_contract_is_refused_and_the_rest_recorded(publisher: Publisher, tmp_path: Path) -> None:
    path = tmp_path / "hostile.mcap"
    with begin(publisher, path) as recording:
        for seq in range(100):
            publisher.say(position(seq))
            publisher.say_bytes(*HOSTILE[seq % len(HOSTILE)])
        publisher.say(position(100, FAR), position(101, -FAR))
        publisher.say(position(2**63), position(-5))
        publisher.say(Event(STATUS.timestamp, 0, 2**63, "\x00\x1b[2J ; DROP", {}), fields=0, code=2**64 - 1)
        publisher.say(Event(STATUS.timestamp, 0, 999, "x" * 1_000_000, {}), extra={"deep": [1]}, seq=0)
        publisher.say(position(200))
        recording.has(1000)
        publisher.say(*(position(seq) for seq in range(201, 1000)))
        recording.has(path.stat().st_size + 1000)
        code, output, errors = recording.end()
    assert (code, errors) == (0, "")
    told = json.loads(output)
    assert told["refused"] > 80
    made = read(path)
    assert made.complete
    seqs = made.topics["position"]["seq"].tolist()
    assert set(range(100)) <= set(seqs)
    assert 200 in seqs
    assert "message refused" in made.notes[0].text
    assert made.receipt["config_text"] == ""
    assert "only its telemetry was named" in made.receipt["config_missing"]
    assert [len(event.text) for event in made.events][-1] == 1_000_000


def test_a_gap_is_written_as_a_gap(publisher: Publisher, tmp_path: Path) -> None:
    path = tmp_path / "gap.mcap"
    with begin(publisher, path) as recording:
        publisher.say(*(position(seq) for seq in (*range(100), *range(150, 700))))
        recording.has(1)
        publisher.say(*(position(seq) for seq in range(700, 1300)))
        recording.has(path.stat().st_size + 100)
        recording.end(signal.SIGHUP)
    made = read(path)
    (gap,) = made.gaps
    assert (gap.topic, gap.after, gap.seq, gap.missing) == ("hapticd/position", 99, 150, 50)
    assert gap.timestamp == position(150).timestamp
    assert made.missing == 50


def test_a_daemon_of_another_schema_ends_it(publisher: Publisher, tmp_path: Path) -> None:
    path = tmp_path / "schema.mcap"
    with begin(publisher, path) as recording:
        publisher.say(*(position(seq) for seq in range(1000)))
        recording.has(1000)
        publisher.say(STATUS, schema=2)
        code, _, errors = recording.ended()
    assert code == 1
    assert "speaks schema 2" in errors
    assert len(errors.splitlines()) == 1
    made = read(path)
    assert made.complete
    assert "speaks schema 2" in made.notes[-1].text
    assert len(made.topics["position"]["seq"]) > 300


def test_a_message_that_is_too_large_is_never_taken_in(publisher: Publisher, tmp_path: Path) -> None:
    """ZeroMQ hangs up on who sends it, and calls again."""
    path = tmp_path / "large.mcap"
    with begin(publisher, path) as recording:
        publisher.say_bytes(b"hapticd/position", bytes(17 * 1024 * 1024))
        publisher.await_subscriber()
        publisher.say(STATUS, *(position(seq) for seq in range(1000)))
        recording.has(1000)
        code, _, errors = recording.end()
    assert (code, errors) == (0, "")
    assert read(path).complete
