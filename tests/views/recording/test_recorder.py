"""`hapticd record` beside a real daemon: stopped, killed, rotated, on a full disk, through a restart of the daemon."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

import hapticd
from hapticd.client import Client, Position
from hapticd.errors import WireError
from hapticd_views.recording import read
from hapticd_views.recording.recorder import CHUNK_S, Limits, Recorder
from hapticd_views.recording.scan import Scan
from tests.daemon.running import HAPTICD, Daemon
from tests.views.recording.made import ANSWER, STATUS, Recording, await_true, files_up_to, tick

CONFIG = """
# a comment is part of the configuration
[device]
driver = "loopback"
[device.options]
model = "omega7"
initial_position_m = 0.001
[device.options.hand]
force = { profile = "constant", newton = -3.0 }
[[scene.walls]]
axis = "z"
free_side = "positive"
stiffness_n_per_m = 12000.0
[controller]
law = "none"
"""


@pytest.fixture(scope="module")
def daemon() -> Iterator[Daemon]:
    with Daemon(CONFIG) as running:
        yield running.wait_ready()


@pytest.fixture(scope="module")
def runtime(daemon: Daemon) -> dict[str, str]:
    return {"HAPTICD_RUNTIME_DIR": str(daemon.directory / "run")}


def test_a_topic_that_there_is_not_is_a_misuse_and_leaves_no_file(tmp_path: Path) -> None:
    done = subprocess.run(
        [HAPTICD, "record", "--topics", "position,foo"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("hapticd: Invalid value for '--topics': 'foo' is not one of position, energy, ")
    assert not list(tmp_path.iterdir())


def test_every_tick_marker_and_the_receipt_are_in_it(
    daemon: Daemon, runtime: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Recording(tmp_path / "a.mcap", "--json", environment=runtime) as recording:
        recording.has(20_000)
        with Client(daemon.endpoint, topics=[Position]) as witness:
            seen = [one for _ in range(10) for one in witness.receive(30.0) if isinstance(one, Position)]
        monkeypatch.setenv("HAPTICD_RUNTIME_DIR", runtime["HAPTICD_RUNTIME_DIR"])
        with hapticd.connect() as client:
            client.mark("now")
        await_true(lambda: "now" in [marker.text for marker in read(recording.output).markers], "the marker")
        code, output, errors = recording.end(signal.SIGTERM)
    assert (code, errors) == (0, "")
    told = json.loads(output)
    made = read(tmp_path / "a.mcap")
    assert made.complete
    assert (told["ticks"], told["missing"]) == (len(made.topics["position"]["seq"]), made.missing)
    rows = {seq: row for row, seq in enumerate(made.ticks["seq"].tolist())}
    assert len(seen) > 50
    for one in seen:
        row = rows[one.seq]
        assert tuple(made.ticks["position_m"][row]) == one.position_m
        assert tuple(made.ticks["force_requested_n"][row]) == one.force_requested_n
        assert made.ticks["timestamp"][row] == one.timestamp
    assert [marker.text for marker in made.markers] == ["now"]
    assert made.receipt["config_text"] == CONFIG
    assert made.config.hash == made.receipt["config_hash"]
    assert made.receipt["realtime"] is ("not real-time" not in daemon.output())
    assert made.receipt["kernel"].split()[1] == os.uname().release
    assert made.receipt["version"] == made.receipt["recorder_version"] == hapticd.__version__
    # Along the wall: in contact the force is the wall's own, k times the depth.
    wall = made.wall()
    inside = wall["in_contact"] & (np.abs(wall["force_n"]) > 0.0)
    assert inside.any()
    assert np.array_equal(wall["force_requested_n"][inside], -12000.0 * wall["x_m"][inside])


def saying(receive: Callable[[float], Any]) -> Any:
    """What the recorder asks of a daemon's client, with this in the place of what comes."""
    return SimpleNamespace(latest_status=STATUS, receive=receive, receipt=lambda: ANSWER)


