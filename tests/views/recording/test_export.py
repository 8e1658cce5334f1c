"""A recording as a table: what is read back has the same bits."""

from __future__ import annotations

import csv
import subprocess
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

from hapticd_views.recording import Recording, read
from hapticd_views.recording.export import export as export_table
from hapticd_views.recording.export import single_columns
from tests.daemon.running import HAPTICD
from tests.views.recording.made import make

OTHER_BYTES = b"\xff".decode(errors="surrogateescape")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    path = tmp_path_factory.mktemp("made") / "run.mcap"
    make(path)
    return read(path)


def export(recording: Recording, name: str, *arguments: str) -> Path:
    output = recording.path.with_name(name)
    done = subprocess.run(
        [HAPTICD, "record", "export", recording.path, "--output", output, *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return output


def same_bits(one: np.ndarray, other: np.ndarray) -> bool:
    return one.dtype == other.dtype and one.tobytes() == other.tobytes()


def test_csv_has_the_same_floats(recording: Recording) -> None:
    with export(recording, "ticks.csv").open(newline="") as file:
        header, *rows = list(csv.reader(file))
    columns = single_columns(recording.ticks)
    assert header == list(columns)
    assert "position_m[1]" in header
    for name, texts in zip(header, zip(*rows, strict=True), strict=True):
        kind = columns[name].dtype
        values = [text == "1" for text in texts] if kind == np.bool_ else [kind.type(text) for text in texts]
        assert kind != np.bool_ or set(texts) <= {"0", "1"}, "as `hapticd simulate` writes it"
        assert same_bits(np.array(values, kind), np.ascontiguousarray(columns[name])), name


def test_parquet_has_the_same_floats(recording: Recording) -> None:
    table = pyarrow.parquet.read_table(export(recording, "ticks.parquet"))
    columns = single_columns(recording.ticks)
    assert table.column_names == list(columns)
    for name, values in columns.items():
        assert same_bits(table[name].to_numpy(), np.ascontiguousarray(values)), name


def test_npz_has_the_same_floats(recording: Recording) -> None:
    with np.load(export(recording, "ticks.npz")) as found:
        assert set(found) == set(recording.ticks)
        for name, values in recording.ticks.items():
            assert found[name].shape == values.shape
            assert same_bits(found[name], values), name


@pytest.mark.parametrize("suffix", ["csv", "parquet", "npz"])
def test_a_topic_with_texts_is_exported_too(recording: Recording, suffix: str) -> None:
    output = export(recording, f"event.{suffix}", "--topic", "event")
    if suffix == "npz":
        with np.load(output) as found:
            assert found["text"].tolist() == ['said "so" – µ']
    elif suffix == "csv":
        with output.open(newline="") as file:
            assert next(csv.DictReader(file))["text"] == 'said "so" – µ'
    else:
        assert pyarrow.parquet.read_table(output)["text"].to_pylist() == ['said "so" – µ']


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--output", "a.txt"), "must end in .csv, .parquet, .npz"),
        (("--output", "a.csv", "--topic", "nothing"), "has no 'nothing'; there is ticks, position"),
        (("--output", "no/a.csv"), "there is no directory"),
    ],
)
def test_what_cannot_be_exported_is_said_in_one_line(
    recording: Recording, arguments: tuple[str, ...], words: str
) -> None:
    done = subprocess.run(
        [HAPTICD, "record", "export", recording.path, *arguments],
        cwd=recording.path.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert words in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_table_may_have_a_name_that_is_no_utf_8(recording: Recording, tmp_path: Path) -> None:
    for suffix in ("csv", "npz", "parquet"):
        output = tmp_path / f"{OTHER_BYTES}.{suffix}"
        assert export_table(recording, output) == len(recording.ticks["run"])
        assert output.stat().st_size
