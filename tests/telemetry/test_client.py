"""What a subscriber in Python sees: typed records, its own gaps, errors that say what to do."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import math
import sys
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import msgpack
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hapticd.client import (
    Client,
    ClientError,
    Cycle,
    Damping,
    EndpointError,
    Energy,
    Event,
    Gap,
    Input,
    Position,
    Record,
    SchemaError,
    SilenceError,
    Status,
    Timing,
    WireError,
    decode,
)
from hapticd.config.models import TelemetryConfig
from hapticd.supervisor.reload import LIVE
from hapticd.telemetry.wire import Topic, new_packer
from hapticd.tick import event as contract
from tests.examples import examples
from tests.telemetry.sockets import PATIENCE_S, Wire, served, ticks, wait_until
from tests.telemetry.test_publisher import Stylus

EVERY_TICK = (Position, Energy, Damping, Timing)


@contextlib.contextmanager
def heard(wire: Wire, *topics: Any) -> Iterator[Client]:
    """A client that has its first status, so that nothing published from now on passes it by."""
    before = served(wire.publisher)
    with Client(wire.endpoint, topics=topics or tuple(Topic), timeout_s=PATIENCE_S) as client:
        joined(client, wire, before + len(client._topics | {Topic.STATUS}))
        wait_until(lambda: client.receive(0.0) == [] and client.latest_status is not None, "the status")
        yield client


def joined(client: Client, wire: Wire, subscriptions: int) -> None:
    """Return when the publisher has heard the client, which renews its subscriptions only while it is polled."""
    wait_until(lambda: not client._socket.poll(0) and served(wire.publisher) >= subscriptions, "subscriptions")


def take(client: Client, count: int) -> list[Record]:
    records: list[Record] = []
    while len(records) < count:
        records += client.receive(PATIENCE_S) or pytest.fail("nothing came")
    return records


RELOADS: dict[str, Any] = {"batch_ticks": 7, "every_ticks": 3, "input_every_tick": True}
"""Another value for each key of [telemetry] that a reload may change."""


def test_no_reload_of_telemetry_makes_a_client_count_ticks_that_were_not_lost() -> None:
    """S8: the status overtook the batch that waited, and its ticks were counted by the new step: gaps of 8, 9 and 3."""
    assert {f"telemetry.{key}" for key in RELOADS} == {key for key in LIVE if key.startswith("telemetry.")}
    changes = [*RELOADS.items(), *((key, TelemetryConfig.model_fields[key].default) for key in RELOADS)]
    with Wire(inputs=Stylus()) as wire, heard(wire) as client:
        first, wanted = 0, TelemetryConfig()
        for key, value in changes:
            wire.publisher.publish(ticks(25, first))
            wanted = wanted.model_copy(update={key: value})
            wire.publisher.reconfigure(wanted)
            wire.publisher.status(Status(law=key).as_map())
            wire.publisher.publish(ticks(25, first + 25))
            first += 50
            wire.publisher.flush(sys.maxsize)
            wire.publisher.event(contract.LoopEvent(103, key, first, 0))
            received: list[Record] = []
            while not (received and isinstance(received[-1], Event)):
                received += client.receive(PATIENCE_S) or pytest.fail("nothing came")
            assert [one for one in received if isinstance(one, Gap)] == [], key
            seqs = [one.seq for one in received if isinstance(one, Position)]
            assert seqs[0] <= first - 50 + 2
            assert seqs[-1] >= first - 3
        assert sum(client.missing.values()) == 0


def test_every_topic_arrives_as_its_record() -> None:
    with Wire() as wire, heard(wire) as client:
        (record, *_) = records = ticks(200)
        wire.publisher.publish(records)
        wire.publisher.event(contract.LoopEvent(103, "none -> tdpa", 199, 0, {"law_index": 2}))
        received = take(client, 4 * 200 + 2)
        first = {type(one): one for one in reversed(received)}
        position, energy, damping, timing = (first[kind] for kind in EVERY_TICK)
        assert isinstance(position, Position)
        stamp = position.timestamp
        assert position == Position(
            stamp, 0, record.position_m, record.velocity_m_per_s, record.force_n, record.force_requested_n
        )
        assert energy == Energy(
            stamp, 0, record.energy_j, record.spring_energy_j, record.dissipated_j, record.generated_j
        )
        wall = record.walls[0]
        assert damping == Damping(stamp, 0, (wall.damping_n_s_per_m,), (wall.in_contact,), (wall.felt_mass_kg,))
        assert timing == Timing(stamp, 0, 0, record.late_us, record.busy_us, record.dt_s)
        cycle, told = first[Cycle], first[Event]
        assert isinstance(cycle, Cycle)
        assert (cycle.contact, cycle.cycle, cycle.duration_s) == (0, 1, 0.111)
        assert isinstance(told, Event)
        assert (told.code, told.text, told.seq, told.fields) == (103, "none -> tdpa", 199, {"law_index": 2})


def test_a_status_comes_back_as_the_supervisor_filled_it_in() -> None:
    status = Status(
        law="tdpa",
        axes=("x", "y"),
        late_histogram=(5, 0, 1),
        warnings=("not real-time: no rights",),
        armed=True,
        device_metrics={"lost_frames": 3.0, "echo_us": 812.5},
    )
    with Wire(say_status=False) as wire:
        wire.publisher.status(status.as_map())
        with heard(wire, "status") as client:
            assert client.latest_status is not None
            assert dataclasses.replace(client.latest_status, timestamp=0.0) == status


def test_topics_are_asked_for_by_class_or_by_name() -> None:
    with Wire() as wire, heard(wire, Cycle, "event") as client:
        wire.publisher.publish(ticks(200))
        wire.publisher.event(contract.LoopEvent(101, "armed", 0, 0))
        assert [type(one) for one in take(client, 2)] == [Cycle, Event]
        assert client.latest_status is not None  # always known, yielded only when asked for


@pytest.mark.parametrize(("every_ticks", "lost", "missing"), [(1, range(140, 160), 20), (10, range(100, 160), 6)])
def test_ticks_that_did_not_come_are_told_where_they_are_missing(every_ticks: int, lost: range, missing: int) -> None:
    with Wire(every_ticks=every_ticks) as wire, heard(wire, Position, Energy) as client:
        wire.publisher.publish([record for record in ticks(400) if record.seq not in lost])
        wire.publisher.close()
        received = take(client, 2 * (400 // every_ticks - missing) + 2)
        gap = Gap(Topic.POSITION, lost.start - every_ticks, lost.stop, missing)
        assert [one for one in received if isinstance(one, Gap)] == [gap, dataclasses.replace(gap, topic=Topic.ENERGY)]
        after = received[received.index(gap) + 1]
        assert isinstance(after, Position)
        assert after.seq == lost.stop
        assert client.missing[Topic.POSITION] == client.missing[Topic.ENERGY] == missing


def test_decimation_is_no_gap_even_when_it_changes() -> None:
    with Wire(every_ticks=10) as wire, heard(wire, Position) as client:
        wire.publisher.publish(ticks(200))
        wire.publisher.reconfigure(wire.config.model_copy(update={"every_ticks": 50}))
        wire.publisher.status(Status().as_map())
        wire.publisher.publish(ticks(1000, first=200))
        wire.publisher.close()
        assert not any(isinstance(one, Gap) for one in take(client, 20 + 20))


def test_a_client_that_is_too_slow_sees_its_own_gap() -> None:
    with Wire(send_high_water=10) as wire, heard(wire, Position) as client:
        count = 40_000
        for first in range(0, count, 1000):
            wire.publisher.publish(ticks(1000, first=first))
        received: list[Record] = []
        later = itertools.count(count, 20)

        def caught_up() -> bool:
            wire.publisher.publish(ticks(20, first=next(later)))  # while the queue is full these are lost as well
            while more := client.receive(0.0):
                received.extend(more)
            return bool(received) and received[-1].seq >= count

        wait_until(caught_up, "a tick from after the gap")
        seqs = [one.seq for one in received if isinstance(one, Position)]
        assert client.missing[Topic.POSITION] == seqs[-1] + 1 - len(seqs)
        assert client.missing[Topic.POSITION] > 10_000
        gaps = [(gap, after) for gap, after in pairwise(received) if isinstance(gap, Gap)]
        assert sum(gap.missing for gap, _ in gaps) == client.missing[Topic.POSITION]
        assert all(gap.seq == after.seq for gap, after in gaps)


def test_a_restarted_daemon_is_found_again_and_counts_anew() -> None:
    with Wire() as wire, heard(wire, Position) as client:
        wire.publisher.publish(ticks(20, first=500))
        take(client, 20)
        wire.restart()
        joined(client, wire, 2)
        wire.publisher.publish(ticks(20))
        gap, first, *_ = take(client, 21)
        assert gap == Gap(Topic.POSITION, 519, 0, 0)
        assert isinstance(first, Position)
        assert client.missing[Topic.POSITION] == 0


def test_a_restarted_daemon_that_has_counted_further_has_lost_nothing() -> None:
    """As when the network took longer to come back than the daemon before had run."""
    with Wire() as wire, heard(wire, Position) as client:
        wire.publisher.publish(ticks(20, first=500))
        take(client, 20)
        wire.restart(started_timestamp=2.0)
        joined(client, wire, 2)
        wire.publisher.publish(ticks(40, first=3000))
        gap, *after = take(client, 41)
        assert gap == Gap(Topic.POSITION, 519, 3000, 0)
        assert not any(isinstance(one, Gap) for one in after)
        assert client.missing[Topic.POSITION] == 0


def test_a_restart_is_told_once_though_ticks_come_before_the_status() -> None:
    with Wire() as wire, heard(wire, Position) as client:
        wire.publisher.publish(ticks(20, first=500))
        wire.publisher.publish(ticks(20))
        wire.publisher.status(Status(version="1.2.3", started_timestamp=2.0).as_map())
        wire.publisher.publish(ticks(20, first=20))
        gaps = [one for one in take(client, 61) if isinstance(one, Gap)]
        assert gaps == [Gap(Topic.POSITION, 519, 0, 0)]


def test_a_client_may_come_before_the_daemon() -> None:
    with Wire() as wire:
        wire.publisher.close()
        with Client(wire.endpoint, topics=[Position], timeout_s=PATIENCE_S) as client:
            assert client.receive(0.05) == []
            wire.restart()
            joined(client, wire, 2)
            wire.publisher.publish(ticks(20))
            assert isinstance(next(iter(client)), Position)


def test_nothing_is_yielded_before_the_schema_is_known() -> None:
    with Wire(say_status=False) as wire, Client(wire.endpoint, topics=[Position]) as client:
        joined(client, wire, 2)
        wire.publisher.publish(ticks(20))
        assert client.receive(0.05) == []
        wire.publisher.status(Status().as_map())
        wire.publisher.publish(ticks(20, first=20))
        assert take(client, 20)[0].seq == 20


def test_another_schema_is_refused_with_both_versions() -> None:
    with Wire() as wire, heard(wire) as client:
        wire.say("hapticd/status", [{"timestamp": 0.0, "seq": 0, "schema": 2, "version": "9.0"}])
        with pytest.raises(SchemaError, match=r"hapticd 9.0 there speaks schema 2, this client 1; install"):
            take(client, 1)


def test_silence_is_an_error_that_names_the_endpoint() -> None:
    with Wire() as wire, Client(wire.endpoint, topics=[Position], timeout_s=0.05) as client:
        with pytest.raises(SilenceError, match=r"telemetry: nothing for 0.05 s; is the daemon running there\?"):
            next(iter(client))
        assert client.receive() == []


def test_keys_and_topics_of_a_newer_daemon_are_ignored() -> None:
    energy = {"energy_j": 1, "spring_energy_j": 2.0, "dissipated_j": 3.0, "generated_j": 0.0}
    with Wire() as wire, heard(wire) as client:
        wire.say("hapticd/weather", [{"timestamp": 0.0, "seq": 0}])
        wire.say("hapticd/energy", [{"timestamp": 0.5, "seq": 3, **energy, "entropy": [1, None, "x"]}])
        assert take(client, 1) == [Energy(0.5, 3, 1.0, 2.0, 3.0, 0.0)]


def test_a_number_that_was_not_finite_is_marked() -> None:
    with Wire() as wire, heard(wire, Position) as client:
        records = ticks(20)
        records[7].force_n = (math.nan,)
        wire.publisher.publish(records)
        marked = [one for one in take(client, 20) if isinstance(one, Position) and one.invalid]
        assert [(one.seq, one.force_n) for one in marked] == [(7, (0.0,))]


@pytest.mark.parametrize(
    ("topic", "payload", "text"),
    [
        ("timing", {"seq": 1}, "payload is dict, not an array of maps"),
        ("timing", [3], "an element is int, not a map"),
        ("timing", [{"timestamp": 0.0}], "a map has no `seq`"),
        ("timing", [{"timestamp": math.nan, "seq": 1}], "timestamp = 'nan' is not a finite number"),
        ("timing", [{"timestamp": 0.0, "seq": "x" * 99}], f"seq = '{'x' * 40}' is not an integer"),
        ("event", [{"timestamp": 0.0, "seq": 0, "code": 1, "text": 5}], "text = '5' is not text"),
        ("status", [{"armed": 1}], "armed = '1' is not true or false"),
        ("status", [{"warnings": "x"}], "warnings = 'x' is not an array"),
    ],
)
def test_a_message_that_breaks_the_contract_says_how(topic: str, payload: Any, text: str) -> None:
    with pytest.raises(WireError) as caught:
        decode(f"hapticd/{topic}".encode(), msgpack.packb(payload))
    assert str(caught.value) == f"hapticd/{topic}: {text}"


def test_a_message_of_one_frame_is_refused() -> None:
    with Wire() as wire, heard(wire) as client:
        wire.publisher._socket.send(b"hapticd/position")
        with pytest.raises(WireError, match="1 frames, not topic and payload"):
            take(client, 1)


TOPICS = st.sampled_from([topic.encode() for topic in Topic])
PLAIN = st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text() | st.binary()
KEYS = st.sampled_from(["timestamp", "seq", "position_m", "code", "text", "schema", "axes", "armed"]) | st.text()
TREES = st.recursive(PLAIN, lambda inner: st.lists(inner) | st.dictionaries(KEYS, inner), max_leaves=20)


@given(TOPICS | st.binary(), st.binary())
@example(b"hapticd/event", b"\xd6\xff\xff\xff\xff\xff")  # msgpack's own timestamp type
@example(b"hapticd/event", b"\xdf\xff\xff\xff\xff")  # a map that claims 4 billion entries
@example(b"hapticd/event", b"\x91" * 5000)  # deeper than any stack
@example(b"hapticd/event", b"\x91\x81\x90\x00")  # an array as a key
def test_any_bytes_are_records_or_an_error_that_says_so(topic: bytes, payload: bytes) -> None:
    with contextlib.suppress(WireError):
        assert isinstance(decode(topic, payload), list)


@examples(60)
@given(TOPICS, st.lists(st.dictionaries(KEYS, TREES)) | TREES)
def test_any_msgpack_is_records_or_an_error_in_one_line(topic: bytes, payload: Any) -> None:
    text, records = "", []
    try:
        records = decode(topic, new_packer().pack(payload))
    except WireError as error:
        text = str(error)
    assert "\n" not in text
    assert all(one.topic.encode() == topic for one in records)


def test_misuse_is_told_before_anything_is_connected() -> None:
    with pytest.raises(ClientError, match="topic 'forces': not one of position, energy"):
        Client("ipc:///nowhere", topics=["forces"])
    with pytest.raises(EndpointError, match=r"an endpoint is ipc://PATH or tcp://HOST:PORT"):
        Client("nonsense")
    assert EndpointError.exit_code == 2


def test_what_a_device_does_not_have_is_not_in_its_input() -> None:
    assert decode(b"hapticd/input", msgpack.packb([{"timestamp": 0.0, "seq": 1, "buttons": 3}])) == [Input(0.0, 1, 3)]
