"""Ticks of a serial rig's driver as an armed loop makes them, and what it has counted."""

from __future__ import annotations

from typing import Protocol

from hapticd_drivers.rig.metrics import METRICS
from hapticd_drivers.rig.serial_rig import SerialRig
from tests.drivers.rig.device import Rig

PERIOD_S = 0.001


class MakeDriver(Protocol):
    """Make a driver for the rig with these options."""

    def __call__(self, **options: object) -> SerialRig: ...


def metric(driver: SerialRig, name: str) -> float:
    return driver.metrics[[each.name for each in METRICS].index(name)]


def tick(rig: Rig, driver: SerialRig, force_n: float = 0.0) -> float:
    """One tick of an armed loop; the position. The rig has heard it, and its answer waits."""
    position_m = driver.read().position_m[0]
    driver.write([force_n])
    rig.wait_for(driver)
    return position_m


def ticks(rig: Rig, driver: SerialRig, force_n: float = 0.0, count: int = 10) -> None:
    for _ in range(count):
        tick(rig, driver, force_n)


def settle(rig: Rig, driver: SerialRig) -> float:
    """Two ticks without force, so that the position is new."""
    driver.read()
    rig.wait_for(driver)
    return driver.read().position_m[0]
