"""Objects in space in the running daemon: seen through its telemetry, equal to the offline run to the last bit."""

from __future__ import annotations

import subprocess
import time

import pytest

from hapticd.offline.simulate import simulate
from hapticd.paths import directory
from tests.daemon.running import HAPTICD, Daemon, Subscriber, all_records, wait_until

CONFIG = directory("config")
TICKS = 2000


@pytest.mark.parametrize("name", ["ball", "table-edge"])
def test_the_daemon_is_the_offline_run_to_the_last_bit(name: str) -> None:
    text = (CONFIG / f"{name}.toml").read_text()
    with Daemon(text) as daemon:
        daemon.wait_ready()
        memory = daemon.memory(axes=3)
        while memory.words[0] < TICKS:
            time.sleep(0.05)
        records = all_records(memory)
        memory.close()
    rows = simulate(text, TICKS * 1e-3).columns
    assert len(records) >= TICKS
    for record in records[:TICKS]:
        at = record.seq
        assert record.position_m == tuple(rows[f"measured_{axis}_m"][at] for axis in "xyz"), at
        assert record.force_n == tuple(rows[f"force_{axis}_n"][at] for axis in "xyz"), at
        assert record.energy_j == rows["energy_j"][at], at


def test_the_live_view_of_a_running_daemon_names_what_is_touched() -> None:
    """The hand begins to press after a while, and lets go again: some picture must show it."""
    with Daemon((CONFIG / "ball.toml").read_text()) as daemon:
        daemon.wait_ready()

        def shown() -> bool:
            command = [HAPTICD, "watch", "--once", "--connect", daemon.endpoint]
            picture = subprocess.run(command, capture_output=True, text=True, check=True).stdout
            return "● ball" in picture and "mm deep" in picture

        wait_until(shown, "the ball in the live view")


def test_what_is_touched_is_told() -> None:
    with Daemon((CONFIG / "ball.toml").read_text()) as daemon, Subscriber(daemon.endpoint) as subscriber:
        status = subscriber.until("hapticd/status")
        touch = subscriber.until("hapticd/contact", object=0)
        damping = subscriber.until("hapticd/damping", in_contact=[True])
    assert status["object_name"] == ["ball"]
    assert status["object_shape"] == ["sphere"]
    assert sum(value * value for value in touch["proxy_m"]) ** 0.5 == pytest.approx(0.03, abs=1e-9)
    assert sum(value * value for value in touch["normal"]) == pytest.approx(1.0)
    assert touch["depth_m"] > 0.0
    assert (touch["carrier"], touch["inside"]) == (0, [0])
    assert len(damping["damping_n_s_per_m"]) == 1