@pytest.mark.parametrize("behind", [30, 120, 399, 700])
def test_a_topic_that_comes_behind_the_others_makes_no_chunk_longer(tmp_path: Path, behind: int) -> None:
    """As on a busy computer, where all that has come of one topic is read before the next."""
    dice = random.Random(1)
    ticks = [tick(seq, dice) for seq in range(1200)]
    waiting = [[*one[1:], *other[:1]] for one, other in zip(ticks[behind:], ticks, strict=False)]
    made = tmp_path / "a.mcap"
    Recorder(saying(lambda _: waiting.pop(0) if waiting else []), made, Limits()).run(lambda: True)
    chunks = spans_s(made)
    assert len(chunks) > 1
    assert max(chunks) <= CHUNK_S


def spans_s(path: Path) -> list[float]:
    """The time of the ticks in each chunk of a recording, to the microsecond that times of today resolve."""
    spans = []
    for piece in Scan(path).pieces():
        times = [record.log_time for record in piece if hasattr(record, "log_time")] if isinstance(piece, list) else []
        spans += [round((max(times) - min(times)) * 1e-9, 6)] if times else []
    return spans


def test_what_came_before_the_end_is_in_it_though_it_was_not_read_yet(tmp_path: Path) -> None:
    """A computer that was busy for seconds: those were not in the file, and nothing said so."""
    dice = random.Random(1)
    waiting: list[Any] = [tick(seq, dice) for seq in range(300)]
    waiting.insert(100, WireError("no record"))

    def receive(_timeout_s: float) -> Any:
        come = waiting.pop(0) if waiting else []
        if isinstance(come, WireError):
            raise come
        return come

    done = Recorder(saying(receive), tmp_path / "a.mcap", Limits()).run(lambda: True)
    assert (done.ticks, done.refused) == (300, 1)
    assert read(tmp_path / "a.mcap").ticks["seq"].tolist() == list(range(300))


def test_a_kill_costs_half_a_second_at_most(daemon: Daemon, runtime: dict[str, str], tmp_path: Path) -> None:
    with (
        Client(daemon.endpoint, topics=[Position]) as witness,
        Recording(tmp_path / "killed.mcap", environment=runtime) as recording,
    ):
        recording.has(150_000)

        def keeps_up() -> bool:
            """A busy computer may not let it; then what it has not read is not lost by a kill."""
            while more := witness.receive(0.0):
                heard_s.extend(one.timestamp for one in more if isinstance(one, Position))
            return bool(read(recording.output).ticks["timestamp"][-1] > heard_s[-1] - 0.5)

        heard_s = [witness.wait_for(Position, timeout_s=30.0).timestamp]
        await_true(keeps_up, "the recorder to be no more than half a second behind")
        recording.process.kill()
        recording.process.wait()
    made = read(tmp_path / "killed.mcap")
    assert not made.complete
    for name in ("position", "energy", "damping", "timing"):
        assert set(np.diff(made.topics[name]["seq"]).tolist()) == {1} or made.gaps
    assert max(spans_s(tmp_path / "killed.mcap")) <= CHUNK_S
    done = hapticd_record("show", tmp_path / "killed.mcap")
    assert "the file ends early" in done.stdout
    assert hapticd_record("repair", tmp_path / "killed.mcap", "--output", tmp_path / "whole.mcap").returncode == 0
    assert read(tmp_path / "whole.mcap").complete
    with (tmp_path / "whole.mcap").open("rb") as file:
        assert sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages(topics="hapticd/position")) == len(
            made.topics["position"]["seq"]
        )


def test_files_follow_each_other_without_a_lost_tick(runtime: dict[str, str], tmp_path: Path) -> None:
    """What is overwritten had more of them, which were read as if they were of this recording."""
    for number in range(1, 30):
        (tmp_path / f"long-{number:03d}.mcap").write_text("of the recording before")
    other = tmp_path / "long-2024.mcap"
    other.write_text("of another one")
    arguments = ("--max-size", "0.1", "--topics", "position,timing", "--duration", "3", "--overwrite")
    with Recording(tmp_path / "long.mcap", *arguments, environment=runtime) as recording:
        code, output, _ = recording.ended()
    assert code == 0
    assert other.read_text() == "of another one"
    files = sorted(file for file in tmp_path.iterdir() if file != other)
    assert [file.name for file in files[:2]] == ["long-001.mcap", "long-002.mcap"]
    assert f"long-001.mcap to {files[-1].name}: " in output
    made = [read(file) for file in files]
    assert all(one.complete and one.receipt["config_text"] == CONFIG for one in made)
    assert all(set(one.topics) <= {"position", "timing", "status", "event"} for one in made)
    ticks = [seq for one in made for seq in one.ticks["seq"].tolist()]
    missing = sum(one.missing for one in made)
    assert ticks[-1] - ticks[0] + 1 == len(ticks) + missing


