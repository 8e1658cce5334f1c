"""docs/your-simulator.md: what it says of a peg, a ball and a drawer in MuJoCo that a hand feels through a coupling."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hapticd.client import Client, Position
from tests.daemon.running import Daemon
from tests.your_simulator.coupling import EXAMPLE, coupled, hum_m, plain

PAGE = (EXAMPLE.parents[1] / "your-simulator.md").read_text()
RATES_HZ = (60, 200, 500)
LONG_S = 8.0
STILL_M = 0.2e-3
"""Contacts and the device's own steps of 10 um make a hand swing by less than this."""
SESSIONS = 3
LOST_M = 0.02
"""A hand and its peg are never farther apart."""


def documented(rate_hz: int) -> dict[str, float]:
    """What the page's table says of a rate [mm]."""
    row = next(line for line in PAGE.splitlines() if line.startswith(f"| {rate_hz} Hz |"))
    numbers = [float(number) for number in re.findall(r"\d+\.\d+", row)]
    return dict(zip(("plain", "damped", "none", "coupled"), numbers, strict=True))


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_the_peg_is_steady_where_a_plain_coupling_is_not(rate_hz: int) -> None:
    """The same spring, hand and delay at each rate."""
    held, bare = coupled(rate_hz, LONG_S), coupled(rate_hz, LONG_S, "none")
    first, damped = plain(rate_hz, LONG_S), plain(rate_hz, LONG_S, 15.0)
    assert held.hum_m < STILL_M
    assert np.abs(held.device_m - held.peg_m).max() < LOST_M
    assert first.hum_m > 1.5 * STILL_M
    measured = {"plain": first, "damped": damped, "none": bare, "coupled": held}
    for name, hum_mm in documented(rate_hz).items():
        loose = 0.5 if hum_mm > 1e3 * STILL_M else 0.3  # what swings, swings as chance will have it
        assert 1e3 * measured[name].hum_m == pytest.approx(hum_mm, rel=loose, abs=0.01), name


def test_the_hand_feels_the_scene_and_the_scene_the_hand() -> None:
    session = coupled(60, LONG_S)
    assert np.abs(session.ball_m - session.ball_m[0]).max() > 0.005
    assert 0.02 < session.drawer_m.max() < 0.055
    assert session.peg_m[:, 2].min() < -0.003  # its middle, in the hole
    assert np.abs(session.force_n).max() > 4.0


@pytest.mark.parametrize(
    ("rate_hz", "duration_s"),
    [(60, 4), *(pytest.param(rate_hz, LONG_S, marks=pytest.mark.nightly) for rate_hz in RATES_HZ)],
)
def test_the_example_runs_beside_a_daemon(rate_hz: int, duration_s: float) -> None:
    """A busy computer makes the simulator later than it is: of three sessions one must be still."""
    assert any(beside_a_daemon(rate_hz, duration_s) < STILL_M for _ in range(SESSIONS))


def beside_a_daemon(rate_hz: int, duration_s: float) -> float:
    """How much the hand swings while the example drives a daemon [m]."""
    with (
        Daemon((EXAMPLE / "scene.toml").read_text()).wait_ready() as daemon,
        Client(daemon.endpoint, topics=[Position], receive_high_water=100_000) as client,
    ):
        environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(daemon.directory / "run")}
        done = subprocess.run(
            [sys.executable, EXAMPLE / "coupled.py", str(rate_hz), str(duration_s)],
            env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        ticks = _pushed(client)
    said = re.fullmatch(r"ball at x = (-?\d+) mm, drawer (\d+) mm in\n", done.stdout)
    assert said, done.stdout
    assert max(np.linalg.norm(tick.force_n) for tick in ticks) > 1.0
    return hum_m(np.array([tick.position_m for tick in ticks]))


def _pushed(client: Client) -> list[Position]:
    """The ticks until now from the first to the last with a force; the example may take long to start and to end."""
    with Client(client.endpoint, topics=[Position]) as other:
        now = other.wait_for(Position).seq
    found: list[Position] = []
    while not found or found[-1].seq < now:
        found += [tick for tick in client.receive(1.0) if isinstance(tick, Position)]
    pushed = [index for index, tick in enumerate(found) if any(tick.force_n)]
    assert len(pushed) > 1000, "the hand has felt next to nothing"
    return found[pushed[0] : pushed[-1] + 1]


def test_the_page_shows_the_example_as_it_is() -> None:
    assert f"```python\n{_body(EXAMPLE / 'coupled.py')}```\n" in PAGE
    figure = EXAMPLE.parents[1] / "your-simulator.svg"
    assert figure.is_file()
    assert f"]({figure.name})" in PAGE


def _body(path: Path) -> str:
    """The part of the example that stands in the page: its loop."""
    source = path.read_text()
    return source[source.index("def main(") : source.index("\n\nif __name__")].rstrip("\n") + "\n"
