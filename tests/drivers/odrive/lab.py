"""An ODrive device for a test: controllers behind a pseudo-terminal or a CAN interface, and a driver for them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import pytest

from hapticd_drivers.odrive import driver as odrive_driver
from hapticd_drivers.odrive.driver import Odrive, OdriveOptions
from tests.drivers.motors.bench import Bench
from tests.drivers.motors.can_pair import VIRTUAL, can_pair
from tests.drivers.motors.shaft import Shaft
from tests.drivers.motors.wire import SlcanEnd, SocketEnd, TtyEnd
from tests.drivers.odrive.controller import OdriveController

RADIUS_M = 0.01
MOST_N_M = 0.05

Way = Literal["slcan", "socketcan"]


def axes(count: int, **keys: Any) -> list[dict[str, Any]]:
    """Tables for [[device.options.axes]]."""
    table = {"radius_m": RADIUS_M, "max_torque_n_m": MOST_N_M, "lowest_m": -0.05, "highest_m": 0.05, **keys}
    return [{"id": index, **table} for index in range(count)]


class Lab:
    """A bench, and drivers for it."""

    def __init__(self, way: Way, port: Path, count: int, monkeypatch: pytest.MonkeyPatch) -> None:
        self.controllers = [OdriveController(index, Shaft(RADIUS_M)) for index in range(count)]
        self.channel = str(port) if way == "slcan" else VIRTUAL
        self._way = way
        self._port = port
        self._monkeypatch = monkeypatch
        self.bench = Bench(self._end(), self.controllers)

    @property
    def first(self) -> OdriveController:
        return self.controllers[0]

    def driver(self, period_s: float = 0.001, **keys: Any) -> Odrive:
        tables = keys.pop("axes", None) or axes(len(self.controllers), homing="absolute")
        made = {"channel": self.channel, "axes": tables, "sign_checked": True, "watchdog_ms": 20.0, **keys}
        return Odrive(OdriveOptions.model_validate(made), period_s)

    def plug(self) -> None:
        """Put the adapter's cable in again."""
        self.bench = Bench(self._end(), self.controllers)

    def _end(self) -> TtyEnd | SocketEnd:
        if self._way == "slcan":
            return SlcanEnd(self._port)
        return SocketEnd(*can_pair(odrive_driver, self._monkeypatch, fd=False), fd=False)


@contextlib.contextmanager
def lab(way: Way, tmp_path: Path, count: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    made = Lab(way, tmp_path / "port", count, monkeypatch)
    try:
        yield made
    finally:
        made.bench.unplug()
