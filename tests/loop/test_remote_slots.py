"""What clients say reaches the loop: the newest, whole, for the port that was meant, whatever process dies."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from hapticd.loop.memory import MOST_PORTS, REMOTE, SharedMemory
from hapticd.loop.remote_slots import SlotReader, SlotWriter, list_of
from hapticd.tick.record import RecordLayout
from hapticd.tick.remote.update import POSITION, SLOT_BYTES, Update
from tests.remote.heard import BALL, FIELD, TOOL, HeardPort

LAYOUT = RecordLayout(1, False, 8)
RATE_HZ = 100.0
PORTS = [(port.name, port.kind) for port in (TOOL, FIELD)]

HAMMER = """
import sys
from hapticd.loop.memory import SharedMemory
from hapticd.loop.remote_slots import SlotWriter
from hapticd.tick.record import RecordLayout
from hapticd.tick.remote.update import Update
shared = SharedMemory(RecordLayout(1, False, 8), 100.0, int(sys.argv[1]))
writer = SlotWriter(shared, [("tool", "coupling"), ("field", "force")])
update, number = Update(), 0
print(flush=True)
while True:
    number += 1
    update.seq = update.sent_ns = update.received_ns = update.said = number
    motion = (update.position_m, update.velocity_m_per_s, update.angular_velocity_rad_per_s)
    for vector in (*motion, update.force_n, update.orientation):
        vector[:] = [float(number)] * len(vector)
    update.stiffness_n_per_m = update.damping_n_s_per_m = float(number)
    writer.write(number % 2, update)
