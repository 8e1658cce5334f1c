"""The publisher over real sockets: everyone gets everything, nobody waits for anybody."""

from __future__ import annotations

import errno
import math
import socket
import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import zmq

from hapticd.config.models import TelemetryConfig
from hapticd.errors import InstanceError
from hapticd.telemetry import publisher as publishing
from hapticd.telemetry.publisher import Publisher
from hapticd.telemetry.records import Status
from hapticd.tick.event import EventCode, LoopEvent
from hapticd_bench.telemetry import PERIOD_NS, measure, synthetic_info
from tests.telemetry.sockets import EPOCH_OFFSET_NS, Subscriber, Wire, seqs, served, ticks, wait_until

EVERY_TICK = ("hapticd/position", "hapticd/energy", "hapticd/damping", "hapticd/timing")


def test_sixteen_subscribers_get_every_tick() -> None:
    with Wire() as wire:
        subscribers = [wire.subscribe() for _ in range(16)]
        wire.publisher.publish(ticks(2000))
        for subscriber in subscribers:
            received = dict.fromkeys(EVERY_TICK, 0)
            while min(received.values()) < 2000:
                topic, maps = subscriber.message()
                if topic in received:
                    assert seqs(maps) == list(range(received[topic], received[topic] + len(maps)))
                    received[topic] += len(maps)
        assert wire.publisher.counts.refused == 0


def test_a_stalled_subscriber_costs_nobody_else() -> None:
    """It is sent far more than its queue and the kernel hold; the other one misses nothing meanwhile."""
    with Wire(send_high_water=100) as wire:
        stalled = wire.subscribe("hapticd/position", high_water=10)
        reading = wire.subscribe("hapticd/position")
        count = 20000
        records = ticks(count)
        slowest_s = 0.0
        for at in range(0, count, 200):
            before_s = time.process_time()
            wire.publisher.publish(records[at : at + 200])
            slowest_s = max(slowest_s, time.process_time() - before_s)
            assert seqs(reading.until("hapticd/position", 200)) == list(range(at, at + 200))
        assert slowest_s < 0.2
        late = [seq for _, maps in stalled.waiting() for seq in seqs(maps)]
        assert late == list(range(len(late)))
        assert len(late) < count / 2


def test_a_message_is_a_topic_and_an_array_of_maps_with_seconds_and_tick() -> None:
    with Wire() as wire:
        subscriber = wire.subscribe()
        wire.publisher.publish(ticks(200))
        wire.publisher.event(LoopEvent(EventCode.ARMED, "armed", 199, 0))
        messages = subscriber.waiting()  # `message` checks frames, arrays, timestamps
        assert {topic for topic, _ in messages} == {*EVERY_TICK, "hapticd/cycle", "hapticd/event", "hapticd/status"}
        (first, *_), *_ = (maps for topic, maps in messages if topic == "hapticd/position")
        assert first["timestamp"] == pytest.approx(EPOCH_OFFSET_NS * 1e-9, abs=1e-6)


def test_a_late_subscriber_gets_the_status_at_once() -> None:
    for prefix in ("hapticd/status", "hapticd/", ""):
        with Wire(every_ticks=5) as wire:
            wire.publisher.publish(ticks(50))
            wire.subscribe("hapticd/status")  # somebody was there before
            topic, (status,) = wire.subscribe(prefix).message()
            assert topic == "hapticd/status"
            assert (status["law"], status["seq"], status["schema"], status["every_ticks"]) == ("energy-cycle", 49, 1, 5)


def test_a_subscriber_to_something_else_gets_no_status() -> None:
    with Wire() as wire:
        subscriber = wire.subscribe("hapticd/event")
        wire.publisher.event(LoopEvent(EventCode.ARMED, "armed", 0, 0))
        assert [topic for topic, _ in subscriber.waiting()] == ["hapticd/event"]


def test_batches_are_full_at_batch_ticks() -> None:
    with Wire(batch_ticks=7) as wire:
        subscriber = wire.subscribe("hapticd/position")
        wire.publisher.publish(ticks(23))
        wire.publisher.flush(sys.maxsize)
        assert [len(maps) for _, maps in subscriber.waiting()] == [7, 7, 7, 2]


def test_ticks_that_would_fill_half_of_a_subscribers_queue_at_once_are_batched_by_time_alone() -> None:
    """A supervisor without a processor for a quarter of a second passed the queue of 1000 at `batch_ticks = 1`."""
    with Wire(batch_ticks=1) as wire:
        subscriber = wire.subscribe()
        wire.publisher.publish(ticks(83))
        wire.publisher.publish(ticks(250, first=83))
        wire.publisher.publish(ticks(2, first=333))
        messages = [maps for topic, maps in subscriber.waiting() if topic == "hapticd/position"]
    assert [len(maps) for maps in messages] == [1] * 83 + [20] * 12 + [10] + [1] * 2
    assert [seq for maps in messages for seq in seqs(maps)] == list(range(335))


