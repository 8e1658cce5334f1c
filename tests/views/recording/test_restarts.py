"""Every tick of a recording is in the run of the daemon that it came from, told of its restart or not."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hapticd.client import Client
from hapticd.telemetry.records import Sent
from hapticd_views.recording import Recording, read
from hapticd_views.recording.recorder import Limits, Recorder
from hapticd_views.recording.recording import PER_TICK
from tests.daemon.running import PATIENCE_S
from tests.views.recording.made import BEGAN_S, STATUS, Publisher, tick

FIRST = STATUS
SECOND = replace(STATUS, timestamp=BEGAN_S + 2.2, started_timestamp=BEGAN_S + 2.0, config_hash="second")
THIRD = replace(STATUS, timestamp=BEGAN_S + 4.2, started_timestamp=BEGAN_S + 4.0, config_hash="third")
BEFORE = range(300)


def ticked(began_s: float, seqs: range) -> list[Sent]:
    """Ticks at 1 kHz of a daemon that was started `began_s` after the first one [s]."""
    dice = random.Random(1)
    return [replace(one, timestamp=BEGAN_S + began_s + seq * 1e-3) for seq in seqs for one in tick(seq, dice)]


def recorded(said: Sequence[Sent], folder: Path) -> Recording:
    """What a recorder makes of it, and a reader of that."""
    end = replace(next(one for one in reversed(said) if isinstance(one, type(STATUS))), seq=12345)
    with Publisher(folder) as publisher, Client(publisher.endpoint) as client:
        publisher.await_subscriber()
        publisher.say(*said, end)
        daemon: Any = SimpleNamespace(latest_status=None, receive=client.receive, receipt=dict)

        def ended() -> bool:
            return client.latest_status is not None and client.latest_status.seq == end.seq

        Recorder(daemon, folder / "a.mcap", Limits()).run(ended, PATIENCE_S)
        assert ended()
    return read(folder / "a.mcap")


def check(recording: Recording, runs: Sequence[range]) -> None:
    """These ticks are in these runs, in order of time, and none is in two."""
    for name in PER_TICK:
        table = recording.topics[name]
        for number, seqs in enumerate(runs):
            assert table["seq"][table["run"] == number].tolist() == list(seqs), (name, number)
        assert len(table["seq"]) == sum(len(seqs) for seqs in runs), name
        assert (np.diff(table["timestamp"]) > 0.0).all(), name
    assert recording.ticks["seq"].tolist() == [seq for seqs in runs for seq in seqs]


@pytest.mark.parametrize("early", [0, 1, 25])
@pytest.mark.parametrize("before", [300, 50])
def test_ticks_that_come_before_the_status_are_of_the_new_daemon(before: int, early: int, tmp_path: Path) -> None:
    """They were read as ticks of the old one, whether that had counted further than they do or not."""
    after = range(90, 150)
    said = [FIRST, *ticked(0.0, range(before)), *ticked(2.0, after[:early]), SECOND, *ticked(2.0, after[early:])]
    made = recorded(said, tmp_path)
    check(made, [range(before), after])
    assert [receipt["config_hash"] for receipt in made.receipts] == ["abc", "second"]
    assert made.in_force.tolist() == [0] * before + [1] * len(after)
    assert made.topics["status"]["run"].tolist() == [0, 1, 1]


def test_topics_may_begin_one_after_another(tmp_path: Path) -> None:
    """A new daemon publishes the topics that it has been asked for so far."""
    first, *others = ticked(2.0, range(90, 91))
    said = [FIRST, *ticked(0.0, BEFORE), *others, *ticked(2.0, range(91, 99)), SECOND, *ticked(2.0, range(99, 150))]
    made = recorded(said, tmp_path)
    assert first.topic == "hapticd/position"
    for name in PER_TICK:
        table = made.topics[name]
        assert table["seq"][table["run"] == 0].tolist() == list(BEFORE)
    assert made.topics["energy"]["seq"][len(BEFORE)] == 90
    assert made.ticks["seq"].tolist() == [*BEFORE, *range(91, 150)]


def test_a_daemon_that_ended_before_its_status_has_a_run_of_its_own(tmp_path: Path) -> None:
    second, third = range(20, 40), range(10, 60)
    said = [FIRST, *ticked(0.0, BEFORE), *ticked(2.0, second), *ticked(4.0, third[:9]), THIRD, *ticked(4.0, third[9:])]
    check(recorded(said, tmp_path), [BEFORE, second, third])


def test_each_restart_is_one(tmp_path: Path) -> None:
    second, third = range(5, 400), range(7, 90)
    said = [
        FIRST, *ticked(0.0, BEFORE), SECOND, *ticked(2.0, second), *ticked(4.0, third[:9]), THIRD,
        *ticked(4.0, third[9:]),
    ]  # fmt: skip
    check(recorded(said, tmp_path), [BEFORE, second, third])


def test_a_recording_that_ends_before_the_status_has_both_runs(tmp_path: Path) -> None:
    """As one whose recorder was killed then: ticks of the two daemons with the same number hid each other."""
    after = range(90, 115)
    check(recorded([FIRST, *ticked(0.0, BEFORE), *ticked(2.0, after)], tmp_path), [BEFORE, after])


@pytest.mark.parametrize("before", [1, 100])
def test_ticks_that_are_lost_are_no_restart(before: int, tmp_path: Path) -> None:
    made = recorded([FIRST, *ticked(0.0, range(before)), *ticked(0.0, range(400, 450))], tmp_path)
    assert set(made.ticks["run"].tolist()) == {0}
    assert made.missing == 400 - before


def test_a_device_that_was_away_is_no_restart(tmp_path: Path) -> None:
    """Ticks go on counting where they were, much later."""
    made = recorded([FIRST, *ticked(0.0, range(50)), *ticked(30.0, range(50, 90))], tmp_path)
    check(made, [range(90)])
