"""The memory between control process and supervisor: nothing torn, nothing lost in silence, nobody waits."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Generator
from pathlib import Path

import msgpack
import pytest

from hapticd.config.objects import MAX_OBJECTS
from hapticd.config.remote import MAX_PORTS
from hapticd.config.walls import MAX_WALLS
from hapticd.device import MOST_METRICS, Metric
from hapticd.errors import HapticdError
from hapticd.loop.memory import ANSWERED, DISARM, EVENTS, RECORDS, REQUESTS, EventReader, RecordReader, SharedMemory
from hapticd.loop.remote_slots import SlotWriter
from hapticd.tick.event import EventCode, LoopEvent
from hapticd.tick.record import RecordLayout, TickRecord
from hapticd.tick.remote.update import SLOT_BYTES, Update
from hapticd.trace import DriverTrace, lines
from hapticd_drivers.loopback import Loopback

LAYOUT = RecordLayout(3, False, MAX_WALLS)
RATE_HZ = 100.0  # 800 slots


@pytest.fixture
def shared() -> Generator[SharedMemory, None, None]:
    memory = SharedMemory(LAYOUT, RATE_HZ)
    yield memory
    memory.close()


def write(shared: SharedMemory, count: int) -> None:
    """Records as the loop writes them; every field of record n follows from n."""
    for _ in range(count):
        number = shared.words[RECORDS]
        walls = number % (MAX_WALLS + 1)
        scalars = [number] * 14 + [walls] + [number] * 12
        row = LAYOUT.struct(walls)
        row.pack_into(shared.record_area, number % shared.slots * LAYOUT.size, *scalars, *[number] * (9 * walls))
        shared.words[RECORDS] = number + 1


def whole(record: TickRecord) -> bool:
    number = record.seq
    scalars = [getattr(record, name) for name in TickRecord.__slots__[:14]]
    wall_numbers = [wall.cycle for wall in record.walls] + [wall.cycle_duration_s for wall in record.walls]
    vectors = (*record.position_m, *record.velocity_m_per_s, *record.force_n, *record.force_requested_n)
    return len(record.walls) == number % (MAX_WALLS + 1) and {*scalars, *vectors, *wall_numbers} == {number}


def test_a_reader_that_is_too_slow_costs_another_one_nothing(shared: SharedMemory) -> None:
    slow, quick = RecordReader(shared), RecordReader(shared)
    seen: list[int] = []
    for _ in range(3 * shared.slots // 100):
        write(shared, 100)
        seen += [record.seq for record in quick.read()]
    assert seen == list(range(3 * shared.slots))
    assert quick.dropped == 0
    late = [record.seq for record in slow.read()]
    assert late[-1] == seen[-1]
    assert len(late) + slow.dropped == len(seen)


def test_a_reader_may_begin_with_what_comes_next(shared: SharedMemory) -> None:
    write(shared, 30)
    reader = RecordReader(shared, newest=True)
    assert reader.read() == []
    write(shared, 2)
    assert [record.seq for record in reader.read()] == [30, 31]
    assert reader.dropped == 0


def test_records_come_out_as_they_went_in_and_once(shared: SharedMemory) -> None:
    reader = RecordReader(shared)
    write(shared, 30)
    assert [record.seq for record in reader.read()] == list(range(30))
    assert reader.read() == []
    write(shared, 1)
    assert [record.seq for record in reader.read()] == [30]
    assert reader.dropped == 0
    assert reader.fetched == 31


def test_a_read_can_be_bounded(shared: SharedMemory) -> None:
    reader = RecordReader(shared)
    write(shared, 30)
    assert [record.seq for record in reader.read(most=7)] == list(range(7))
    assert [record.seq for record in reader.read(most=100)] == list(range(7, 30))


@pytest.mark.parametrize("behind", [790, 798, 799, 800, 801, 1600, 5000])
def test_a_reader_that_was_too_slow_says_how_many_it_lost(shared: SharedMemory, behind: int) -> None:
    reader = RecordReader(shared)
    write(shared, 13)
    reader.read()
    write(shared, behind)
    records = reader.read(10_000)
    assert len(records) + reader.dropped == behind
    assert [record.seq for record in records] == list(range(13 + behind - len(records), 13 + behind))
    assert all(map(whole, records))
    assert (reader.dropped == 0) == (behind <= shared.slots - 2)
    assert len(records) == (behind if behind <= shared.slots - 2 else shared.slots // 2), "well clear of the writer"


WRITER = """
import sys, time
from hapticd.loop.memory import RECORDS, SharedMemory
from tests.loop.test_memory import LAYOUT, RATE_HZ, write
shared = SharedMemory(LAYOUT, RATE_HZ, int(sys.argv[1]))
end = time.monotonic() + float(sys.argv[2])
print("ready", flush=True)
while time.monotonic() < end:
    write(shared, 200)