"""


@pytest.fixture
def shared() -> Iterator[SharedMemory]:
    memory = SharedMemory(LAYOUT, RATE_HZ)
    yield memory
    memory.close()


@pytest.fixture
def ports() -> list[HeardPort]:
    return [HeardPort(TOOL), HeardPort(FIELD)]


@pytest.fixture
def reader(shared: SharedMemory, ports: list[HeardPort]) -> SlotReader:
    reader = SlotReader(shared)
    reader.serve(ports, 0)
    return reader


def at(position_m: float, seq: int = 1) -> Update:
    update = Update()
    update.said = POSITION
    update.seq = seq
    update.position_m[0] = position_m
    return update


def test_what_is_said_of_a_port_is_taken_once_and_by_that_port(
    shared: SharedMemory, reader: SlotReader, ports: list[HeardPort]
) -> None:
    writer = SlotWriter(shared, PORTS)
    writer.write(1, at(0.25))
    reader.take(0)
    reader.take(0)
    assert [update.position_m[0] for update in ports[1].heard] == [0.25]
    assert ports[0].heard == []
    assert reader.seen == shared.words[REMOTE]


def test_the_word_counts_the_updates_and_a_tick_without_one_looks_at_nothing_else(
    shared: SharedMemory, reader: SlotReader, ports: list[HeardPort]
) -> None:
    assert (shared.words[REMOTE], reader.seen) == (0, 0)
    writer = SlotWriter(shared, PORTS)
    assert shared.words[REMOTE] == 0
    for number in range(3):
        writer.write(number % 2, at(0.1))
        assert shared.words[REMOTE] == number + 1
        assert reader.seen == number
        reader.take(0)
        assert reader.seen == number + 1
    SlotWriter(shared, PORTS)
    assert shared.words[REMOTE] == 3
    shared.remote_words[0] += 1
    SlotWriter(shared, PORTS)
    assert shared.words[REMOTE] == 4, "what was left half done is news"


def test_a_loop_that_has_no_ports_yet_takes_nothing_and_waits_for_nothing(shared: SharedMemory) -> None:
    reader = SlotReader(shared)
    SlotWriter(shared, PORTS).write(0, at(0.1))
    reader.take(0)
    assert reader.seen == shared.words[REMOTE] == 1


def test_of_several_updates_the_latest_is_taken(
    shared: SharedMemory, reader: SlotReader, ports: list[HeardPort]
) -> None:
    writer = SlotWriter(shared, PORTS)
    for number in range(5):
        writer.write(0, at(number, seq=number))
    reader.take(0)
    assert [update.seq for update in ports[0].heard] == [4]


def test_a_slot_that_is_just_being_written_waits_and_holds_no_other_up(
    shared: SharedMemory, reader: SlotReader, ports: list[HeardPort]
) -> None:
    writer = SlotWriter(shared, PORTS)
    writer.write(0, at(0.1))
    writer.write(1, at(0.2))
    shared.remote_words[0] -= 1  # as it is until the last store
    reader.take(0)
    assert ports[0].heard == []
    assert [update.position_m[0] for update in ports[1].heard] == [0.2]
    assert reader.seen != shared.words[REMOTE], "it is looked for again"
    shared.remote_words[0] += 1
    reader.take(0)
    assert [update.position_m[0] for update in ports[0].heard] == [0.1]
    assert len(ports[1].heard) == 1
    assert reader.seen == shared.words[REMOTE]


def test_what_a_killed_writer_has_left_half_done_is_taken_for_no_port(
    shared: SharedMemory, reader: SlotReader, ports: list[HeardPort]
) -> None:
    before = SlotWriter(shared, PORTS)
    for index, port in enumerate(ports):
        before.write(index, at(0.1))
        word = index * SLOT_BYTES // 8
        shared.remote_words[word] -= 1
        guard = shared.remote_words[word]
        after = SlotWriter(shared, PORTS)
        assert shared.remote_words[word] == guard + 1, "it counts on, so that no reader takes it for what it has seen"
        reader.take(0)
        assert port.heard == []
        assert reader.seen == shared.words[REMOTE], "and it costs no tick any more"
        after.write(index, at(0.3))
        reader.take(0)
        assert [update.position_m[0] for update in port.heard] == [0.3]


def test_who_writes_next_knows_what_was_said_last_of_the_same_ports(shared: SharedMemory) -> None:
    before = SlotWriter(shared, PORTS)
    before.write(0, at(0.1))
    before.write(0, at(0.2, seq=2))
    said = SlotWriter(shared, PORTS).written(0)
    assert said is not None
    assert (said.seq, said.position_m[0]) == (2, 0.2)
    assert SlotWriter(shared, PORTS).written(1) is None, "nothing was"
    assert SlotWriter(shared, reversed(PORTS)).written(0) is None, "it was said of another"
    shared.remote_words[0] -= 1
    assert SlotWriter(shared, PORTS).written(0) is None, "it was left half done"


class Watched(Update):
    """An update that notes how the word that guards its slot stands while it is written."""

    def __init__(self, words: memoryview[int]) -> None:
        super().__init__()
        self.words = words
        self.stood: list[int] = []

    def __getattribute__(self, name: str) -> object:
        if name == "stiffness_n_per_m":
            self.stood.append(self.words[0])
        return super().__getattribute__(name)


def test_the_word_that_guards_a_slot_is_odd_while_it_is_written_and_only_ever_rises(shared: SharedMemory) -> None:
    writer, update = SlotWriter(shared, PORTS), Watched(shared.remote_words)
    for number in range(3):
        writer.write(0, update)
        assert update.stood == [2 * earlier + 1 for earlier in range(number + 1)]
        assert shared.remote_words[0] == 2 * (number + 1)


def test_an_update_for_another_list_of_ports_is_taken_for_no_other_name(
    shared: SharedMemory, reader: SlotReader, ports: list[HeardPort]
) -> None:
    before = SlotWriter(shared, PORTS)
    assert before.recorded(1)
    assert not before.recorded(0), "this tick was recorded before there was a list"
    reader.serve([ports[1], ports[0]], 5)
    before.write(0, at(0.1))  # meant for the tool, which goes on
    reader.take(0)
    assert [len(port.heard) for port in ports] == [1, 0]
    assert not before.recorded(6)
    after = SlotWriter(shared, reversed(PORTS))
    assert (after.recorded(5), after.recorded(6)) == (False, True)
    reader.serve([ports[1], ports[0]], 7)
    assert after.recorded(6), "the list goes on"
    after.write(0, at(0.2))
    reader.take(0)
    assert len(ports[1].heard) == 1


def test_what_was_said_to_a_port_that_has_gone_is_not_heard_when_it_comes_back(
    shared: SharedMemory, reader: SlotReader, ports: list[HeardPort]
) -> None:
    """Its client may have gone since: one that was killed had a coupling pull the hand 19 mm away."""
    writer = SlotWriter(shared, PORTS)
    for there in ([], ports[:1]):
        reader.serve(there, 0)
        writer.write(1, at(0.1))  # before the other side knows that it has gone
        reader.take(0)
        reader.serve(ports, 0)
        reader.take(0)
        assert ports[1].heard == []
    writer.write(1, at(0.2))
    reader.take(0)
    assert len(ports[1].heard) == 1


def test_what_is_said_while_another_port_comes_reaches_the_one_that_stays(
    shared: SharedMemory, ports: list[HeardPort]
) -> None:
    """A release, which is said once: it was dropped, and the force stayed until the port's time was over."""
    reader = SlotReader(shared)
    reader.serve(ports[1:], 0)
    writer = SlotWriter(shared, PORTS[1:])
    writer.write(0, at(0.1))
    reader.serve(ports, 0)
    writer.write(0, at(0.2))
    reader.take(0)
    assert [len(port.heard) for port in ports] == [0, 2]


