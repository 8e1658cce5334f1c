"""A moteus device for a test: controllers behind a pseudo-terminal or a CAN interface, and a driver for them."""

from __future__ import annotations

from types import ModuleType
from typing import Any, ClassVar

from hapticd_drivers.moteus import driver as moteus_driver
from hapticd_drivers.moteus.driver import Moteus, MoteusOptions
from tests.drivers.moteus.controller import MoteusController
from tests.drivers.motors.lab import MotorLab, tables
from tests.drivers.motors.shaft import Shaft
from tests.drivers.motors.wire import FdcanusbEnd


def axes(count: int, **keys: Any) -> list[dict[str, Any]]:
    """Tables for [[device.options.axes]]."""
    return tables(1, count, **keys)


def options(channel: str, count: int = 1, **keys: Any) -> MoteusOptions:
    """As a configuration gives them; the shaft knows its place in less than a turn, and the sign is known."""
    made = {
        "channel": channel,
        "axes": axes(count, homing="absolute", lowest_m=-0.03, highest_m=0.03),
        "sign_checked": True,
        **keys,
    }
    return MoteusOptions.model_validate(made)


class Lab(MotorLab):
    """A bench, and drivers for it."""

    MODULE: ClassVar[ModuleType] = moteus_driver
    FD = True
    ADAPTER = FdcanusbEnd

    def controller(self, index: int, shaft: Shaft) -> MoteusController:
        return MoteusController(index + 1, shaft)

    def made(self, period_s: float, **keys: Any) -> Moteus:
        return Moteus(options(self.channel, len(self.controllers), **keys), period_s)
