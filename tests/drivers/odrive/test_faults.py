"""What can go wrong with ODrives, over slcan and over SocketCAN."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hapticd.errors import (
    DeviceDisconnectedError,
    DeviceFaultError,
    DeviceProtocolError,
    DeviceTimeoutError,
    DriverError,
)
from hapticd_drivers.motors import crew
from hapticd_drivers.odrive import crew as odrive_crew
from hapticd_drivers.odrive.driver import Odrive
from tests.drivers.motors.bench import PATIENCE_S
from tests.drivers.motors.fault_contract import (
    MotorFault,
    MotorFaultContract,
    brown_out,
    deafen,
    nothing_heard,
    pressing,
    ticks_until,
    unplug,
)
from tests.drivers.odrive.lab import Lab, axes

BEAT_TICKS = 10
"""What is said in a heartbeat is heard at the next one."""

SOON_TICKS = BEAT_TICKS + 2
FAULTS = (
    MotorFault(
        "the computer says nothing for 24 ms", nothing_heard, DeviceFaultError, "watchdog heard no torque", SOON_TICKS
    ),
    MotorFault("the supply falls", brown_out, DeviceFaultError, "supply is too low", SOON_TICKS),
    MotorFault("switched off and on", lambda made: made.first.restart(), DeviceFaultError, "restarted", SOON_TICKS),
    MotorFault("encoder error", lambda made: made.first.break_down(8), DeviceFaultError, "check encoder", SOON_TICKS),
    MotorFault("an ODrive is silent", deafen, DeviceTimeoutError, "no heartbeat for 50 ms", 60, 0.005),
    MotorFault("the adapter is unplugged", unplug, DeviceDisconnectedError, "gone", 2),
)


@pytest.fixture(params=["slcan", "socketcan"])
def bench(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    """A busy computer is no fault."""
    for place, name in (
        (crew, "URGENT_PATIENCE_S"),
        (odrive_crew, "LOOKED_S"),
        (odrive_crew, "OBEYS_S"),
    ):
        monkeypatch.setattr(place, name, PATIENCE_S)
    with Lab(request.param, tmp_path, 2, monkeypatch) as made:
        yield made


@pytest.fixture(params=FAULTS, ids=lambda fault: fault.name)
def fault(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> MotorFault:
    found: MotorFault = request.param
    if found.kind is not DeviceTimeoutError:
        monkeypatch.setattr(odrive_crew, "HEARTBEAT_S", PATIENCE_S)
    return found


class TestOdrive(MotorFaultContract):
    PAGE = "odrive.md"
    FAULTS = FAULTS
    TIMED_OUT = "watchdog"
    STRANGER = 0x7E1  # of node 63
    BROKEN_LINE = b"t00x8zz\r"
    LONGEST_CUT = 8

    def calm(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(odrive_crew, "HEARTBEAT_S", PATIENCE_S)


def test_a_watchdog_that_is_not_declared_is_none(bench: Lab) -> None:
    with bench.driver(watchdog_ms=None) as without:
        assert without.info.host_silence_ms is None


def test_a_place_that_cannot_be_is_no_place(bench: Lab) -> None:
    driver = pressing(bench)
    bench.first.turns = float("nan")
    ticks_until(driver, DeviceProtocolError, "check its encoder")
    driver.close()


@pytest.mark.parametrize(
    ("name", "value", "kind", "text"),
    [
        ("heartbeat_ms", 0, DeviceTimeoutError, "controller 1 on"),
        ("heartbeat_ms", 2000, DeviceTimeoutError, "controller 1 on"),
        ("estimates_ms", 0, DeviceTimeoutError, "encoder_msg_rate_ms = 1"),
    ],
)
def test_an_odrive_that_was_not_set_up_is_refused_with_what_to_set(
    bench: Lab, monkeypatch: pytest.MonkeyPatch, name: str, value: int, kind: type[DriverError], text: str
) -> None:
    monkeypatch.setattr(crew, "GREETING_PATIENCE_S", 0.3)
    monkeypatch.setattr(odrive_crew, "GREETING_PATIENCE_S", 0.3)
    setattr(bench.controllers[1], name, value)
    with pytest.raises(kind, match=text):
        bench.driver().open()


def test_slow_heartbeats_are_refused_with_what_to_set(bench: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(odrive_crew, "LOOKED_S", 0.3)
    bench.first.heartbeat_ms = 100
    with pytest.raises(DeviceProtocolError, match="heartbeat_msg_rate_ms = 10"):
        bench.driver().open()


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"axes": [*axes(1), *axes(1)]}, "another axis has this address"),
        ({"axes": axes(1, homing="absolute")}, "up to 0.8 times from home_m: take another homing"),
        ({"axes": axes(1, homing="absolute", lowest_m=0.0, highest_m=0.04)}, "up to 0.64 times from home_m"),
        ({"axes": axes(1, lowest_m=0.1)}, "must be below highest_m"),
        ({"axes": axes(1, id=64)}, "0 to 63"),
        ({"watchdog_ms": 3.0}, "at least 4"),
        ({"axes": axes(3), "bitrate": 250_000}, "at this loop.rate_hz"),
    ],
)
def test_options_that_cannot_be_are_refused(bench: Lab, keys: dict[str, Any], text: str) -> None:
    driver = bench.driver(**keys)
    with pytest.raises(ValueError, match=text):
        Odrive.check(driver.options, 0.001)
