"""Each thing that can go wrong with ODrives: how soon it is noticed, its name, and what push is left."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hapticd.driver import DriverState
from hapticd.errors import (
    DeviceDisconnectedError,
    DeviceFaultError,
    DeviceProtocolError,
    DeviceTimeoutError,
    DriverError,
)
from hapticd_drivers.motors import crew
from hapticd_drivers.motors.metrics import DAMAGED, TICKS_WITHOUT_STATE, UNKNOWN
from hapticd_drivers.odrive import crew as odrive_crew
from hapticd_drivers.odrive.driver import Odrive
from tests.drivers.motors.bench import PATIENCE_S
from tests.drivers.motors.wire import Frames
from tests.drivers.odrive.lab import RADIUS_M, Lab, axes, lab

PUSH_N = 2.0
WATCHDOG_MS = 20.0
BEAT_TICKS = 10
"""What is said in a heartbeat is heard at the next one."""


@pytest.fixture(params=["slcan", "socketcan"])
def bench(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    patient(monkeypatch)
    with lab(request.param, tmp_path, 2, monkeypatch) as made:
        yield made


def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy computer is no fault."""
    monkeypatch.setattr(crew, "URGENT_PATIENCE_S", PATIENCE_S)
    monkeypatch.setattr(odrive_crew, "LOOKED_S", PATIENCE_S)
    monkeypatch.setattr(odrive_crew, "OBEYS_S", PATIENCE_S)


def pressing(made: Lab) -> Odrive:
    driver = made.driver()
    driver._state_wait_s = PATIENCE_S
    driver.open()
    driver.enable()
    for _ in range(25):
        driver.read()
        driver.write([PUSH_N, -PUSH_N])
    made.bench.settle(driver)
    assert made.first.torque_n_m == pytest.approx(PUSH_N * RADIUS_M)
    return driver


def ticks_until(made: Lab, driver: Odrive, kind: type[DriverError], text: str) -> int:
    """Ticks of the ODrive until the error."""
    driver._state_wait_s = 0.005
    ticks = 0

    def press_on() -> None:
        nonlocal ticks
        while ticks < 2000:
            ticks += 1
            driver.read()
            driver.write([PUSH_N, -PUSH_N])

    with pytest.raises(kind, match=re.escape(text)):
        press_on()
    return ticks


def nothing_heard(made: Lab) -> None:
    made.bench.pass_time(1.2e-3 * WATCHDOG_MS)


FAULTS: dict[str, tuple[Callable[[Lab], Any], type[DriverError], str, int]] = {
    "the computer says nothing for 24 ms": (
        nothing_heard,
        DeviceFaultError,
        "watchdog heard no torque",
        BEAT_TICKS + 2,
    ),
    "the supply falls": (
        lambda made: setattr(made.first, "voltage_v", 8.0),
        DeviceFaultError,
        "supply is too low",
        BEAT_TICKS + 2,
    ),
    "switched off and on": (lambda made: made.first.restart(), DeviceFaultError, "restarted", BEAT_TICKS + 2),
    "encoder error": (lambda made: made.first.break_down(8), DeviceFaultError, "check encoder", BEAT_TICKS + 2),
    "an ODrive is silent": (
        lambda made: setattr(made.first, "deaf", True),
        DeviceTimeoutError,
        "no heartbeat for 50 ms",
        60,
    ),
    "the adapter is unplugged": (lambda made: made.bench.unplug(), DeviceDisconnectedError, "gone", 2),
}
"""What happens, the error, what its text says, and in how many ticks at most it is told."""


