"""The contract of every driver, on a serial line with the firmware's protocol core at its other end."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from hapticd.testing.driver_contract import AnyDriver, DriverContract
from hapticd_drivers.rig.serial_rig import SerialRig, SerialRigOptions
from tests.drivers.rig.device import Rig


class TestSerialRig(DriverContract):
    @pytest.fixture
    def driver(self, rig: Rig) -> AnyDriver:
        self.rig = rig
        rig.set_home()
        return SerialRig(SerialRigOptions(port=str(rig.port), sign_checked=True), 0.001)

    def force_on_device(self, driver: AnyDriver) -> Sequence[float]:
        assert isinstance(driver, SerialRig)
        return [self.rig.wait_for(driver).force_n]
