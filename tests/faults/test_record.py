"""A fault record is read as it was written, whole or not at all, and says of itself what it is."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

import pytest

from hapticd.cli import main
from hapticd.config.loading import parse
from hapticd.contracts.driver import DeviceInfo
from hapticd.contracts.errors import HapticdError
from hapticd.contracts.event import Event, EventCode
from hapticd.contracts.record import RecordLayout
from hapticd.control.shared import RECORDS, SharedMemory
from hapticd.faults.export import write_csv
from hapticd.faults.file import MAGIC, encode, read, read_header
from hapticd.faults.place import fault_directories, fault_directory
from hapticd.faults.receipt import receipt
from hapticd.faults.store import FaultStore
from hapticd.faults.summary import summarise
from hapticd.supervisor.recorder import FaultRecorder

RATE_HZ = 1000.0
LAYOUT = RecordLayout(2, True, 8)
EVENT = Event(EventCode.OVER_SPEED, "3 m/s is above the limit", 20, 20_000_000, {"speed": 3.0})


def row(seq: int, force_n: float, walls: int = 1) -> bytes:
    head = (seq, seq * 1_000_000, 5.0, 60.0, 1e-3, 0, 1, 0, 3, 0.02, 0.1, 0.2, 0.3, 0.4, walls)
    axes = (0.001 * seq, 0.0, 0.1, 0.0, force_n, 0.0, force_n, 0.0, *range(9))
    packed = LAYOUT.struct(walls).pack(*head, *axes, *((1, 9.5, 0.25, 2, 0.1, 0.01, 9.0, 0.4) * walls))
    return packed.ljust(LAYOUT.size, b"\xff")  # what lies behind the last wall is anything


def device() -> DeviceInfo:
    bounds = ((-1.0, 1.0), (-1.0, 1.0))
    return DeviceInfo("a device", "7", ("x", "y"), float("inf"), 0.0, bounds, 1000.0, 10.0, None, simulated=True)


def header() -> dict[str, Any]:
    return receipt(EVENT, 1e9, "left", parse("[loop]\nrate_hz = 1000.0\n", "lab.toml"), device())


def content() -> bytes:
    forces = [2.0] * 20 + [3.0, 1.0, 0.0, 0.0]
    return encode(header(), LAYOUT, iter([b"".join(row(seq, force) for seq, force in enumerate(forces))]), 8)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return FaultStore(tmp_path).write(1e9, 202, content(), keep=5)


def test_a_record_says_what_happened_to_what_under_which_configuration(path: Path) -> None:
    said = read_header(path)
    assert (said["event"]["code"], said["event"]["name"], said["event"]["fields"]) == (202, "OVER_SPEED", {"speed": 3.0})
    assert said["config"]["text"] == "[loop]\nrate_hz = 1000.0\n"
    assert (said["device"]["max_force_n"], said["ticks"]["count"]) == (None, 24)
    for key in ("kernel", "version", "machine", "python", "law", "driver"):
        assert said[key]


def test_ticks_come_back_as_they_were(path: Path) -> None:
    record = read(path)
    assert record.ticks == [LAYOUT.unpack(row(tick.seq, tick.force_n[0])) for tick in record.ticks]
    figures = summarise(record)
    assert (figures.ticks, figures.force_before_n, figures.peak_force_n, figures.ramp_ticks) == (24, 2.0, 3.0, 2)
    assert (figures.before_s, figures.after_s) == (pytest.approx(0.02), pytest.approx(0.003))


def test_a_csv_has_every_field_of_every_tick_and_wall() -> None:
    rows = [row(0, 1.0, walls=1), row(1, 1.0, walls=2)]
    directory_free = io.StringIO()
    store = encode(header(), LAYOUT, iter(rows), 8)
    file = Path("/dev/shm") / "hapticd-test-record"
    try:
        file.write_bytes(store)
        write_csv(read(file), directory_free)
    finally:
        file.unlink()
    table = list(csv.DictReader(io.StringIO(directory_free.getvalue())))
    assert [line["t_s"] for line in table] == ["-0.020000", "-0.019000"]
    assert (table[0]["force_n[0]"], table[0]["orientation[8]"], table[0]["buttons"]) == ("1.0", "8.0", "3")
    assert (table[0]["damping_n_s_per_m[1]"], table[1]["damping_n_s_per_m[1]"]) == ("", "9.5")
    assert len(table[0]) == 1 + 14 + 4 * 2 + 9 + 2 * 8


@pytest.mark.parametrize(
    "damaged",
    [b"", b"hello", MAGIC, MAGIC + b"{", MAGIC + b"{}\n", content()[:-20], content().replace(b"<qq", b"<qQ"), b"\xff" * 500],
)
def test_a_damaged_record_is_named_in_one_line(tmp_path: Path, damaged: bytes) -> None:
    file = tmp_path / "x.fault"
    file.write_bytes(damaged)
    with pytest.raises(HapticdError, match="x.fault") as raised:
        read(file)
    assert "\n" not in str(raised.value)


def test_the_oldest_record_makes_room_and_no_half_record_stays(tmp_path: Path) -> None:
    store = FaultStore(tmp_path / "state" / "faults")
    assert store.paths() == []
    for second in range(4):
        store.write(1e9 + second, 204, content(), keep=2)
    assert [path.stem for path in store.paths()] == ["20010909T014643.000Z-204", "20010909T014642.000Z-204"]
    (store.directory / "20010909T014640.000Z-204.part").touch()
    store.write(1e9 + 9, 204, content(), keep=2)
    assert {path.suffix for path in store.directory.iterdir()} == {".fault"}


class Ring:
    """A loop's memory, filled by hand."""

    def __init__(self) -> None:
        self.shared = SharedMemory(LAYOUT, RATE_HZ)

    def write(self, count: int, first_seq: int = 0) -> None:
        written = self.shared.words[RECORDS]
        for number in range(written, written + count):
            start = number % self.shared.slots * LAYOUT.size
            self.shared.record_area[start : start + LAYOUT.size] = row(first_seq + number, 1.0)
        self.shared.words[RECORDS] = written + count