"""


@pytest.mark.parametrize("lazy", [False, True])
def test_no_record_is_torn_and_every_loss_is_counted_at_full_speed(shared: SharedMemory, lazy: bool) -> None:
    """Another process writes as fast as it can; a lazy reader is overtaken all the time, in the middle of reads too."""
    reader = RecordReader(shared)
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(shared.descriptor), "1.0"],
        pass_fds=[shared.descriptor],
        cwd=Path(__file__).parents[2],
        stdout=subprocess.PIPE,
    )
    assert writer.stdout is not None
    writer.stdout.readline()
    received = 0
    last = -1
    running = True
    while running or reader._next < shared.words[RECORDS]:
        running = writer.poll() is None
        for record in reader.read(10_000):
            assert whole(record)
            assert record.seq > last
            last = record.seq
            received += 1
        if lazy and running:
            time.sleep(0.02)
    writer.stdout.close()
    assert writer.returncode == 0
    written = shared.words[RECORDS]
    assert written > 10_000
    assert received + reader.dropped == written
    assert last == written - 1
    if lazy:
        assert reader.dropped > 0


def test_a_record_that_is_overwritten_while_it_is_copied_is_dropped(
    shared: SharedMemory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The copy is looked at only after the counter has been looked at again."""
    reader = RecordReader(shared)
    write(shared, 700)

    class Overtaken:
        def __getitem__(self, part: slice) -> bytes:
            row = bytes(shared.record_area[part])
            write(shared, 5)
            return row

    monkeypatch.setattr(reader, "_area", Overtaken())
    records = reader.read()
    assert all(map(whole, records))
    assert len(records) + reader.dropped == 700
    assert 0 < reader.dropped < 700


def event(number: int, text: str = "", **fields: float | int | str) -> LoopEvent:
    return LoopEvent(EventCode.SWITCHED, text, number, number * 1_000_000, dict(fields))


def test_events_come_out_as_they_went_in_and_once(shared: SharedMemory) -> None:
    reader = EventReader(shared)
    sent = [event(1, "näher"), event(2, law="a", was="b", gain=0.5, count=3)]
    for each in sent:
        shared.write_event(each)
    assert reader.read() == sent
    assert reader.read() == []


@pytest.mark.parametrize("count", [255, 256, 257, 700])
def test_of_more_events_than_fit_the_newest_are_read_and_the_others_counted(shared: SharedMemory, count: int) -> None:
    reader = EventReader(shared)
    shared.write_event(event(-1))
    reader.read()
    for number in range(count):
        shared.write_event(event(number))
    events = reader.read()
    assert [each.seq for each in events] == list(range(count - len(events), count))
    assert len(events) == 255, "of 256 one may be being written"
    assert len(events) + reader.dropped == count
    assert reader.read() == []


def test_an_event_that_is_overwritten_while_it_is_read_is_dropped(
    shared: SharedMemory, monkeypatch: pytest.MonkeyPatch
) -> None:
    reader = EventReader(shared)
    for number in range(250):
        shared.write_event(event(number))

    class Overtaking:
        words = shared.words

        class view:  # noqa: N801 - stands for the attribute
            def __class_getitem__(cls, part: slice) -> bytes:
                row = bytes(shared.view[part])
                for _ in range(3):
                    shared.write_event(event(1000, "later " * 50))
                return row

    monkeypatch.setattr(reader, "_shared", Overtaking())
    events = reader.read()
    assert all(each.seq < 250 for each in events)
    assert len(events) + reader.dropped == 250
    assert reader.dropped > 0


@pytest.mark.parametrize("text", ["x" * 5000, "ä" * 400, "\udc80 and more", "🙂" * 400])
def test_a_text_that_is_too_long_or_no_text_is_cut_and_read(shared: SharedMemory, text: str) -> None:
    shared.write_event(event(1, text, law="kept"))
    (read,) = EventReader(shared).read()
    assert len(read.text.encode()) <= 600
    assert read.text[:10].isascii() or read.text[:100] == text[:100]
    assert read.fields == {"law": "kept"}


