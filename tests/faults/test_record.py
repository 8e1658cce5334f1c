"""A fault record is read as it was written, whole or not at all, and says of itself what it is."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
import stat
import threading
import time
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from hapticd.cli import main
from hapticd.config.loading import parse
from hapticd.device import DeviceInfo
from hapticd.errors import ConfigError, HapticdError
from hapticd.faults.export import write_csv
from hapticd.faults.record import MAGIC, encode, read, read_header, receipt, summarise
from hapticd.faults.store import FaultStore
from hapticd.loop.memory import RECORDS, SharedMemory
from hapticd.paths import fault_directories, fault_directory
from hapticd.supervisor.fault_recorder import FaultRecorder
from hapticd.tick.event import EventCode, LoopEvent
from hapticd.tick.flags import Flag
from hapticd.tick.record import RecordLayout
from hapticd.trace import DriverTrace
from tests.daemon.running import wait_until
from tests.daemon.test_flood import descriptors

RATE_HZ = 1000.0
LAYOUT = RecordLayout(2, True, 8)
OUT = int(Flag.RELEASING | Flag.LATCHED)
EVENT = LoopEvent(EventCode.OVER_SPEED, "3 m/s is above the limit", 20, 20_000_000, {"speed": 3.0})


def row(seq: int, force_n: float, walls: int = 1, flags: int = Flag.ARMED) -> bytes:
    head = (seq, seq * 1_000_000, 5.0, 60.0, 1e-3, 0, flags, 0, 3, 0.02, 0.1, 0.2, 0.3, 0.4, walls)
    axes = (0.001 * seq, 0.0, 0.1, 0.0, force_n, 0.0, force_n, 0.0, *range(9))
    packed = LAYOUT.struct(walls).pack(*head, *axes, *((1, 12e3, 9.5, 0.25, 2, 0.1, 0.01, 9.0, 0.4) * walls))
    return packed.ljust(LAYOUT.size, b"\xff")  # what lies behind the last wall is anything


def device() -> DeviceInfo:
    bounds = ((-1.0, 1.0), (-1.0, 1.0))
    return DeviceInfo("a device", "7", ("x", "y"), float("inf"), 0.0, bounds, 1000.0, 10.0, None, simulated=True)


def header() -> dict[str, Any]:
    return receipt(EVENT, 1e9, "left", parse("[loop]\nrate_hz = 1000.0\n", "lab.toml"), device())


def content(after: Sequence[tuple[float, int]] = ((3.0, OUT), (1.0, OUT), (0.0, 0), (0.0, 0))) -> bytes:
    """A record of 20 ticks with a force, and these forces and flags from the fault on."""
    ticks = [(2.0, int(Flag.ARMED))] * 20 + list(after)
    rows = b"".join(row(seq, force_n, flags=flags) for seq, (force_n, flags) in enumerate(ticks))
    return encode(header(), LAYOUT, iter([rows]))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return FaultStore(tmp_path).write(1e9, 202, content(), keep=5)


def test_a_record_says_what_happened_to_what_under_which_configuration(path: Path) -> None:
    said = read_header(path)
    assert (said["event"]["code"], said["event"]["name"], said["event"]["fields"]) == (
        202,
        "OVER_SPEED",
        {"speed": 3.0},
    )
    assert said["config"]["text"] == "[loop]\nrate_hz = 1000.0\n"
    assert (said["device"]["max_force_n"], said["ticks"]["count"]) == (None, 24)
    for key in ("kernel", "version", "machine", "python", "law", "driver"):
        assert said[key]


def test_ticks_come_back_as_they_were(path: Path) -> None:
    record = read(path)
    assert record.ticks == [LAYOUT.unpack(row(tick.seq, tick.force_n[0], flags=tick.flags)) for tick in record.ticks]
    figures = summarise(record)
    assert (figures.ticks, figures.force_before_n, figures.peak_force_n, figures.ramp_ticks) == (24, 2.0, 3.0, 2)
    assert figures.before_s == pytest.approx(0.02)
    assert figures.after_s == pytest.approx(0.003)


@pytest.mark.parametrize(
    ("after", "gone"),
    [
        pytest.param([(3.0, OUT), (0.0, OUT), (0.0, OUT), (1.0, OUT), (0.0, 0)], 4, id="bounced out of the wall"),
        pytest.param([(3.0, OUT), (0.0, OUT)], None, id="out of the wall and still releasing"),
        pytest.param([(3.0, OUT), (1.0, OUT)], None, id="a force to the end"),
        pytest.param([(3.0, Flag.ARMED), (1.0, OUT), (0.0, 0), (2.0, Flag.ARMED)], 2, id="armed again"),
        pytest.param([(0.0, OUT), (0.0, 0)], 0, id="no force at all"),
    ],
)
def test_the_force_of_a_fault_is_gone_with_the_last_tick_that_has_one(
    tmp_path: Path, after: list[tuple[float, int]], gone: int | None
) -> None:
    file = tmp_path / "x.fault"
    file.write_bytes(content(after))
    assert summarise(read(file)).ramp_ticks == gone


def test_a_csv_has_every_field_of_every_tick_and_wall(tmp_path: Path) -> None:
    file = tmp_path / "x.fault"
    file.write_bytes(encode(header(), LAYOUT, iter([row(0, 1.0, walls=1), row(1, 1.0, walls=2)])))
    written = io.StringIO()
    write_csv(read(file), written)
    table = list(csv.DictReader(io.StringIO(written.getvalue())))
    assert [line["t_s"] for line in table] == ["-0.020000", "-0.019000"]
    assert (table[0]["force_n[0]"], table[0]["orientation[8]"], table[0]["buttons"]) == ("1.0", "8.0", "3")
    assert (table[0]["damping_n_s_per_m[1]"], table[1]["damping_n_s_per_m[1]"]) == ("", "9.5")
    assert len(table[0]) == 1 + 14 + 4 * 2 + 9 + 2 * 9


@pytest.mark.parametrize(
    "damaged",
    [
        b"",
        b"hello",
        MAGIC,
        MAGIC + b"{",
        MAGIC + b"{}\n",
        MAGIC + b"[]\n",
        MAGIC + b"[" * 100_000 + b"\n",
        content().replace(b'"timestamp"', b'"timestomp"'),
        content().replace(b'"axes": 2', b'"axes": 2000000000000'),
        content()[:-20],
        encode(header(), LAYOUT, iter([row(0, 1.0) + row(1, 1.0)[:9]])),
        content().replace(b"<qq", b"<qQ"),
        b"\xff" * 500,
    ],
)
def test_a_damaged_record_is_named_in_one_line(tmp_path: Path, damaged: bytes) -> None:
    file = tmp_path / "x.fault"
    file.write_bytes(damaged)
    with pytest.raises(HapticdError, match=r"x\.fault") as raised:
        read(file)
    assert "\n" not in str(raised.value)


def test_a_damaged_record_hides_no_other(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (path.parent / "20010101T000000.000Z-201.fault").write_bytes(MAGIC)
    with pytest.raises(SystemExit) as ended:
        main(["fault", "list", "--directory", str(path.parent)])
    said = capsys.readouterr()
    assert ended.value.code == 1
    assert "OVER_SPEED" in said.out
    assert said.err.startswith("hapticd: ")
    assert "20010101T000000.000Z-201.fault" in said.err


def test_the_oldest_record_makes_room_and_no_half_record_stays(tmp_path: Path) -> None:
    store = FaultStore(tmp_path / "state" / "faults")
    assert store.paths() == []
    for second in range(4):
        store.write(1e9 + second, 204, content(), keep=2)
    assert [path.stem for path in store.paths()] == ["20010909T014643.000Z-204", "20010909T014642.000Z-204"]
    (store.directory / "20010909T014640.000Z-204.part").touch()
    store.write(1e9 + 9, 204, content(), keep=2)
    assert {path.suffix for path in store.directory.iterdir()} == {".fault"}


def test_a_record_is_kept_though_the_clock_was_set_back(tmp_path: Path) -> None:
    """As on a computer without a battery for its clock, which starts in 1970 until the network has told the time."""
    store = FaultStore(tmp_path)
    for second in range(2):
        store.write(1e9 + second, 204, content(), keep=2)
    written = store.write(60.0, 204, content(), keep=2)
    assert [path.name for path in store.paths()] == ["20010909T014641.000Z-204.fault", written.name]


def extend(shared: SharedMemory, count: int, first_seq: int) -> None:
    """Let a loop that began with this tick write so many records more."""
    written = shared.words[RECORDS]
    for number in range(written, written + count):
        start = number % shared.slots * LAYOUT.size
        shared.record_area[start : start + LAYOUT.size] = row(first_seq + number, 1.0)
    shared.words[RECORDS] = written + count


@pytest.mark.parametrize(
    ("before", "first_seq", "seq", "after", "held"),
    [
        (7000, 0, 6990, 1500, range(1990, 7991)),  # all of it
        (300, 0, 290, 1500, range(1291)),  # the loop had just started
        (7000, 0, 6999, 0, range(1999, 7000)),  # it ended there
        (7000, 0, 7000, 0, range(2000, 7000)),  # it ended in that tick
        (100, 5000, 5090, 1500, range(5000, 6091)),  # it goes on for one before it
        (9000, 0, 1500, 0, range(1002, 2501)),  # the supervisor slept: what the ring still has
        (20000, 0, 1500, 0, range(0)),  # nothing of it
        (0, 0, 0, 0, range(0)),
    ],
)
def test_a_record_holds_five_seconds_before_and_one_after_or_what_there_is(
    tmp_path: Path, before: int, first_seq: int, seq: int, after: int, held: range
) -> None:
    shared = SharedMemory(LAYOUT, RATE_HZ)
    extend(shared, before, first_seq)
    recorder = FaultRecorder(tmp_path)
    recorder.begin(LoopEvent(EventCode.OVER_SPEED, "too fast", seq, 0), 1e9, shared, RATE_HZ, header())
    extend(shared, after, first_seq)
    shared.close()
    assert recorder.close(5, 10.0) == ""
    (path,) = FaultStore(tmp_path).paths()
    assert [tick.seq for tick in read(path).ticks] == list(held)
    assert recorder.written == 1


def test_a_record_holds_what_driver_and_device_said_before_the_fault_and_not_what_came_after(tmp_path: Path) -> None:
    shared = SharedMemory(LAYOUT, RATE_HZ)
    extend(shared, 100, 0)
    trace = DriverTrace(3)
    trace.share(shared.trace)
    for said in ("> 01", "< 02", "> 03", "it is hot"):
        trace.keep(said)
    recorder = FaultRecorder(tmp_path)
    recorder.begin(LoopEvent(EventCode.DEVICE_FAULT, "it is hot", 99, 0), 1e9, shared, RATE_HZ, header())
    for _ in range(3):
        trace.keep("closed")
    shared.close()
    assert recorder.close(5, 10.0) == ""
    (path,) = FaultStore(tmp_path).paths()
    assert [line.split(" ", 1)[1] for line in read(path).trace] == ["< 02", "> 03", "it is hot"]


def test_a_record_waits_for_the_ticks_after_the_fault(tmp_path: Path) -> None:
    shared = SharedMemory(LAYOUT, RATE_HZ)
    extend(shared, 100, 0)
    recorder = FaultRecorder(tmp_path)
    recorder.begin(LoopEvent(EventCode.OVER_SPEED, "too fast", 50, 0), 1e9, shared, RATE_HZ, header())
    assert recorder.turn(5) == ""
    assert list(tmp_path.iterdir()) == []
    extend(shared, 950, 0)
    recorder.turn(5)
    wait_until(lambda: recorder.turn(5) == "" and recorder.written, "the record")
    shared.close()


def test_a_fault_for_which_there_is_no_room_beside_those_that_wait_is_told(tmp_path: Path) -> None:
    """The fifth in a second had no record, and nothing said so."""
    shared = SharedMemory(LAYOUT, RATE_HZ)
    extend(shared, 100, 0)
    recorder = FaultRecorder(tmp_path)
    told = []
    for at in range(6):
        recorder.begin(LoopEvent(EventCode.OVER_SPEED, "too fast", 50 + at, 0), 1e9 + at, shared, RATE_HZ, header())
        told.append(recorder.turn(9))
    shared.close()
    assert told == [*4 * [""], *2 * ["fault record not written: 4 others are still to be written"]]
    assert recorder.close(9, 10.0) == ""
    assert recorder.written == 4


def test_a_record_that_cannot_be_written_is_a_line_that_says_why(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("a file is in the way")
    shared = SharedMemory(LAYOUT, RATE_HZ)
    extend(shared, 100, 0)
    recorder = FaultRecorder(tmp_path / "state" / "faults")
    recorder.begin(EVENT, 1e9, shared, RATE_HZ, header())
    shared.close()
    problem = recorder.close(5, 10.0)
    assert str(tmp_path / "state") in problem
    assert problem.endswith("; `hapticd doctor` says what is wrong with the directory")
    assert "\n" not in problem
    assert recorder.written == 0


@pytest.mark.parametrize(
    ("number", "remedy"), [(errno.EACCES, "let the daemon's user write there"), (errno.ENOSPC, "make room there")]
)
def test_a_record_that_cannot_be_written_says_what_to_do(
    number: int, remedy: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", refuse)
    recorder = FaultRecorder(tmp_path)
    with closing(SharedMemory(LAYOUT, RATE_HZ)) as shared:
        recorder.begin(EVENT, 1e9, shared, RATE_HZ, header())
        assert recorder.close(5, 10.0).startswith(
            f"fault record not written: {tmp_path}: {os.strerror(number)}; {remedy}"
        )


@pytest.mark.parametrize(("umask", "mode"), [(0o000, 0o640), (0o022, 0o640), (0o077, 0o600)])
def test_under_any_umask_a_record_is_for_its_owner_and_its_group_to_read(umask: int, mode: int, tmp_path: Path) -> None:
    before = os.umask(umask)
    try:
        written = FaultStore(tmp_path / "faults").write(1e9, 203, b"record", 5)
    finally:
        os.umask(before)
    assert stat.S_IMODE(written.stat().st_mode) == mode


def test_a_record_for_which_there_is_no_descriptor_left_does_not_end_the_daemon(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = FaultRecorder(tmp_path)

    def refuse(_: int) -> int:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    with closing(SharedMemory(LAYOUT, RATE_HZ)) as shared:
        monkeypatch.setattr(os, "dup", refuse)
        recorder.begin(EVENT, 1e9, shared, RATE_HZ, header())
    assert "Too many open files; raise the limit of open files (ulimit -n" in recorder.turn(keep=2)
    assert recorder.turn(keep=2) == ""


def test_a_record_for_which_no_thread_can_be_started_is_told_and_the_next_one_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It ended the daemon."""
    recorder = FaultRecorder(tmp_path)

    def refuse(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    with closing(SharedMemory(LAYOUT, RATE_HZ)) as shared:
        extend(shared, 100, 0)
        held = descriptors(os.getpid())
        with monkeypatch.context() as full:
            full.setattr(threading.Thread, "start", refuse)
            recorder.begin(EVENT, 1e9, shared, RATE_HZ, header())
            assert recorder.close(5, 10.0).startswith("fault record not written: no thread can be started; free memory")
        assert descriptors(os.getpid()) == held
        recorder.begin(EVENT, 1e9, shared, RATE_HZ, header())
        assert recorder.close(5, 10.0) == ""
    assert recorder.written == 1


def test_the_command_lists_shows_and_exports(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TZ", "EST5EDT")
    time.tzset()

    def hapticd(*arguments: str) -> str:
        with pytest.raises(SystemExit) as ended:
            main(["fault", *arguments, "--directory", str(path.parent)])
        assert ended.value.code == 0
        return capsys.readouterr().out

    assert hapticd("list") == f"{path.stem}  202 OVER_SPEED  3 m/s is above the limit\n"
    (listed,) = json.loads(hapticd("list", "--json"))
    assert (listed["name"], listed["event"]["code"]) == (path.stem, 202)
    shown = hapticd("show", "014640.000Z-202")
    assert "202 OVER_SPEED: 3 m/s is above the limit" in shown
    assert "2 N before, at most 3 N after, gone after 2 ticks" in shown
    assert "2001-09-08 21:46:40 -0400, tick " in shown, "its name has the time in UTC"
    assert "position [mm]" in shown
    assert json.loads(hapticd("show", "--json"))["summary"]["ramp_ticks"] == 2
    assert len(hapticd("export").splitlines()) == 25
    output = tmp_path / "out.csv"
    assert hapticd("export", path.stem, "--output", str(output)) == f"{output}: 24 rows of {path.stem}\n"
    assert len(output.read_text().splitlines()) == 25
    output.write_text("mine")
    with pytest.raises(SystemExit) as ended:
        main(["fault", "export", "--output", str(output), "--directory", str(path.parent)])
    said = f"hapticd: {output}: exists; add --overwrite to replace it\n"
    assert (ended.value.code, capsys.readouterr().err, output.read_text()) == (2, said, "mine")
    hapticd("export", "--output", str(output), "--overwrite")
    assert len(output.read_text().splitlines()) == 25
    monkeypatch.undo()
    time.tzset()


def test_a_name_that_fits_no_record_or_several_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (["show"], ["show", "nothing"]):
        with pytest.raises(SystemExit) as ended:
            main(["fault", *arguments, "--directory", str(tmp_path)])
        assert ended.value.code == 1
        assert str(tmp_path) in capsys.readouterr().err
    for second in range(2):
        FaultStore(tmp_path).write(1e9 + second, 202, content(), keep=5)
    with pytest.raises(SystemExit) as ended:
        main(["fault", "show", "2001", "--directory", str(tmp_path)])
    assert ended.value.code == 1
    assert "any of 20010909T014641.000Z-202, 20010909T014640.000Z-202" in capsys.readouterr().err


def test_a_service_keeps_its_records_where_systemd_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("HAPTICD_STATE_DIR", "STATE_DIRECTORY", "XDG_STATE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    monkeypatch.setenv("HOME", "/home/lab")
    assert fault_directory("left") == Path("/home/lab/.local/state/hapticd/left/faults")
    monkeypatch.setenv("XDG_STATE_HOME", "/elsewhere")
    assert fault_directories("left") == [
        Path("/var/lib/hapticd/left/faults"),
        Path("/elsewhere/hapticd/left/faults"),
    ]
    monkeypatch.setattr("os.geteuid", lambda: 0)
    assert fault_directory("left") == Path("/var/lib/hapticd/left/faults")
    monkeypatch.setenv("STATE_DIRECTORY", "/var/lib/hapticd/left")
    assert fault_directory("left") == Path("/var/lib/hapticd/left/faults")
    monkeypatch.setenv("HAPTICD_STATE_DIR", str(tmp_path))
    assert fault_directories("left") == [tmp_path / "left" / "faults"]
    with pytest.raises(ConfigError, match=r"instance = '\.\./left'"):
        fault_directories("../left")