def test_a_tick_waits_at_most_twenty_milliseconds() -> None:
    with Wire(batch_ticks=1000) as wire:
        subscriber = wire.subscribe("hapticd/position")
        for record in ticks(10, first=100):
            wire.publisher.publish([record])
        due = wire.publisher.flush_due_ns
        assert due == 100 * PERIOD_NS + 20_000_000
        wire.publisher.flush(due - 1)
        assert subscriber.waiting() == []
        wire.publisher.flush(due)
        assert [seqs(maps) for _, maps in subscriber.waiting()] == [list(range(100, 110))]
        assert wire.publisher.flush_due_ns is None


def test_ticks_that_come_late_and_many_are_still_batched_by_time() -> None:
    """A supervisor that stood still for a second sends no message that spans a second."""
    with Wire(batch_ticks=1000) as wire:
        subscriber = wire.subscribe("hapticd/position")
        wire.publisher.publish(ticks(1000))
        wire.publisher.flush(sys.maxsize)
        assert [len(maps) for _, maps in subscriber.waiting()] == [20] * 50


def test_decimation_thins_ticks_but_neither_cycles_nor_events() -> None:
    with Wire(every_ticks=10) as wire:
        subscriber = wire.subscribe()
        records = ticks(1000)
        for record in records:
            record.walls[0].cycle = record.seq
        wire.publisher.publish(records)
        for seq in range(5):
            wire.publisher.event(LoopEvent(EventCode.OVERRUN_BURST, "late", seq, 0))
        wire.publisher.flush(sys.maxsize)
        received: Counter[str] = Counter()
        for topic, maps in subscriber.waiting():
            received[topic] += len(maps)
            if topic in EVERY_TICK:
                assert all(seq % 10 == 0 for seq in seqs(maps))
        assert {topic: received[topic] for topic in EVERY_TICK} == dict.fromkeys(EVERY_TICK, 100)
        assert received["hapticd/cycle"] == 999
        assert received["hapticd/event"] == 5


def test_a_reload_changes_batches_and_decimation() -> None:
    with Wire() as wire:
        subscriber = wire.subscribe("hapticd/position")
        wire.publisher.reconfigure(TelemetryConfig(batch_ticks=3, every_ticks=2))
        wire.publisher.publish(ticks(12))
        assert [seqs(maps) for _, maps in subscriber.waiting()] == [[0, 2, 4], [6, 8, 10]]


@dataclass(frozen=True)
class Stylus:
    buttons: int = 2
    has_gripper: bool = False
    has_orientation: bool = False


def test_buttons_are_told_when_they_change_and_to_whoever_comes_later() -> None:
    with Wire(inputs=Stylus()) as wire:
        subscriber = wire.subscribe("hapticd/input")
        records = ticks(60)
        for record in records:
            record.buttons = 2 if 20 <= record.seq < 40 else 0
        wire.publisher.publish(records)
        wire.publisher.flush(sys.maxsize)
        told = [(fields["seq"], fields["buttons"]) for _, maps in subscriber.waiting() for fields in maps]
        assert told == [(0, 0), (20, 2), (40, 0)]
        _, (latest,) = wire.subscribe("hapticd/input").message()
        assert (latest["seq"], latest["buttons"]) == (40, 0)


def test_buttons_at_every_tick_when_asked() -> None:
    with Wire() as wire:
        config = TelemetryConfig(ipc=False, input_every_tick=True).model_copy(update={"tcp": "tcp://127.0.0.1:0"})
        publisher = Publisher(config, None, Stylus(), 0)
        subscriber = wire.socket(zmq.SUB, publisher.endpoints[0])
        subscriber.setsockopt(zmq.SUBSCRIBE, b"hapticd/input")
        wait_until(lambda: served(publisher) > 0, "a subscription")
        publisher.publish(ticks(40))
        publisher.close()
        assert seqs(Subscriber(subscriber).until("hapticd/input", 40)) == list(range(40))


def test_a_number_that_is_not_finite_is_counted() -> None:
    with Wire() as wire:
        subscriber = wire.subscribe("hapticd/position")
        records = ticks(20)
        records[3].force_n = (math.nan,)
        wire.publisher.publish(records)
        maps = subscriber.until("hapticd/position", 20)
        assert [fields["seq"] for fields in maps if fields.get("invalid")] == [3]
        assert maps[3]["force_n"] == [0]
        assert wire.publisher.counts.invalid == 1


def test_what_a_subscriber_sends_is_ignored() -> None:
    with Wire() as wire:
        subscriber = wire.subscribe("hapticd/position")
        rude = wire.socket(zmq.XSUB, wire.endpoint)
        for message in (b"", b"\x00hapticd/position", b"\x02noise", b"\x01" + b"t" * 500, b"\x01" + b"t" * 5000):
            rude.send(message)
        polite = wire.socket(zmq.SUB, wire.endpoint)
        before = served(wire.publisher)
        polite.setsockopt(zmq.SUBSCRIBE, b"hapticd/event")
        wait_until(lambda: served(wire.publisher) > before, "a subscription after all that")
        wire.publisher.publish(ticks(20))
        assert len(subscriber.until("hapticd/position", 20)) == 20