def test_a_full_disk_is_one_line_and_a_readable_file(runtime: dict[str, str], tmp_path: Path) -> None:
    with Recording(tmp_path / "full.mcap", environment=runtime, prefix=files_up_to(120_000)) as recording:
        code, output, errors = recording.ended()
    assert (code, output) == (1, "")
    assert errors.splitlines() == [
        f"hapticd: {tmp_path}/full.mcap: File too large: the recording ends here and is readable; make room, or name "
        "another --output"
    ]
    made = read(tmp_path / "full.mcap")
    assert made.complete
    assert len(made.ticks["seq"]) > 100


@pytest.mark.parametrize("batch_ticks", [1, 20])
def test_recording_goes_on_through_a_restart_of_the_daemon(batch_ticks: int, tmp_path: Path) -> None:
    """Ticks of the second one that came before its status were read as ticks of the first one."""
    config = f"{CONFIG}[telemetry]\nbatch_ticks = {batch_ticks}\n"
    with Daemon(config) as first:
        first.wait_ready()
        place = {"HAPTICD_RUNTIME_DIR": str(first.directory / "run")}
        with Recording(tmp_path / "two.mcap", environment=place) as recording:
            recording.has(100_000)
            first.process.send_signal(signal.SIGTERM)
            first.process.wait()
            first.config.write_text(config.replace("12000.0", "11000.0"))
            environment = {**os.environ, **place, "HAPTICD_STATE_DIR": str(first.directory / "state")}
            second = subprocess.Popen(
                [HAPTICD, "run", "--config", str(first.config)], env=environment, stderr=subprocess.DEVNULL
            )
            try:
                with Client(first.endpoint, topics=[Position], timeout_s=60.0) as witness:
                    witness.wait_for(Position, lambda one: one.seq > 1000, timeout_s=60.0)
                code, output, _ = recording.end()
            finally:
                second.terminate()
                second.wait()
    assert code == 0
    assert "the daemon was started anew 1 times" in output
    made = read(tmp_path / "two.mcap")
    assert [note.restart for note in made.notes] == [True, False]
    assert [one["wall_stiffness_n_per_m"] for one in made.receipts] == [[12000.0], [11000.0]]
    assert {int(run) for run in made.ticks["run"]} == {0, 1}
    assert 105 in [event.code for event in made.events], "it was told of the end of the first one"
    for run in (0, 1):
        assert set(np.diff(made.ticks["seq"][made.ticks["run"] == run]).tolist()) == {1} or made.missing
    assert (np.diff(made.ticks["timestamp"]) > 0.0).all()
    assert made.in_force.tolist() == made.ticks["run"].tolist()
    lost = len(made.topics["position"]["seq"]) - len(made.ticks["seq"])
    assert lost <= 2 * batch_ticks, "the last batch of each may not have come in all topics"


def test_it_needs_a_daemon_and_a_place(runtime: dict[str, str], tmp_path: Path) -> None:
    with Recording(tmp_path / "a.mcap", environment={"HAPTICD_RUNTIME_DIR": str(tmp_path)}) as recording:
        code, _, errors = recording.ended()
    assert code == 1
    assert "no daemon answers; start it with `hapticd run`" in errors
    assert len(errors.splitlines()) == 1
    with Recording(tmp_path / "no" / "a.mcap", environment=runtime) as recording:
        code, _, errors = recording.ended()
    assert (code, errors) == (2, f"hapticd: {tmp_path}/no/a.mcap: there is no directory {tmp_path}/no\n")


def hapticd_record(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([HAPTICD, "record", *arguments], capture_output=True, text=True, check=False)
