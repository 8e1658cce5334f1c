"""Motors on a bench for a test, behind a pseudo-terminal or a CAN interface: what the labs of all families share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar, Self

import pytest

from hapticd_drivers.motors.driver import MotorDriver
from tests.drivers.motors.bench import Bench, Controller
from tests.drivers.motors.can_pair import VIRTUAL, can_pair
from tests.drivers.motors.shaft import Shaft
from tests.drivers.motors.wire import SocketEnd, TtyEnd

RADIUS_M = 0.01
MOST_N_M = 0.05
SOCKETCAN = "socketcan"


def tables(first_id: int, count: int, **keys: Any) -> list[dict[str, Any]]:
    """Tables for [[device.options.axes]]."""
    table = {"radius_m": RADIUS_M, "max_torque_n_m": MOST_N_M, "lowest_m": -0.05, "highest_m": 0.05, **keys}
    return [{"id": first_id + index, **table} for index in range(count)]


class MotorLab(ABC):
    """A bench, and drivers for it. A family says what its controllers, its adapter and its options are.

    Args:
        way: how frames go: by the name of the adapter, or "socketcan".
        directory: where the adapter's port is.
        count: how many motors.
        monkeypatch: of the test.
    """

    MODULE: ClassVar[ModuleType]
    """Whose `open_can` opens an interface."""

    FD: ClassVar[bool]
    ADAPTER: ClassVar[type[TtyEnd]]

    def __init__(self, way: str, directory: Path, count: int, monkeypatch: pytest.MonkeyPatch) -> None:
        self.controllers = [self.controller(index, Shaft(RADIUS_M)) for index in range(count)]
        self._way = way
        self._port = directory / "port"
        self._monkeypatch = monkeypatch
        self.channel = VIRTUAL if way == SOCKETCAN else str(self._port)
        self.bench = Bench(self._end(), self.controllers)
        self._drivers: list[MotorDriver[Any]] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """A test that failed has closed no driver; the next is not to fail for it."""
        for driver in self._drivers:
            driver.close()
        self.bench.unplug()

    @abstractmethod
    def controller(self, index: int, shaft: Shaft) -> Controller:
        """The controller at a place on the bus."""

    @abstractmethod
    def made(self, period_s: float, **keys: Any) -> MotorDriver[Any]:
        """The driver for `driver`."""

    def driver(self, period_s: float = 0.001, **keys: Any) -> MotorDriver[Any]:
        """A closed driver; its shafts count from the middle and its sign is known unless the keys say otherwise."""
        self._drivers.append(self.made(period_s, **keys))
        return self._drivers[-1]

    @property
    def first(self) -> Any:
        """The first controller."""
        return self.controllers[0]

    def asked_before_it_follows(self) -> list[float]:
        """The torque that the first controller is told from now on while it does not follow, ms by ms [N m]."""
        first, asked_n_m = self.first, list[float]()
        pass_time = first.pass_time

        def note(duration_s: float) -> None:
            if not first.follows:
                asked_n_m.append(first._torque_n_m)
            pass_time(duration_s)

        self._monkeypatch.setattr(first, "pass_time", note)
        return asked_n_m

    def plug(self) -> None:
        """Put the adapter's cable in again."""
        self.bench = Bench(self._end(), self.controllers)

    def _end(self) -> TtyEnd | SocketEnd:
        if self._way == SOCKETCAN:
            return SocketEnd(*can_pair(self.MODULE, self._monkeypatch, fd=self.FD), fd=self.FD)
        return self.ADAPTER(self._port)