def test_close_sends_the_last_words_and_leaves_nothing_behind() -> None:
    with Wire() as wire:
        subscriber = wire.subscribe("hapticd/position", "hapticd/event")
        wire.publisher.publish(ticks(5))
        wire.publisher.event(LoopEvent(EventCode.STOPPING, "stopping", 5, 0))
        wire.publisher.close()
        wire.publisher.close()
        assert not wire.path.exists()
        wire.restart()  # it says up to where to read
        assert sorted(topic for topic, _ in subscriber.waiting()) == ["hapticd/event", "hapticd/position"]


def test_a_stalled_subscriber_does_not_keep_the_daemon_from_stopping() -> None:
    with Wire() as wire:
        wire.subscribe("hapticd/position", high_water=1)
        wire.publisher.publish(ticks(20000))
        before_s = time.monotonic()
        wire.publisher.close()
        assert time.monotonic() - before_s < 5.0


def open_at(path: Path | None, tcp: str | None = None) -> Publisher:
    config = TelemetryConfig().model_copy(update={"tcp": tcp})
    return Publisher(config, path, synthetic_info(), 0)


def refusal(path: Path | None, tcp: str | None = None) -> str:
    with pytest.raises(InstanceError) as caught:
        open_at(path, tcp)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_an_endpoint_that_cannot_be_had_is_named_with_a_remedy(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        endpoint = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
        text = refusal(tmp_path / "telemetry", endpoint)
        assert text.startswith(f"{endpoint}: another program listens there")
    assert not (tmp_path / "telemetry").exists()
    assert "not there; make it" in refusal(tmp_path / "nowhere" / "telemetry")
    assert "longer than 107 bytes" in refusal(tmp_path / ("d" * 120))
    (tmp_path / "file").write_text("mine")
    assert "no socket is in the way" in refusal(tmp_path / "file")
    assert (tmp_path / "file").read_text() == "mine"
    assert "no permission" in publishing._advice(errno.EACCES)
    assert "[telemetry]" in publishing._advice(errno.ENOMEM)


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.7", "*", "eth0", "[::]"])
def test_only_this_computer_is_served_without_keys(host: str) -> None:
    assert "other computers reach it, which takes keys: make them with `hapticd keys make`" in refusal(
        None, f"tcp://{host}:9872"
    )


@pytest.mark.parametrize("host", ["127.0.0.1", "127.9.9.9", "[::1]", "localhost"])
def test_loopback_addresses_are_served(host: str) -> None:
    if host == "[::1]" and not Path("/proc/net/if_inet6").exists():
        pytest.skip("this kernel has no IPv6, so no ::1 to serve")
    publisher = open_at(None, f"tcp://{host}:0")
    assert publisher.endpoints[0].startswith("tcp://")
    publisher.close()


def test_ipc_can_be_switched_off(tmp_path: Path) -> None:
    publisher = Publisher(TelemetryConfig(ipc=False), tmp_path / "telemetry", synthetic_info(), 0)
    publisher.publish(ticks(50))
    assert publisher.endpoints == []
    publisher.close()
    assert not (tmp_path / "telemetry").exists()


def test_status_is_kept_as_it_was_given() -> None:
    with Wire(say_status=False) as wire:
        before: dict[str, Any] = Status(law="tdpa", late_histogram=(1, 2, 3)).as_map()
        wire.publisher.status(before)
        before["law"] = "changed afterwards"
        _, (status,) = wire.subscribe("hapticd/status").message()
        assert (status["law"], status["late_histogram"]) == ("tdpa", [1, 2, 3])


def test_the_benchmark_measures_what_subscribers_got() -> None:
    cost = measure(subscribers=2, seconds=0.5)
    assert (cost.ticks, cost.missing) == (500, 0)
    assert 0.0 < cost.call_us < 1000.0
    assert cost.ratio > 1.0


def test_ticks_after_a_step_of_the_clock_are_stamped_by_it_and_those_before_are_not() -> None:
    with Wire() as wire:
        subscriber = wire.subscribe("hapticd/position")
        wire.publisher.publish(ticks(5))
        wire.publisher.follow_clock(EPOCH_OFFSET_NS + 3_600_000_000_000)
        wire.publisher.publish(ticks(5, first=5))
        wire.publisher.flush(sys.maxsize)
        stamps = [fields["timestamp"] for _, maps in subscriber.waiting() for fields in maps]
        assert stamps == sorted(stamps)
        assert stamps[5] - stamps[4] == pytest.approx(3600.001, abs=1e-5)
