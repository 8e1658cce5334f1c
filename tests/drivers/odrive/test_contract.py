"""The contract of every driver, over both adapters, with one motor and with three."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from hapticd.testing.driver_contract import AnyDriver, DriverContract
from hapticd_drivers.motors import crew
from hapticd_drivers.odrive import crew as odrive_crew
from tests.drivers.motors.bench import PATIENCE_S
from tests.drivers.odrive.lab import Lab


class TestOdrive(DriverContract):
    @pytest.fixture(params=[("slcan", 1), ("slcan", 3), ("socketcan", 2)], ids=str)
    def driver(
        self, request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> Iterator[AnyDriver]:
        monkeypatch.setattr(crew, "URGENT_PATIENCE_S", PATIENCE_S)
        monkeypatch.setattr(odrive_crew, "HEARTBEAT_S", PATIENCE_S)
        monkeypatch.setattr(odrive_crew, "OBEYS_S", PATIENCE_S)
        monkeypatch.setattr(odrive_crew, "LOOKED_S", PATIENCE_S)
        way, count = request.param
        with Lab(way, tmp_path, count, monkeypatch) as made:
            self.lab: Lab = made
            yield made.driver()

    def force_on_device(self, driver: Any) -> Sequence[float]:
        self.lab.bench.settle(driver)
        return [one.torque_n_m / one.shaft.radius_m for one in self.lab.controllers]
