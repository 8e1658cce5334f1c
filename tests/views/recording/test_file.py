"""A recording is an MCAP file that other programs read, and one that was cut anywhere is read up to the cut."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

from hapticd.errors import ConfigError, HapticdError
from hapticd.paths import directory
from hapticd.telemetry.records import Sent
from hapticd.telemetry.wire import Topic
from hapticd_views.recording import Recording, read
from hapticd_views.recording.file import DiskError, RecordingFile
from hapticd_views.recording.messages import TELEMETRY, RecordedGap, schema_of
from hapticd_views.recording.receipt import METADATA, as_texts, make_receipt
from hapticd_views.recording.repair import repair
from hapticd_views.replay.stretch import Stretch
from tests.examples import examples
from tests.views.recording.made import ANSWER, STATUS, files_up_to, make

TICKS, CHUNK_TICKS = 300, 40


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[list[Sent]]]:
    path = tmp_path_factory.mktemp("made") / "whole.mcap"
    return path, make(path, TICKS, CHUNK_TICKS)


def boundaries(path: Path) -> list[int]:
    """Where chunks end."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return [index.chunk_start_offset + index.chunk_length for index in summary.chunk_indexes]


def test_the_official_reader_reads_it_and_every_message_keeps_to_its_schema(
    whole: tuple[Path, list[list[Sent]]],
) -> None:
    path, written = whole
    with path.open("rb") as file:
        list(StreamReader(file, validate_crcs=True).records)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.metadata_count == 1
        topics = {channel.topic for channel in summary.channels.values()}
        assert {f"hapticd/{name}" for name in ("position", "energy", "damping", "timing", "status")} <= topics
        messages = list(reader.iter_messages())
    assert len(messages) == 4 * len(written) + 5
    validators = {}
    for schema, channel, message in messages:
        assert schema is not None
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        if schema.id not in validators:
            told = json.loads(schema.data)
            jsonschema.Draft202012Validator.check_schema(told)
            validators[schema.id] = jsonschema.Draft202012Validator(told)
        validators[schema.id].validate(json.loads(message.data))
    positions = [message for _, channel, message in messages if channel.topic == "hapticd/position"]
    assert [message.log_time for message in positions[:2]] == [1_700_000_000_000_000_000, 1_700_000_000_000_999_936]


def test_every_topic_is_recorded() -> None:
    assert {record.topic for record in TELEMETRY} == set(Topic)


@pytest.mark.parametrize("record", TELEMETRY)
def test_a_schema_says_what_every_key_is(record: type[Sent]) -> None:
    told = schema_of(record)
    assert told["type"] == "object", "Lichtblick takes no other"
    assert all("description" in one for one in told["properties"].values()), told["properties"]


def test_what_was_written_is_read(whole: tuple[Path, list[list[Sent]]]) -> None:
    path, written = whole
    recording = read(path)
    assert (recording.complete, recording.cut) == (True, "")
    assert recording.receipt["config_text"] == "[loop]\nrate_hz = 1000.0\n"
    assert recording.receipt["axes"] == ["z", "x"]
    assert recording.receipt["warnings"] == ["a line"]
    for at, name in enumerate(("position", "energy", "damping", "timing")):
        table = recording.topics[name]
        for key in written[0][at].__slots__:
            if key in table:
                rows = [getattr(records[at], key) for records in written]
                assert table[key].tolist() == [list(row) if isinstance(row, tuple) else row for row in rows], key
    assert "invalid" not in recording.topics["position"]
    assert recording.topics["energy"]["invalid"].nonzero()[0].tolist() == [7]
    (marker,) = recording.markers
    assert (marker.text, marker.fields) == ('said "so" – µ', {"axis": "z", "depth_m": 0.1})
    assert recording.cycles[0].duration_s == 0.4
    assert (recording.gaps[0].missing, recording.notes[0].text) == (1, "seen")
    assert recording.ticks["seq"].tolist() == list(range(TICKS))


