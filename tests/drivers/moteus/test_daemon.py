"""The whole daemon, `hapticd run`, on moteus controllers behind an fdcanusb."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.drivers.moteus.lab import Lab
from tests.drivers.motors.daemon_contract import MotorDaemonContract
from tests.drivers.motors.lab import MOST_N_M, RADIUS_M


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    with Lab("fdcanusb", tmp_path, 1, monkeypatch) as made:
        yield made


class TestMoteus(MotorDaemonContract):
    DEVICE = f"""
[device]
driver = "moteus"
[device.options]
channel = "{{port}}"
sign_checked = true
[[device.options.axes]]
id = 1
radius_m = {RADIUS_M}
max_torque_n_m = {MOST_N_M}
lowest_m = -0.03
highest_m = 0.03
homing = "absolute"
"""
