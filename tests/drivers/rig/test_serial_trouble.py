"""What the serial rig's driver counts and times on its line."""

from __future__ import annotations

import time

import pytest

from hapticd_drivers.rig.metrics import METRICS
from hapticd_drivers.rig.serial_rig import SerialRig
from tests.drivers.rig.device import Rig, Spoiler
from tests.drivers.rig.ticking import PERIOD_S, metric, tick


def now_us() -> float:
    return time.monotonic_ns() * 1e-3


def test_the_echo_is_timed(rig: Rig, driver: SerialRig) -> None:
    begun_us = now_us()
    driver.open()
    assert 0.0 < metric(driver, "round_trip_us") <= now_us() - begun_us
    driver.enable()
    for waits_s in (0.02, 0.0):
        sent_us = now_us()
        tick(rig, driver)
        time.sleep(waits_s)
        driver.read()
        assert 1e6 * waits_s < metric(driver, "echo_us") <= now_us() - sent_us
    assert 20e3 < metric(driver, "longest_echo_us") <= now_us() - begun_us


class Once:
    """Changes the first bytes that it sees, and no others."""

    def __init__(self, change: Spoiler) -> None:
        self.change = change
        self.done = False

    def __call__(self, data: bytes) -> bytes:
        if self.done:
            return data
        self.done = True
        return self.change(data)


class Swap:
    """Holds the first frame back until after the second one."""

    def __init__(self) -> None:
        self.held: bytes | None = None
        self.done = False

    def __call__(self, data: bytes) -> bytes:
        if self.done or not data:
            return data
        if self.held is None:
            self.held = data
            return b""
        self.done = True
        return data + self.held


@pytest.mark.parametrize(
    ("spoil", "counted"),
    [
        (Once(lambda data: b""), {"lost_frames": 1.0}),
        (Once(lambda data: bytes([data[0] ^ 1]) + data[1:]), {"damaged_frames": 1.0, "lost_frames": 1.0}),
        (Once(lambda data: data + data), {"repeated_frames": 1.0}),
        (Swap(), {"lost_frames": 1.0, "late_frames": 1.0}),
    ],
    ids=["lost", "damaged", "repeated", "late"],
)
def test_each_kind_of_trouble_on_the_way_here_is_counted(
    rig: Rig, driver: SerialRig, spoil: Spoiler, counted: dict[str, float]
) -> None:
    driver.open()
    driver.enable()
    for _ in range(10):
        tick(rig, driver)
    rig.up = spoil
    for _ in range(30):
        tick(rig, driver)
    troubles = {each.name: metric(driver, each.name) for each in METRICS if each.warns and metric(driver, each.name)}
    assert troubles == counted


@pytest.mark.parametrize(
    ("spoil", "counted"),
    [
        (Once(lambda data: b""), {"commands_lost": 1.0}),
        (Once(lambda data: bytes([data[0] ^ 1]) + data[1:]), {"commands_damaged": 1.0, "commands_lost": 1.0}),
        (Once(lambda data: data + data), {"commands_stale": 1.0}),
    ],
    ids=["lost", "damaged", "stale"],
)
def test_each_kind_of_trouble_on_the_way_there_is_told_within_a_second(
    rig: Rig, driver: SerialRig, spoil: Spoiler, counted: dict[str, float]
) -> None:
    driver.open()
    driver.enable()
    tick(rig, driver)
    rig.down = spoil
    for _ in range(round(1.1 / PERIOD_S)):
        tick(rig, driver)
    troubles = {each.name: metric(driver, each.name) for each in METRICS if each.warns and metric(driver, each.name)}
    assert troubles == counted