@examples(60)
@given(st.data())
def test_a_file_cut_at_any_byte_is_read_up_to_its_last_whole_chunk(
    whole: tuple[Path, list[list[Sent]]], data: st.DataObject
) -> None:
    path, _ = whole
    ends = boundaries(path)
    near = st.sampled_from(ends).flatmap(lambda end: st.integers(end - 12, end + 12))
    at = data.draw(st.one_of(st.integers(0, path.stat().st_size - 1), near, st.integers(0, ends[0])))
    cut = path.with_name("cut.mcap")
    cut.write_bytes(path.read_bytes()[:at])
    kept = sum(end <= at for end in ends)
    if kept == 0 and refusal(cut):
        return
    recording = read(cut)
    ticks = recording.ticks.get("seq", [])
    assert len(ticks) == min(kept * CHUNK_TICKS, TICKS)
    # Its end is in the data section: a cut behind that only loses the index.
    assert recording.complete == (at >= ends[-1] and not recording.cut)
    assert "last 0 bytes" not in recording.cut, "where a kill between two records cuts"
    mended = path.with_name("mended.mcap")
    count, why = repair(cut, mended, overwrite=True)
    assert why == recording.cut
    with mended.open("rb") as file:
        assert len(list(make_reader(file, validate_crcs=True).iter_messages())) == count
    again = read(mended)
    assert again.complete
    assert again.receipts == recording.receipts
    assert len(again.ticks.get("seq", [])) == len(ticks)


@examples(60)
@given(at=st.integers(0, 10**9), change=st.integers(1, 255))
def test_a_wrong_bit_anywhere_gives_an_error_or_what_is_before_it(
    whole: tuple[Path, list[list[Sent]]], at: int, change: int
) -> None:
    path, written = whole
    damaged = bytearray(path.read_bytes())
    damaged[at % len(damaged)] ^= change
    place = path.with_name("damaged.mcap")
    place.write_bytes(damaged)
    error = refusal(place)
    if error:
        assert error.startswith(str(place))
        return
    found = read(place).topics.get("position", {"seq": [], "position_m": []})
    for seq, position_m in zip(found["seq"], found["position_m"], strict=True):
        assert tuple(position_m) == written[int(seq)][0].position_m  # type: ignore[union-attr]  # a tick is a pair whose first is the position


@pytest.mark.parametrize("junk", [b"", b"\x89MCAP0\r", b"\x89MCAP0\r\n", b"no recording" * 100, bytes(5000)])
def test_what_is_no_recording_is_refused_in_one_line(tmp_path: Path, junk: bytes) -> None:
    (tmp_path / "junk.mcap").write_bytes(junk)
    with pytest.raises(HapticdError, match=r"is no|has no receipt"):
        read(tmp_path / "junk.mcap")


def test_a_file_that_is_there_stays(tmp_path: Path) -> None:
    (tmp_path / "there.mcap").write_text("mine")
    with pytest.raises(ConfigError, match="add --overwrite"):
        RecordingFile(tmp_path / "there.mcap")
    make(tmp_path / "cut.mcap", 90, 40)
    with pytest.raises(ConfigError, match="add --overwrite"):
        repair(tmp_path / "cut.mcap", tmp_path / "there.mcap")
    assert (tmp_path / "there.mcap").read_text() == "mine"
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ConfigError, match="is a pipe"):
        RecordingFile(tmp_path / "pipe", overwrite=True)


FILL = """
import sys
from pathlib import Path
from typing import Any
from tests.views.recording.made import files_up_to, make
make(Path(sys.argv[1]), 3000, 40)
"""