def test_fields_that_do_not_fit_are_left_out_and_the_text_stays(shared: SharedMemory) -> None:
    shared.write_event(event(1, "it happened", config="y" * 2000))
    (read,) = EventReader(shared).read()
    assert (read.text, read.fields) == ("it happened", {})
    shared.write_event(event(2, "next"))
    assert shared.words[EVENTS] == 2


@pytest.mark.parametrize("size", [1015, 1016, 1017, 1024, 1032, 1040])
def test_an_event_may_be_as_long_as_its_place_and_then_goes_without_its_fields(shared: SharedMemory, size: int) -> None:
    """1016 bytes are left behind the length; either way it is read, and so is the next one."""
    bare = len(msgpack.packb([EventCode.SWITCHED, "", 1, 1_000_000, {"config": "y" * 256}])) - 256
    long = event(1, config="y" * (size - bare))
    assert len(msgpack.packb([long.code, long.text, long.seq, long.deadline_ns, long.fields])) == size
    shared.write_event(long)
    shared.write_event(event(2, "next"))
    first, second = EventReader(shared).read()
    assert first == (long if size <= 1016 else event(1))
    assert second == event(2, "next")


def test_a_letter_is_read_answered_and_its_verdict_read(shared: SharedMemory) -> None:
    shared.words[DISARM] = 3
    shared.post({"do": "switch", "params": {"window": 2}, "scene": {"walls": [{"at": 1.5}]}})
    assert shared.words[REQUESTS] == 1
    assert shared.words[ANSWERED] == 0
    asked = {"do": "switch", "params": {"window": 2}, "scene": {"walls": [{"at": 1.5}]}, "disarm": 3}
    assert shared.request() == asked
    shared.answer("")
    assert shared.words[ANSWERED] == 1
    assert shared.verdict() == ""


def test_a_letter_of_262144_bytes_fits_and_no_longer_one(shared: SharedMemory) -> None:
    fits = {"do": "x" * ((1 << 18) - len(msgpack.packb({"do": "x" * 70_000, "disarm": 0})) + 70_000)}
    with pytest.raises(HapticdError, match="262145 bytes long, 262144 fit"):
        shared.post({"do": fits["do"] + "x"})
    assert shared.words[REQUESTS] == 0
    shared.post(fits)
    assert shared.request() == fits | {"disarm": 0}


def test_a_second_letter_waits_for_the_answer_to_the_first(shared: SharedMemory) -> None:
    shared.post({"do": "arm"})
    with pytest.raises(HapticdError, match="still busy"):
        shared.post({"do": "clear"})
    assert shared.request()["do"] == "arm"
    shared.answer("no")
    shared.post({"do": "clear"})
    assert shared.request()["do"] == "clear"


@pytest.mark.parametrize("value", [1 << 64, object(), "\udce9"])
def test_a_letter_that_cannot_be_written_is_refused_and_the_box_stays_free(shared: SharedMemory, value: object) -> None:
    with pytest.raises(HapticdError, match="cannot be told"):
        shared.post({"do": "switch", "params": {"seed": value}})
    shared.post({"do": "arm"})
    assert shared.request() == {"do": "arm", "disarm": 0}


@pytest.mark.parametrize("verdict", ["", "law gone", "ä" * 5000, "🙂" * 3000])
def test_a_verdict_is_read_as_far_as_it_fits(shared: SharedMemory, verdict: str) -> None:
    shared.answer(verdict)
    assert verdict.startswith(shared.verdict().rstrip("\N{REPLACEMENT CHARACTER}"))
    assert len(shared.verdict()) >= min(len(verdict), 1000)


def test_a_verdict_takes_the_room_that_there_is_and_nothing_of_the_letter(shared: SharedMemory) -> None:
    asked = {"do": "switch", "params": {"window": 2}, "disarm": 0}
    shared.post({"do": "switch", "params": {"window": 2}})
    for length in (4087, 4088, 4089, 4097, 9000):
        shared.answer("x" * length)
        assert shared.verdict() == "x" * min(length, 4088)
        assert shared.request() == asked


