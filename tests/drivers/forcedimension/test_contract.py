"""The contract of every driver, on the fake of each device, right- and left-handed."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from hapticd.testing.driver_contract import AnyDriver, DriverContract
from hapticd_drivers.forcedimension.driver import ForceDimension
from hapticd_drivers.forcedimension.models import MODELS
from tests.drivers.forcedimension.bench import Bench


@pytest.mark.parametrize("device_type", MODELS)
class TestForceDimension(DriverContract):
    @pytest.fixture
    def driver(self, bench: Bench, device_type: int) -> AnyDriver:
        self.bench = bench
        bench.set(type=device_type, motor_n=MODELS[device_type].max_force_n)
        return bench.driver()

    def force_on_device(self, driver: AnyDriver) -> Sequence[float]:
        assert isinstance(driver, ForceDimension)
        return self.bench.vector("force_n")