@pytest.mark.parametrize(
    ("sent_ns", "received_ns", "age_s"), [(0, 2_000_000, 3e-3), (1_000_000, 2_000_000, 4e-3), (0, 6_000_000, 0.0)]
)
def test_what_was_said_is_as_old_as_it_is_known_to_be(
    shared: SharedMemory, reader: SlotReader, ports: list[HeardPort], sent_ns: int, received_ns: int, age_s: float
) -> None:
    """From when it was sent, where that is known; what came after the loop woke is new."""
    said = at(0.1)
    said.sent_ns, said.received_ns = sent_ns, received_ns
    SlotWriter(shared, PORTS).write(0, said)
    reader.take(5_000_000)
    assert ports[0].ages_s == pytest.approx([age_s])


def test_a_new_loop_hears_nothing_that_was_said_to_the_one_before(shared: SharedMemory, ports: list[HeardPort]) -> None:
    SlotWriter(shared, PORTS).write(0, at(0.1))
    reader = SlotReader(shared)
    reader.serve(ports, 0)
    reader.take(0)
    assert ports[0].heard == []


def test_lists_are_told_apart_by_names_kinds_and_order() -> None:
    lists = [PORTS, PORTS[::-1], PORTS[:1], [("tool", "force"), PORTS[1]], [], [(BALL.name, BALL.kind)]]
    numbers = [list_of(each) for each in lists]
    assert len(set(numbers)) == len(lists)
    assert 0 not in numbers


def test_every_port_that_a_scene_can_have_has_a_slot_of_its_own(shared: SharedMemory) -> None:
    ports = [HeardPort(TOOL) for _ in range(MOST_PORTS)]
    reader = SlotReader(shared)
    reader.serve(ports, 0)
    writer = SlotWriter(shared, ((port.name, port.kind) for port in ports))
    records = bytes(shared.record_area)
    for index in range(MOST_PORTS):
        writer.write(index, at(float(index), seq=index))
    reader.take(0)
    assert [[update.seq for update in port.heard] for port in ports] == [[index] for index in range(MOST_PORTS)]
    assert bytes(shared.record_area) == records
    assert len(shared.remote) == MOST_PORTS * SLOT_BYTES


def test_no_update_is_torn_while_another_process_writes_as_fast_as_it_can_and_is_killed(
    shared: SharedMemory, reader: SlotReader, ports: list[HeardPort]
) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", HAMMER, str(shared.descriptor)], pass_fds=[shared.descriptor], stdout=subprocess.PIPE
    ) as hammer:
        assert hammer.stdout is not None
        hammer.stdout.readline()
        while min(len(port.heard) for port in ports) < 300:
            reader.take(0)
        os.kill(hammer.pid, signal.SIGKILL)
    SlotWriter(shared, PORTS)
    reader.take(0)
    assert reader.seen == shared.words[REMOTE]
    for parity, port in enumerate(ports):
        for update in port.heard:
            vectors = (update.position_m, update.velocity_m_per_s, update.angular_velocity_rad_per_s, update.force_n)
            numbers = {number for vector in (*vectors, update.orientation) for number in vector}
            numbers |= {update.stiffness_n_per_m, update.damping_n_s_per_m, update.said, update.sent_ns}
            assert numbers == {update.seq}
            assert update.seq % 2 == parity
        seqs = [update.seq for update in port.heard]
        assert seqs == sorted(set(seqs))
