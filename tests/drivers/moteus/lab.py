"""A moteus device for a test: controllers behind a pseudo-terminal or a CAN interface, and a driver for them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import pytest

from hapticd_drivers.moteus import driver as moteus_driver
from hapticd_drivers.moteus.driver import Moteus, MoteusOptions
from tests.drivers.moteus.controller import MoteusController
from tests.drivers.motors.bench import Bench
from tests.drivers.motors.can_pair import VIRTUAL, can_pair
from tests.drivers.motors.shaft import Shaft
from tests.drivers.motors.wire import FdcanusbEnd, SocketEnd, TtyEnd

RADIUS_M = 0.01
MOST_N_M = 0.05

Way = Literal["fdcanusb", "socketcan"]


def axes(count: int, **keys: Any) -> list[dict[str, Any]]:
    """Tables for [[device.options.axes]]."""
    table = {"radius_m": RADIUS_M, "max_torque_n_m": MOST_N_M, "lowest_m": -0.05, "highest_m": 0.05, **keys}
    return [{"id": index + 1, **table} for index in range(count)]


def options(channel: str, count: int = 1, **keys: Any) -> MoteusOptions:
    """As a configuration gives them; the shaft counts from the middle and the sign is known unless said otherwise."""
    tables = keys.pop("axes", None) or axes(count, homing="absolute")
    return MoteusOptions.model_validate({"channel": channel, "axes": tables, "sign_checked": True, **keys})


class Lab:
    """A bench, and drivers for it."""

    def __init__(self, way: Way, port: Path, count: int, monkeypatch: pytest.MonkeyPatch) -> None:
        self.controllers = [MoteusController(index + 1, Shaft(RADIUS_M)) for index in range(count)]
        self.channel = str(port) if way == "fdcanusb" else VIRTUAL
        self._way = way
        self._port = port
        self._monkeypatch = monkeypatch
        self.bench = Bench(self._end(), self.controllers)

    @property
    def first(self) -> MoteusController:
        return self.controllers[0]

    def driver(self, period_s: float = 0.001, **keys: Any) -> Moteus:
        return Moteus(options(self.channel, len(self.controllers), **keys), period_s)

    def plug(self) -> None:
        """Put the adapter's cable in again."""
        self.bench = Bench(self._end(), self.controllers)

    def _end(self) -> TtyEnd | SocketEnd:
        if self._way == "fdcanusb":
            return FdcanusbEnd(self._port)
        return SocketEnd(*can_pair(moteus_driver, self._monkeypatch, fd=True), fd=True)


@contextlib.contextmanager
def lab(way: Way, tmp_path: Path, count: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    made = Lab(way, tmp_path / "port", count, monkeypatch)
    try:
        yield made
    finally:
        made.bench.unplug()
