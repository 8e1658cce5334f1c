"""What a configuration allows and what a study promises is kept in the daemon: telemetry against the full model."""

from __future__ import annotations

import math
import os
import signal

import pytest

from hapticd.cli.watch.screen import frame
from hapticd.cli.watch.state import ScreenState
from hapticd.config.loading import load, parse
from hapticd.loop.memory import RECORDS
from hapticd.offline.rehearsal import rehearse
from hapticd.paths import directory
from hapticd.simulation.options import SimulationOptions
from hapticd.telemetry.records import Status
from hapticd.tick.record import TickRecord
from hapticd_studies.scene.study import study
from tests.daemon.running import Daemon, Subscriber, all_records, wait_until

TICKS = 2500
CONFIG = """
[device.options]
model = "omega7"
initial_position_m = 0.002
resolution_m = 0.0
coulomb_n = 1e-4
noise_m = 1e-9
bandwidth_hz = 2000.0
force_delay_samples = 1
hand = {{ force = {{ profile = "step", at_s = 1.0, newton = -3.0 }}, stiffness_n_per_m = 1.0, damping_n_s_per_m = 2.0 }}
{accuracy}
[[scene.walls]]
stiffness_n_per_m = 2000.0
"""


def first_ticks(daemon: Daemon, count: int) -> list[TickRecord]:
    """So many ticks from the very first on, out of the ring, since a subscriber comes too late for them."""
    memory = daemon.memory()
    wait_until(lambda: memory.words[RECORDS] >= count, f"{count} ticks")
    records = all_records(memory)[:count]
    memory.close()
    assert [record.seq for record in records] == list(range(count))
    return records


@pytest.mark.parametrize(("position_m", "least_error_m"), [(1e-6, 1e-9), (3e-4, 1e-5)])
def test_the_daemon_errs_by_no_more_than_was_allowed(position_m: float, least_error_m: float) -> None:
    """And by something: the model that runs is not the full one."""
    full = parse(CONFIG.format(accuracy=""), "full.toml")
    assert isinstance(full.options, SimulationOptions)
    exact = rehearse(full, TICKS * 1e-3)
    text = CONFIG.format(accuracy=f"accuracy = {{ position_m = {position_m}, over_s = 2.5 }}")
    with Daemon(text) as daemon, Subscriber(daemon.wait_ready().endpoint) as subscriber:
        records = first_ticks(daemon, TICKS)
        told = subscriber.until("hapticd/status")["accuracy"]
        daemon.config.write_text(text.replace("stiffness_n_per_m = 2000.0", "stiffness_n_per_m = 2100.0"))
        os.kill(daemon.process.pid, signal.SIGHUP)
        for topic, fields in subscriber.maps():
            if topic == "hapticd/status" and fields["wall_stiffness_n_per_m"] == [2100.0]:
                assert fields["accuracy"].startswith(told + "; chosen for configuration ")
                break
    errors_m = [abs(record.position_m[0] - exact.x_m[record.seq]) for record in records]
    errors_j = [abs(record.energy_j - exact.energy_j[record.seq]) for record in records]
    assert least_error_m < max(errors_m) <= position_m + 4e-9  # the sensor's noise, which the true position has not
    assert max(errors_j) > 0.0
    assert told.startswith("exact step without ")
    assert " instead of " in told
    known = ScreenState()
    known.take([Status(accuracy=told, armed=True)], 0.0)
    assert told in " ".join(" ".join(line.plain.split()) for line in frame(known, "ipc://lab", 80, 40, 0.0))


def test_the_smallest_model_of_a_scene_answers_in_the_daemon_as_the_full_one() -> None:
    tolerance, ticks = 0.05, 1500
    full = load(directory("config") / "every-term.toml")
    scene = study(full, 1.5, tolerance, lambda _: None)
    exact = rehearse(full, 1.5)
    with Daemon(scene.minimal.text) as daemon:
        records = first_ticks(daemon.wait_ready(), ticks)
    off = sum((record.force_n[0] - exact.force_n[record.seq]) ** 2 for record in records)
    size = sum(force_n * force_n for force_n in exact.force_n)
    worst_j = max(abs(record.energy_j - exact.energy_j[record.seq]) for record in records)
    last_n, depth_m = records[-1].force_n[0], -records[-1].position_m[0]
    assert 0.0 < math.sqrt(off / size) <= tolerance
    assert 0.0 < worst_j <= tolerance * max(map(abs, exact.energy_j))
    assert last_n / depth_m == pytest.approx(exact.displayed_stiffness_n_per_m, rel=tolerance)
    assert scene.minimal_operations < 0.7 * scene.operations
