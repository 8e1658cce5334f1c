"""The whole daemon, `hapticd run`, on ODrives behind an slcan adapter."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.drivers.motors.daemon_contract import MotorDaemonContract
from tests.drivers.motors.lab import MOST_N_M, RADIUS_M
from tests.drivers.odrive.lab import Lab


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    with Lab("slcan", tmp_path, 1, monkeypatch) as made:
        yield made


class TestOdrive(MotorDaemonContract):
    DEVICE = f"""
[device]
driver = "odrive"
[device.options]
channel = "{{port}}"
sign_checked = true
watchdog_ms = 20.0
[[device.options.axes]]
id = 0
radius_m = {RADIUS_M}
max_torque_n_m = {MOST_N_M}
lowest_m = -0.03
highest_m = 0.03
homing = "absolute"
"""
