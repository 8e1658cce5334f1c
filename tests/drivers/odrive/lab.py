"""An ODrive device for a test: controllers behind a pseudo-terminal or a CAN interface, and a driver for them."""

from __future__ import annotations

from types import ModuleType
from typing import Any, ClassVar

from hapticd_drivers.odrive import driver as odrive_driver
from hapticd_drivers.odrive.driver import Odrive, OdriveOptions
from tests.drivers.motors.lab import MotorLab, tables
from tests.drivers.motors.shaft import Shaft
from tests.drivers.motors.wire import SlcanEnd
from tests.drivers.odrive.controller import OdriveController


def axes(count: int, **keys: Any) -> list[dict[str, Any]]:
    """Tables for [[device.options.axes]]."""
    return tables(0, count, **keys)


class Lab(MotorLab):
    """A bench, and drivers for it."""

    MODULE: ClassVar[ModuleType] = odrive_driver
    FD = False
    ADAPTER = SlcanEnd

    def controller(self, index: int, shaft: Shaft) -> OdriveController:
        return OdriveController(index, shaft)

    def made(self, period_s: float, **keys: Any) -> Odrive:
        common = {"channel": self.channel, "sign_checked": True, "watchdog_ms": 20.0}
        tables = axes(len(self.controllers), homing="absolute", lowest_m=-0.03, highest_m=0.03)
        made = {**common, "axes": tables, **keys}
        return Odrive(OdriveOptions.model_validate(made), period_s)
