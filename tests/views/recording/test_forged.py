"""Recordings whose messages were changed, or come from no daemon of ours: a line that names the file."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hapticd.cli import main
from hapticd.errors import ConfigError, HapticdError
from hapticd.telemetry.records import Cycle, Damping, Energy, Event, Position, Sent
from hapticd_views.recording import read
from hapticd_views.recording.file import RecordingFile
from hapticd_views.recording.messages import schema_of
from hapticd_views.recording.receipt import METADATA, as_texts, make_receipt
from tests.views.recording.made import ANSWER, BEGAN_S, STATUS

WALL = '[[scene.walls]]\naxis = "z"\nstiffness_n_per_m = 1e3\n'
TWO_AXES = Position(BEGAN_S, 0, *4 * ((0.5, 0.25),))
ONE_WALL = Damping(BEGAN_S, 0, (1.0,), (True,), (0.1,))


def written(path: Path, *records: Any, walls: Sequence[int] = (1,), keys: str = "") -> Path:
    """A recording of these, each in ten ticks, with a receipt for every number of walls."""
    file = RecordingFile(path)
    for number in walls:
        status = dataclasses.replace(
            STATUS, wall_axis=("z",) * number, wall_position_m=(0.0,) * number, wall_stiffness_n_per_m=(1e3,) * number
        )
        answer = {**ANSWER, **status.as_map(), "config_text": WALL * number + keys}
        file.describe(METADATA, as_texts(make_receipt(status, answer)))
    for seq in range(10):
        for record in records:
            file.add(dataclasses.replace(record, seq=seq, timestamp=BEGAN_S + seq * 1e-3), BEGAN_S + seq * 1e-3)
    file.close()
    return path


def other(kind: type[Any], **types: str) -> type[Any]:
    """A kind of record under the same topic whose keys have other types, or are not there."""
    told = {field.name: types.get(field.name, field.type) for field in dataclasses.fields(kind)}
    fields = [(name, what) for name, what in told.items() if what]
    return dataclasses.make_dataclass(kind.__name__, fields, namespace={"topic": kind.topic})


NARROW = [
    (dataclasses.replace(TWO_AXES, position_m=(0.5,)), "position_m has 1 columns, and the receipt 2 axes"),
    (dataclasses.replace(TWO_AXES, force_n=()), "force_n has 0 columns, and the receipt 2 axes"),
    (dataclasses.replace(ONE_WALL, in_contact=()), "in_contact has 0 columns, and the receipt 1 walls"),
]


@pytest.mark.parametrize(("record", "said"), NARROW, ids=["position", "force", "walls"])
def test_columns_that_do_not_fit_axes_or_walls_are_a_line_that_names_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], record: Sent, said: str
) -> None:
    """Each of these was an IndexError, said to be a defect of ours. What was recorded can still be read."""
    both = [each if type(each) is not type(record) else record for each in (TWO_AXES, ONE_WALL)]
    path = written(tmp_path / "forged.mcap", *both)
    assert len(read(path).topics["position"]["seq"]) == 10
    for command in (["plot"], ["report"], ["record", "export"]):
        output = tmp_path / ("out.svg" if command == ["plot"] else "out.html" if command == ["report"] else "out.csv")
        with pytest.raises(SystemExit) as ended:
            main([*command, str(path), "--output", str(output)])
        assert ended.value.code == 1
        assert capsys.readouterr().err.startswith(f"hapticd: {path}: {said}: ")
        assert not output.exists()


@pytest.mark.parametrize(
    ("record", "said"),
    [
        (
            other(Position, position_m="float")(BEGAN_S, 0, 0.5, (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), False),
            "position_m is",
        ),
        (other(Position, force_n="")(BEGAN_S, 0, (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), False), "no message has force_n"),
        (other(Position, seq="bool")(BEGAN_S, True, *4 * ((0.5, 0.25),), False), "seq is"),
        (other(Damping, in_contact="tuple[float, ...]")(BEGAN_S, 0, (1.0,), (1.0,), (0.1,), False), "in_contact is"),
        (other(Cycle, contact="str")(BEGAN_S, 0, "0", 1, 0.0, 0.0, 0.0, 0.0, False), "contact is"),
        (other(Event, text="float", fields="")(BEGAN_S, 0, 100, 1.0), "text is"),
        (other(Event, code="", fields="")(BEGAN_S, 0, "armed"), "no message has code"),
    ],
)
def test_a_key_that_is_not_what_telemetry_has_under_its_name_is_refused_by_name(
    tmp_path: Path, record: Any, said: str
) -> None:
    path = tmp_path / "forged.mcap"
    file = RecordingFile(path)
    file.describe(METADATA, as_texts(make_receipt(STATUS, ANSWER)))
    file.add(record, BEGAN_S)
    file.close()
    topic = str(type(record).topic)
    with pytest.raises(HapticdError) as refused:
        read(path)
    assert str(refused.value).startswith(f"{path}: is no recording of hapticd: {topic}: {said}")


def test_a_topic_without_a_message_is_as_one_that_was_not_recorded(tmp_path: Path) -> None:
    file = RecordingFile(tmp_path / "announced.mcap")
    file.describe(METADATA, as_texts(make_receipt(STATUS, ANSWER)))
    schema = file._writer.register_schema("hapticd/energy", "jsonschema", json.dumps(schema_of(Energy)).encode())
    file._writer.register_channel("hapticd/energy", "json", schema)
    file.add(TWO_AXES, BEGAN_S)
    file.close()
    recording = read(file.path)
    assert recording.topics.keys() == {"position"}
    assert len(recording.ticks["seq"]) == 1


def test_a_wall_that_came_after_the_last_tick_is_there_and_unknown(tmp_path: Path) -> None:
    """The receipt of a reload is written before the ticks that come after it, and a recording may end there."""
    recording = read(written(tmp_path / "reloaded.mcap", TWO_AXES, ONE_WALL, walls=(1, 2)))
    assert np.isnan(recording.wall(1)["damping_n_s_per_m"]).all()
    assert not recording.wall(1)["in_contact"].any()
    assert (recording.wall(0)["damping_n_s_per_m"] == 1.0).all()


def test_a_recording_of_a_law_and_a_device_that_are_not_installed_here_is_drawn_all_the_same(tmp_path: Path) -> None:
    """Which side of a wall is free stands in its configuration, and that was read only where all of it could run."""
    elsewhere = '[controller]\nlaw = "lab.damper"\n[device]\ndriver = "lab.rig"\n[device.options]\nport = "/dev/rig"\n'
    path = written(tmp_path / "press.mcap", TWO_AXES, ONE_WALL, keys=elsewhere)
    recording = read(path)
    with pytest.raises(ConfigError, match=r"lab\.damper"):
        _ = recording.config
    assert recording.wall(0)["x_m"].tolist() == 10 * [0.5]
    for command, file in (("plot", "press.svg"), ("report", "press.html")):
        with pytest.raises(SystemExit) as ended:
            main([command, str(path), "--output", str(tmp_path / file)])
        assert ended.value.code == 0
        assert (tmp_path / file).stat().st_size > 1000