def test_both_sides_of_a_descriptor_see_the_same_memory(shared: SharedMemory) -> None:
    other = SharedMemory(LAYOUT, RATE_HZ, os.dup(shared.descriptor))
    write(shared, 3)
    shared.post({"do": "arm"})
    other.write_event(event(5, "seen"))
    assert [record.seq for record in RecordReader(other).read()] == [0, 1, 2]
    assert other.request()["do"] == "arm"
    assert [each.text for each in EventReader(shared).read()] == ["seen"]
    other.close()


def test_what_a_driver_counts_is_seen_on_the_other_side_from_the_first_on(shared: SharedMemory) -> None:
    class Counting(Loopback):
        METRICS = (Metric("frames", "frames that came"), Metric("echo_us", "age of the last one"))

    driver = Counting(Counting.Options(), 1e-3)
    driver.metrics[0] += 2  # counted before there was anybody to see it
    driver.share_metrics(shared.metrics)
    driver.metrics[0] += 1
    driver.metrics[1] = 812.5
    other = SharedMemory(LAYOUT, RATE_HZ, os.dup(shared.descriptor))
    assert list(other.metrics[:3]) == [3.0, 812.5, 0.0]
    assert len(other.metrics) == MOST_METRICS, "as many as a driver may have, and no more"
    write(other, 900)
    other.post({"do": "arm"})
    other.answer("no")
    assert list(shared.metrics[:3]) == [3.0, 812.5, 0.0]
    other.close()


def test_a_trace_goes_on_where_another_process_reads_it(shared: SharedMemory) -> None:
    driver = Loopback(Loopback.Options(), 1e-3)
    driver.trace = DriverTrace(4)
    for number in range(3):
        driver.trace.keep("before", number)
    driver.trace.share(shared.trace)
    driver.trace.keep("after")
    other = SharedMemory(LAYOUT, RATE_HZ, os.dup(shared.descriptor))
    write(other, 900)
    other.write_event(event(5, "x" * 600))
    assert [said.split(" ", 1)[1] for said in lines(other.trace)] == ["before 0", "before 1", "before 2", "after"]
    driver.trace.keep("newest")
    assert driver.trace.lines() == lines(other.trace)
    assert driver.trace.lines()[-1].endswith(" newest")
    assert len(driver.trace.lines()) == 4
    other.close()


def test_there_is_room_for_all_that_clients_may_drive(shared: SharedMemory) -> None:
    """As many objects, couplings and forces as a scene may have; what is said of the last one reaches no record."""
    ports = [(str(number), "object") for number in range(MAX_OBJECTS + MAX_PORTS)]
    writer = SlotWriter(shared, ports)
    write(shared, 1)
    for index in range(len(ports)):
        writer.write(index, Update())
    assert len(shared.remote) == len(ports) * SLOT_BYTES
    assert [whole(record) for record in RecordReader(shared).read()] == [True]


def test_of_a_memory_that_is_closed_nothing_is_left_in_the_process() -> None:
    """A supervisor makes one each time that a device comes back."""
    memory = SharedMemory(LAYOUT, RATE_HZ)
    descriptor = memory.descriptor
    mapping = f" {os.fstat(descriptor).st_ino} "
    assert mapping in Path("/proc/self/maps").read_text()
    memory.close()
    assert mapping not in Path("/proc/self/maps").read_text()
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(descriptor)


def test_the_history_is_eight_seconds_at_the_set_rate() -> None:
    for rate_hz in (100.0, 1000.0):
        memory = SharedMemory(LAYOUT, rate_hz)
        assert memory.slots == 8 * rate_hz
        memory.close()


@pytest.mark.parametrize("machine", ["aarch64", "i686"])
def test_a_processor_that_reorders_or_tears_stores_is_refused(monkeypatch: pytest.MonkeyPatch, machine: str) -> None:
    """C14: i686 was let in."""
    monkeypatch.setattr("platform.machine", lambda: machine)
    with pytest.raises(HapticdError, match=machine):
        SharedMemory(LAYOUT, RATE_HZ)


def test_a_python_of_32_bits_is_refused_on_any_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    """C14: a 64-bit kernel tells it x86_64 as well, but it stores a word in two halves."""
    monkeypatch.setattr("sys.maxsize", 2**31 - 1)
    with pytest.raises(HapticdError, match="64-bit Python"):
        SharedMemory(LAYOUT, RATE_HZ)
