"""docs/examples/driven: each program does to a daemon what its first line says."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from hapticd.client import Client, Event, EventCode, Status
from tests.daemon.running import PATIENCE_S, Daemon

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples" / "driven"


@pytest.fixture(scope="module")
def daemon() -> Iterator[Daemon]:
    with Daemon((EXAMPLES / "driven.toml").read_text()) as daemon:
        yield daemon.wait_ready()


def said(daemon: Daemon, name: str, duration_s: float) -> str:
    """What a program prints."""
    done = subprocess.run(
        [sys.executable, EXAMPLES / name, str(duration_s)],
        env={**os.environ, "HAPTICD_RUNTIME_DIR": str(daemon.directory / "run")},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_wall_that_is_moved_lifts_the_hand() -> None:
    with Daemon((EXAMPLES / "wall.toml").read_text()) as daemon:
        found = re.fullmatch(
            r"the wall lifted the hand with up to (\d+\.\d) N\n", said(daemon.wait_ready(), "moving_wall.py", 2.0)
        )
    assert found
    assert 0.5 < float(found[1]) < 6.0


def test_a_curl_field_pushes_across_the_motion(daemon: Daemon) -> None:
    found = re.fullmatch(r"pushed with (\S+) and (\S+) N at the end\n", said(daemon, "force_field.py", 1.0))
    assert found
    across_n = [float(found[1]), float(found[2])]
    assert 0.2 < (across_n[0] ** 2 + across_n[1] ** 2) ** 0.5 <= 4.0 + 1e-6


def test_an_experiment_learns_from_which_tick_each_stiffness_holds(daemon: Daemon) -> None:
    """A marker has the same tick, and a stiffer spring to the middle keeps the hand nearer to it."""
    with Client(daemon.endpoint, topics=[Event, Status], timeout_s=PATIENCE_S) as client:
        client.wait_for(Status, timeout_s=PATIENCE_S)  # it is heard
        printed = said(daemon, "trials.py", 1.0)
        marks = [client.wait_for(EventCode.MARKED, timeout_s=PATIENCE_S).text for _ in range(3)]
    trials = re.findall(r"(\d+) N/m from tick (\d+): up to (\d+\.\d) mm\n", printed)
    assert [int(stiffness) for stiffness, _, _ in trials] == [100, 400, 200]
    ticks = [int(tick) for _, tick, _ in trials]
    assert ticks[0] < ticks[1] < ticks[2]
    assert all(
        f"{stiffness} N/m from tick {tick}" in mark for (stiffness, tick, _), mark in zip(trials, marks, strict=True)
    )
    far_mm = {int(stiffness): float(far) for stiffness, _, far in trials}
    assert far_mm[400] < far_mm[100]