@pytest.mark.parametrize("name", FAULTS)
def test_what_goes_wrong_is_named_soon_and_leaves_no_force(
    bench: Lab, name: str, record_property: Callable[[str, object], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    happen, kind, text, most_ticks = FAULTS[name]
    if kind is not DeviceTimeoutError:
        monkeypatch.setattr(odrive_crew, "HEARTBEAT_S", PATIENCE_S)
    driver = pressing(bench)
    bench.first.peak_n_m = 0.0
    happen(bench)
    ticks = ticks_until(bench, driver, kind, text)
    assert ticks <= most_ticks
    assert bench.first.peak_n_m <= PUSH_N * RADIUS_M * 1.001
    driver.disable()
    assert driver.state is DriverState.OPEN
    for controller in bench.controllers:
        controller.advance(0.05)  # those that heard nothing of it have their watchdogs
        assert controller.torque_n_m == 0.0
    driver.close()
    record_property("ticks", ticks)
    record_property("peak_n", bench.first.peak_n_m / RADIUS_M)
    print(f"| {name} | {ticks} | {bench.first.peak_n_m / RADIUS_M:.2f} |")  # noqa: T201 - the table of docs/odrive.md


def test_the_page_names_each_of_them() -> None:
    page = (Path(__file__).parents[3] / "docs" / "odrive.md").read_text()
    assert [name for name in FAULTS if f"| {name} |" not in page] == []


def test_the_watchdog_is_the_one_that_is_declared(bench: Lab) -> None:
    driver = pressing(bench)
    assert driver.info.host_silence_ms == WATCHDOG_MS
    bench.first.pass_time(1e-3 * (WATCHDOG_MS - 2.0))
    assert bench.first.torque_n_m != 0.0
    bench.first.pass_time(0.01)
    assert bench.first.torque_n_m == 0.0
    driver.close()
    with bench.driver(watchdog_ms=None) as without:
        assert without.info.host_silence_ms is None


def test_an_odrive_that_let_go_follows_again_only_when_it_is_enabled(bench: Lab) -> None:
    driver = pressing(bench)
    nothing_heard(bench)
    ticks_until(bench, driver, DeviceFaultError, "watchdog")
    driver.disable()
    driver._state_wait_s = PATIENCE_S
    for _ in range(10):
        driver.read()
    assert bench.first.torque_n_m == 0.0
    driver.enable()
    for _ in range(3):
        driver.read()
        driver.write([PUSH_N, 0.0])
    bench.bench.settle(driver)
    assert bench.first.torque_n_m == pytest.approx(PUSH_N * RADIUS_M)
    driver.close()


def test_frames_that_are_damaged_or_of_others_are_counted_and_never_believed(
    bench: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver = pressing(bench)
    dice = random.Random(1)
    end = bench.bench.end

    def spoil(frames: Frames) -> Frames:
        spoilt: Frames = []
        for identifier, data in frames:
            kind = dice.randrange(6)
            if kind == 0:
                spoilt.append((0x7E1, data))  # of node 63, which is none of ours
            elif kind == 1:
                spoilt.append((identifier, data[: dice.randrange(8)]))
            elif kind == 2:
                end.send_raw(b"t00x8zz\r" if bench.channel.startswith("/") else b"\x01\x02")
            else:
                spoilt.append((identifier, data))
        return spoilt

    monkeypatch.setattr(odrive_crew, "HEARTBEAT_S", PATIENCE_S)  # they are spoilt as well
    driver._state_wait_s = 0.004
    bench.bench.spoil = spoil
    for _ in range(200):
        sample = driver.read()
        assert all(abs(position_m) < 0.06 for position_m in sample.position_m)
        driver.write([PUSH_N, -PUSH_N])
    bench.bench.spoil = list
    assert driver.metrics[DAMAGED] > 10
    assert driver.metrics[UNKNOWN] > 10
    assert driver.metrics[TICKS_WITHOUT_STATE] >= 0
    driver._state_wait_s = PATIENCE_S
    before = driver.read().sequence
    driver.write([0.0, 0.0])
    assert driver.read().sequence > before
    driver.close()


def test_a_place_that_cannot_be_is_no_place(bench: Lab) -> None:
    driver = pressing(bench)
    bench.first.turns = float("nan")
    ticks_until(bench, driver, DeviceProtocolError, "check its encoder")
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
