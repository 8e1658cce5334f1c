"""What the Inverse3's driver and the service have said to each other."""

from __future__ import annotations

import json

import pytest

from hapticd.errors import DeviceDisconnectedError
from hapticd_drivers.haply.courier import Courier
from hapticd_drivers.haply.driver import Inverse3, Inverse3Options
from tests.drivers.haply.service import FakeService


def said(driver: Inverse3) -> list[tuple[str, str]]:
    """Way and text of each entry."""
    return [(way, text) for _, way, text in (line.split(" ", 2) for line in driver.trace.lines())]


def ticks(driver: Inverse3, count: int) -> None:
    for _ in range(count):
        driver.read()
        driver.write([0.0, 0.0, 0.5])


def test_each_message_is_kept_as_it_went_and_came_and_the_end_as_well() -> None:
    with FakeService() as service:
        driver = Inverse3(Inverse3Options(url=service.url, trace=9), 0.001)
        driver._state_wait_s = 1.0
        driver.open()
        driver.enable()
        ticks(driver, 20)
        driver.read()
        (way, went), (back, came) = said(driver)[-2:]
        assert (way, back) == (">", "<")
        assert json.loads(went)["inverse3"][0]["commands"]["set_cursor_force"]["vector"]["z"] == 0.5
        assert "cursor_position" in came
        assert len(said(driver)) == 9
        service.stop()
        with pytest.raises(DeviceDisconnectedError):
            ticks(driver, 5)
        driver.close()
    assert driver.trace.lines()[-1].split(" ", 1)[1].startswith("inverse3: the service at")


def test_without_the_option_nothing_is_kept_and_no_message_costs_more() -> None:
    with FakeService() as service:
        driver = Inverse3(Inverse3Options(url=service.url), 0.001)
        driver.open()
        driver.read()
        assert driver.trace.lines() == []
        assert type(driver._courier) is Courier
        driver.close()
