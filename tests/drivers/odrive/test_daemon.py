"""The whole daemon, `hapticd run`, on ODrives behind an slcan adapter."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.daemon.running import Daemon
from tests.drivers.motors.daemon import LIMIT_N_PER_M, STILL_M, config, holds, kill_the_loop, lost_and_found, press
from tests.drivers.odrive.lab import MOST_N_M, RADIUS_M, Lab, lab

STIFF_N_PER_M = 3.0 * LIMIT_N_PER_M

pytestmark = pytest.mark.timeout(300)


def device(port: Path) -> str:
    return f"""
[device]
driver = "odrive"
[device.options]
channel = "{port}"
sign_checked = true
watchdog_ms = 20.0
[[device.options.axes]]
id = 0
radius_m = {RADIUS_M}
max_torque_n_m = {MOST_N_M}
lowest_m = -0.05
highest_m = 0.05
homing = "absolute"
"""


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    with lab("slcan", tmp_path, 1, monkeypatch) as made:
        yield made


@pytest.mark.parametrize(
    ("law", "stiffness_n_per_m", "still"),
    [("none", LIMIT_N_PER_M, True), ("none", STIFF_N_PER_M, False), ("", STIFF_N_PER_M, True)],
)
def test_the_default_law_holds_a_wall_of_three_times_the_limit_and_no_law_does_not(
    bench: Lab, tmp_path: Path, law: str, stiffness_n_per_m: float, still: bool
) -> None:
    with Daemon(config(device(tmp_path / "port"), stiffness_n_per_m, law)) as daemon:
        swing_m, off_m = holds(daemon.wait_ready(), bench.bench, stiffness_n_per_m)
        if still:
            assert swing_m < STILL_M
            assert abs(off_m) < 0.1e-3
        else:
            assert swing_m > 1e-3


def test_sigterm_leaves_no_force(bench: Lab, tmp_path: Path) -> None:
    with Daemon(config(device(tmp_path / "port"), 500.0)) as daemon:
        daemon.wait_ready()
        press(bench.bench)
        daemon.process.terminate()
        assert daemon.wait_exit() == 0
        assert bench.first.torque_n_m == 0.0


def test_a_loop_that_is_killed_leaves_no_force(bench: Lab, tmp_path: Path) -> None:
    """The supervisor's helper takes it, since no time passes for the watchdog here."""
    with Daemon(config(device(tmp_path / "port"), 500.0)) as daemon:
        kill_the_loop(daemon.wait_ready(), bench.bench)
        assert bench.first.torque_n_m == 0.0
        assert "the device is without force" in daemon.output()


def test_an_adapter_that_is_unplugged_is_lost_and_found_again(bench: Lab, tmp_path: Path) -> None:
    with Daemon(config(device(tmp_path / "port"), 500.0)) as daemon:
        assert "gone" in lost_and_found(daemon.wait_ready(), bench.bench, bench.plug)
        swing_m, _ = holds(daemon, bench.bench, 500.0)
        assert swing_m < STILL_M
