"""A recording has one writer, stays where it is, and is named for what it is."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from typer.testing import CliRunner

from hapticd.errors import ConfigError
from hapticd_views.commands.record import app
from hapticd_views.recording import read
from hapticd_views.recording.file import DiskError, RecordingFile
from hapticd_views.recording.receipt import METADATA, as_texts, make_receipt
from hapticd_views.recording.recorder import Limits, Recorder
from hapticd_views.recording.repair import repair
from hapticd_views.recording.summary import lines
from tests.views.recording.made import ANSWER, STATUS, make


def begun(path: Path) -> RecordingFile:
    """A recording that is being made."""
    file = RecordingFile(path)
    file.describe(METADATA, as_texts(make_receipt(STATUS, ANSWER)))
    file.add(STATUS, STATUS.timestamp)
    file.commit()
    return file


def test_a_file_that_is_being_recorded_is_not_overwritten(tmp_path: Path) -> None:
    """Two recorders wrote into one file, and the first said at its end that no tick was missing."""
    path = tmp_path / "press.mcap"
    make(tmp_path / "other.mcap", 90, 40)
    first = begun(path)
    before = path.read_bytes()
    with pytest.raises(ConfigError, match=r"press\.mcap: is being recorded; end that recording first"):
        RecordingFile(path, overwrite=True)
    with pytest.raises(ConfigError, match="is being recorded"):
        repair(tmp_path / "other.mcap", path, overwrite=True)
    assert path.read_bytes() == before
    first.close()
    assert read(path).complete
    RecordingFile(path, overwrite=True).close()
    assert path.read_bytes() != before


def test_nor_is_one_of_several(tmp_path: Path) -> None:
    """The third file of a recording was removed under the recorder that was writing it."""
    (tmp_path / "long-001.mcap").write_text("of it")
    third = begun(tmp_path / "long-003.mcap")
    daemon: Any = SimpleNamespace(latest_status=STATUS, receive=lambda _wait_s: [], receipt=lambda: ANSWER)
    with pytest.raises(ConfigError, match=r"long-003\.mcap: is being recorded"):
        Recorder(daemon, tmp_path / "long.mcap", Limits(duration_s=60.0), overwrite=True).run(lambda: True)
    assert (tmp_path / "long-001.mcap").read_text() == "of it"
    third.close()
    assert read(tmp_path / "long-003.mcap").complete


def test_a_recording_that_was_removed_is_not_said_to_be_there(tmp_path: Path) -> None:
    path = tmp_path / "press.mcap"
    file = begun(path)
    file.sync()
    path.unlink()
    with pytest.raises(DiskError, match=r"press\.mcap: was removed while it was recorded"):
        file.close()
    moved = begun(path)
    path.rename(tmp_path / "moved.mcap")
    moved.close()
    assert read(tmp_path / "moved.mcap").complete


@pytest.mark.parametrize("command", [["-o", "run.csv"], ["repair", "cut.mcap", "-o", "run"]])
def test_its_name_says_what_it_is(command: list[str]) -> None:
    """`hapticd record -o run.csv` made a file that no CSV reader reads, and no command of ours."""
    done = CliRunner().invoke(app, command)
    assert isinstance(done.exception, ConfigError)
    assert f"{command[-1]}: must end in .mcap; `hapticd record export` makes .csv" in str(done.exception)


def test_its_times_say_that_they_are_utc(tmp_path: Path) -> None:
    """`hapticd fault show` has the times of where its user is."""
    make(tmp_path / "press.mcap", 90, 40)
    told = lines(read(tmp_path / "press.mcap"))
    assert any(line.startswith("began ") and " UTC, instance" in line for line in told)
    assert any(line.endswith(" UTC recorder: seen") for line in told)
