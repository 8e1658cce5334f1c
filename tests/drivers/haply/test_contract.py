"""The contract of every driver, over a real WebSocket."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any

import pytest

from hapticd.testing.driver_contract import AnyDriver, DriverContract
from hapticd_drivers.haply import driver as haply_driver
from hapticd_drivers.haply.driver import Inverse3, Inverse3Options
from tests.drivers.haply.service import FakeService


class TestInverse3(DriverContract):
    @pytest.fixture
    def driver(self, monkeypatch: pytest.MonkeyPatch) -> Iterator[AnyDriver]:
        monkeypatch.setattr(haply_driver, "URGENT_S", 5.0)
        monkeypatch.setattr(haply_driver, "SILENCE_S", 5.0)
        with FakeService() as service:
            self.service = service
            made = Inverse3(Inverse3Options(url=service.url), 0.001)
            yield made
            made.close()

    def force_on_device(self, driver: Any) -> Sequence[float]:
        end_s = time.monotonic() + 30.0
        while driver._courier.waiting:
            assert time.monotonic() < end_s
            time.sleep(0.001)
        return list(self.service.cursor.force_n)