def recorded(ring: Ring, seq: int, directory: Path, after: int) -> list[int]:
    """Numbers of the ticks in a record of a fault at this tick, when the loop goes on for so many."""
    recorder = FaultRecorder(directory)
    event = Event(EventCode.OVER_SPEED, "too fast", seq, seq * 1_000_000)
    recorder.begin(event, 1e9, ring.shared, RATE_HZ, header())
    assert recorder.turn(5) == ""
    assert FaultStore(directory).paths() == [], "it waits for the ticks after the fault"
    ring.write(after, ring.first)
    assert recorder.close(5, 10.0) == ""
    assert recorder.written == 1
    (path,) = FaultStore(directory).paths()
    return [tick.seq for tick in read(path).ticks]


@pytest.mark.parametrize(
    ("before", "first_seq", "seq", "after", "first", "last"),
    [
        (7000, 0, 6990, 1500, 1990, 7990),  # all of it
        (300, 0, 290, 1500, 0, 1290),  # just started
        (7000, 0, 6999, 0, 1999, 6999),  # the loop ended with it
        (100, 5000, 5090, 1500, 5000, 6090),  # a loop that goes on for one before it
        (9000, 0, 1500, 0, 1002, 2500),  # the supervisor slept: what the ring still has
        (20000, 0, 1500, 0, None, None),  # nothing of it
    ],
)
def test_a_record_holds_five_seconds_before_and_one_after_or_what_there_is(
    tmp_path: Path, before: int, first_seq: int, seq: int, after: int, first: int | None, last: int | None
) -> None:
    ring = Ring()
    ring.write(before, first_seq)
    ring.first = first_seq
    seqs = recorded(ring, seq, tmp_path, after) if after or before == 7000 else recorded_late(ring, seq, tmp_path)
    assert seqs == ([] if first is None or last is None else list(range(first, last + 1)))
    ring.shared.close()