@pytest.mark.parametrize("limit", [1, 5000, 60_000, 60_001, 61_111, 90_000])
def test_a_full_disk_ends_the_file_behind_its_last_whole_chunk(tmp_path: Path, limit: int) -> None:
    path = tmp_path / "full.mcap"
    done = subprocess.run(
        [*files_up_to(limit), sys.executable, "-c", FILL, str(path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert f"DiskError: {path}: File too large" in done.stderr
    check_full(path, limit)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may mount")
@pytest.mark.parametrize("kilobytes", [64, 200])
def test_a_full_file_system_ends_the_file_behind_its_last_whole_chunk(tmp_path: Path, kilobytes: int) -> None:
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "none", tmp_path], check=True)
    try:
        path = tmp_path / "full.mcap"
        with pytest.raises(DiskError, match="No space left"):
            make(path, 3000, 40)
        check_full(path, kilobytes * 1024)
    finally:
        subprocess.run(["umount", tmp_path], check=True)


def refusal(path: Path) -> str:
    """Why a file cannot be read; "" when it can."""
    try:
        read(path)
    except HapticdError as error:
        return str(error)
    return ""


def check_full(path: Path, limit: int) -> None:
    """The file ends properly, and has all chunks that had room but for the one that made room for the end."""
    if limit == 1:
        assert not path.exists(), "an empty file is no recording, and would be in the way of the next"
        return
    assert path.stat().st_size <= limit
    with path.open("rb") as file:
        count = len(list(StreamReader(file, validate_crcs=True).records))
    if limit == 5000:
        assert count == 3, "header, end, footer"
        return
    recording = read(path)
    assert recording.complete
    assert count >= 4 * len(recording.ticks["seq"])
    size_of_chunk = 20_000
    assert path.stat().st_size > limit - 2 * size_of_chunk
    assert len(recording.ticks["seq"]) % 40 == 0
    assert len(recording.ticks["seq"]) > 0


def test_what_its_configuration_names_beside_itself_is_looked_for_there_and_not_beside_the_recording(
    tmp_path: Path,
) -> None:
    text = (directory("config") / "mesh.toml").read_text()
    told = {**ANSWER, "config_text": text, "config_file": "/lab/mesh.toml"}
    file = RecordingFile(tmp_path / "press.mcap")
    file.describe(METADATA, as_texts(make_receipt(STATUS, told)))
    file.close()
    recording = read(tmp_path / "press.mcap")
    for config in (recording.config, Stretch({}, recording.receipt, 0.0, False).config):
        other = config.with_values({"controller.law": "tdpa"})  # as a replay has it
        assert [each.config.scene.objects[0].model_dump()["file"] for each in (config, other)] == 2 * [
            "/lab/ring.field"
        ]


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"law": None, "axes": None}, "its receipt does not say axes, law"),
        ({"wall_position_m": ["0"]}, "its receipt does not say wall_position_m"),
        ({"wall_axis": ["y"]}, "the walls in its receipt do not fit each other or the axes"),
        ({"wall_axis": ["z", "x"]}, "the walls in its receipt do not fit each other or the axes"),
    ],
)
def test_a_receipt_that_was_damaged_or_forged_is_refused_by_name(
    tmp_path: Path, changed: dict[str, Any], said: str
) -> None:
    """Plots and reports ended with a bare KeyError, said to be a defect of theirs."""
    receipt = {**make_receipt(STATUS, ANSWER), **changed}
    path = tmp_path / "forged.mcap"
    file = RecordingFile(path)
    file.describe(METADATA, as_texts({key: value for key, value in receipt.items() if value is not None}))
    file.close()
    with pytest.raises(HapticdError) as refused:
        read(path)
    what = "the file was damaged or changed after it was recorded: take its original"
    assert str(refused.value) == f"{path}: is no recording of hapticd: {said}; {what}"


class Looked(tuple[RecordedGap, ...]):
    """Gaps that count how often all of them are looked at."""

    times = 0

    def __iter__(self) -> Iterator[RecordedGap]:
        Looked.times += 1
        return super().__iter__()


def test_gaps_are_looked_at_once_a_topic_however_many_there_are() -> None:
    """Each was held against all others: of tens of thousands `hapticd record show` took minutes."""
    names = [f"hapticd/{name}" for name in ("position", "energy", "damping", "timing")]
    gaps = Looked(RecordedGap(0.0, name, 1, 3, 1 + (name == names[2])) for name in names * 25)
    assert Recording(Path("many.mcap"), (), {}, gaps, (), "").missing == 50
    assert Looked.times <= 1 + len(names)
