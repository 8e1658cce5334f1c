"""Whatever comes over the wire, the recorder goes on or ends with one line, and its file is readable."""

from __future__ import annotations

import contextlib
import json
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import msgpack
import pytest

from hapticd.client import DaemonClient, RefusedKeyError
from hapticd.errors import ConfigError, HapticdError
from hapticd.telemetry.records import Event, Position, Record
from hapticd.telemetry.wire import Topic
from hapticd_views.recording import read
from hapticd_views.recording.recorder import Limits, Recorder
from hapticd_views.source import listen
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


def test_a_key_that_is_taken_from_the_list_ends_it_with_a_complete_file(publisher: Publisher, tmp_path: Path) -> None:
    path = tmp_path / "key.mcap"
    told: list[Position | None] = [*(position(seq) for seq in range(50)), None]

    class Struck(DaemonClient):
        """The daemon lets it in no more, as after `hapticd keys remove` and a reload."""

        def receive(self, timeout_s: float | None = 0.0) -> list[Record]:
            record = told.pop(0)
            if record is None:
                raise RefusedKeyError("does not let your key in")
            return [record]

    with connected(publisher, Struck) as daemon, pytest.raises(RefusedKeyError):
        Recorder(daemon, path, Limits()).run(lambda: False)
    made = read(path)
    assert made.complete
    assert "does not let your key in" in made.notes[-1].text
    assert len(made.topics["position"]["seq"]) == 50


def test_no_file_of_an_older_recording_ends_one_whose_files_follow_each_other(
    publisher: Publisher, tmp_path: Path
) -> None:
    taken = tmp_path / "long-007.mcap"
    taken.write_bytes(b"of an older one")
    with connected(publisher, DaemonClient) as daemon:
        with pytest.raises(ConfigError, match=r"long-007\.mcap: exists, and would be one of the files"):
            Recorder(daemon, tmp_path / "long.mcap", Limits(duration_s=60.0)).run(lambda: True)
        assert [path for path in tmp_path.iterdir() if path.suffix == ".mcap"] == [taken]
        Recorder(daemon, tmp_path / "long.mcap", Limits()).run(lambda: True)
    assert read(tmp_path / "long.mcap").complete


def test_a_daemon_that_is_listened_to_is_called_live_and_not_by_a_file_that_is_gone(publisher: Publisher) -> None:
    """One of 0.2.0 gives no configuration, and `hapticd plot live` then named a file below /tmp."""
    with connected(publisher, DaemonClient) as daemon:
        publisher.say(*(Position(STATUS.timestamp + seq, seq, *4 * ((0.5, 0.5),)) for seq in range(9)))
        with pytest.raises(HapticdError, match=r"^live: has no configuration: "):
            listen(daemon, 0.5, lambda: False)


@contextlib.contextmanager
def connected(publisher: Publisher, kind: type[DaemonClient]) -> Iterator[DaemonClient]:
    """A client of this kind that has its first status."""

    def say_status() -> None:
        publisher.await_subscriber()
        publisher.say(STATUS)

    saying = threading.Thread(target=say_status)
    saying.start()
    with kind("default", publisher.endpoint, None, None, tuple(Topic), None, 1000) as daemon:
        saying.join()
        yield daemon


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
