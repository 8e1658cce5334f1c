"""The serial rig's driver with the firmware's protocol core at the other end of a pty."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Protocol

import pytest

from hapticd.driver import DriverState
from hapticd.errors import (
    ConfigError,
    DeviceBusyError,
    DeviceDisconnectedError,
    DeviceFaultError,
    DeviceNotFoundError,
    DeviceTimeoutError,
    DriverError,
    DriverStateError,
)
from hapticd_drivers.rig import conversation
from hapticd_drivers.rig.metrics import METRICS
from hapticd_drivers.rig.serial_rig import SerialRig, SerialRigOptions
from tests.drivers.rig.device import COUNT_M, HALF_TRAVEL_M, Rig, Spoiler

PERIOD_S = 0.001


class MakeDriver(Protocol):
    """Make a driver for the rig with these options."""

    def __call__(self, **options: object) -> SerialRig: ...


@pytest.fixture
def make_driver(rig: Rig) -> Iterator[MakeDriver]:
    """Drivers that are closed in the end."""
    with ExitStack() as closing:

        def make(**options: object) -> SerialRig:
            made = SerialRig(SerialRigOptions.model_validate({"port": str(rig.port), **options}), PERIOD_S)
            closing.callback(made.close)
            return made

        yield make


@pytest.fixture
def driver(rig: Rig, make_driver: MakeDriver) -> SerialRig:
    """A driver whose rig knows its home already, and whose sign was checked."""
    rig.set_home()
    return make_driver(sign_checked=True)


@pytest.fixture
def pushing(rig: Rig, driver: SerialRig) -> SerialRig:
    """The same, pushing the handle with 1 N."""
    driver.open()
    driver.enable()
    tick(rig, driver, 1.0)
    assert rig.force_n == 1.0
    return driver


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


def test_a_rig_that_does_not_know_where_it_is_takes_no_force(make_driver: MakeDriver) -> None:
    driver = make_driver(sign_checked=True)
    driver.open()
    with pytest.raises(DriverStateError, match="hapticd calibrate"):
        driver.enable()
    low_m, high_m = driver.info.workspace_m[0]
    sample = driver.read()
    assert not sample.calibrated
    assert sample.position_m[0] == pytest.approx(0.5 * (low_m + high_m), abs=2 * COUNT_M)


def test_a_rig_whose_sign_nobody_has_checked_takes_no_force(rig: Rig, make_driver: MakeDriver) -> None:
    rig.set_home()
    driver = make_driver()
    driver.open()
    with pytest.raises(DriverStateError, match="pushes the right way"):
        driver.enable()
    assert not driver.read().calibrated


@pytest.mark.parametrize(
    ("homing", "zero_at_m"),
    [("low_stop", 0.0), ("high_stop", 0.0), ("low_switch", 0.5 * HALF_TRAVEL_M), ("high_switch", None), ("here", 0.01)],
)
def test_a_calibration_finds_home_and_the_rig_keeps_it(
    rig: Rig, homing: str, zero_at_m: float | None, make_driver: MakeDriver
) -> None:
    if homing == "high_switch":
        rig.plant.position_m = -0.04
        rig.switch_at_m = -HALF_TRAVEL_M
    driver = make_driver(axes=[{"homing": homing}], calibration_speed_m_per_s=0.1)
    driver.open()
    if zero_at_m is None:
        with pytest.raises(DeviceFaultError, match="does not close"):
            driver.calibrate()
    else:
        driver.calibrate()
        assert settle(rig, driver) == pytest.approx(rig.plant.position_m - zero_at_m, abs=2.5e-4)
        assert driver.read().calibrated
        driver.enable()
        assert driver.state is DriverState.ENABLED
        driver.disable()
        driver.close()
        again = make_driver(sign_checked=True)
        again.open()
        again.enable()
        assert tick(rig, again) == pytest.approx(rig.plant.position_m - zero_at_m, abs=3e-4)


class Witness:
    """Remembers the largest force and the farthest way of a rig."""

    def __init__(self, rig: Rig) -> None:
        self.most_n = 0.0
        self.start_m = rig.plant.position_m
        self.farthest_m = 0.0
        advance = rig.plant.advance

        def watched(motor_n: float, dt_s: float) -> None:
            self.most_n = max(self.most_n, abs(motor_n))
            advance(motor_n, dt_s)
            self.farthest_m = max(self.farthest_m, abs(rig.plant.position_m - self.start_m))

        rig.plant.advance = watched  # type: ignore[method-assign]  # only looks on


@pytest.mark.parametrize(
    ("spoilt", "says"),
    [
        ({"motor": -1.0}, "motor_reversed"),
        ({"motor": 0.0}, "is its supply on"),
        ({"friction_n": 2.0}, "more than the friction"),
        ({"hand_n": 0.3}, "let go of it"),
    ],
)
def test_what_is_wrong_with_a_motor_shows_at_harmless_force(
    rig: Rig, spoilt: dict[str, float], says: str, make_driver: MakeDriver
) -> None:
    """A reversed motor moves the handle by half a millimetre and what it rolls on, at half a newton at most."""
    for name, value in spoilt.items():
        setattr(rig.plant, name, value)
    witness = Witness(rig)
    driver = make_driver(calibration_speed_m_per_s=0.1)
    driver.open()
    with pytest.raises(DeviceFaultError, match=says):
        driver.calibrate()
    assert rig.force_n == 0.0
    assert witness.most_n <= 0.5
    assert witness.farthest_m < 2e-3 or "hand_n" in spoilt
    with pytest.raises(DriverStateError):
        driver.enable()


def test_a_reversed_motor_that_is_declared_passes_and_pushes_the_right_way(rig: Rig, make_driver: MakeDriver) -> None:
    rig.plant.motor = -1.0
    driver = make_driver(axes=[{"homing": "here", "motor_reversed": True}])
    driver.open()
    driver.calibrate()
    driver.enable()
    before_m = tick(rig, driver)
    for _ in range(50):
        after_m = tick(rig, driver, 0.5)
    assert after_m > before_m + 1e-3


def test_a_reversed_axis_turns_position_and_force(rig: Rig, make_driver: MakeDriver) -> None:
    rig.set_home()
    driver = make_driver(sign_checked=True, axes=[{"reversed": True}])
    driver.open()
    driver.enable()
    before_m, truly_before_m = tick(rig, driver), rig.plant.position_m
    for _ in range(50):
        after_m = tick(rig, driver, 0.5)
    assert after_m - before_m == pytest.approx(truly_before_m - rig.plant.position_m, rel=0.2)
    assert after_m > before_m + 1e-3
    assert rig.force_n == -0.5


def test_the_force_constant_is_measured_at_the_handle(rig: Rig, make_driver: MakeDriver) -> None:
    rig.set_home()
    driver = make_driver(sign_checked=True, axes=[{"force_scale": 1.25}])
    assert driver.open().max_force_n == 6.25
    driver.enable()
    tick(rig, driver, 2.5)
    assert rig.force_n == 2.0


def test_a_calibration_that_is_called_off_leaves_no_force(rig: Rig, make_driver: MakeDriver) -> None:
    driver = make_driver(axes=[{"homing": "low_stop"}], calibration_speed_m_per_s=0.005)
    driver.open()
    ended: list[BaseException] = []

    def calibrate() -> None:
        try:
            driver.calibrate()
        except DriverError as error:
            ended.append(error)

    thread = threading.Thread(target=calibrate)
    thread.start()
    while rig.force_n == 0.0:
        driver.read()  # the loop goes on
        time.sleep(PERIOD_S)
    driver.close()
    thread.join(30.0)
    assert "called off" in str(ended[0])
    assert rig.force_n == 0.0


def test_positions_go_on_while_it_is_calibrated(make_driver: MakeDriver) -> None:
    driver = make_driver(axes=[{"homing": "here"}])
    driver.open()
    thread = threading.Thread(target=driver.calibrate)
    seen = {driver.read().position_m[0]}
    thread.start()
    while thread.is_alive():
        seen.add(driver.read().position_m[0])
        time.sleep(PERIOD_S)
    assert len(seen) > 20


def test_when_the_host_is_silent_the_rig_drops_its_force_and_wants_to_be_enabled_anew(
    rig: Rig, pushing: SerialRig
) -> None:
    rig.pass_time(int(1e3 * (pushing.info.host_silence_ms or 0.0)) + 1000)
    assert rig.force_n == 0.0
    tick(rig, pushing, 1.0)
    with pytest.raises(DeviceFaultError, match="watchdog heard no command for 20 ms"):
        ticks(rig, pushing, 1.0)
    assert rig.force_n == 0.0
    pushing.disable()
    pushing.enable()
    tick(rig, pushing, 1.0)
    assert rig.force_n == 1.0


def test_a_fault_of_the_rig_is_told_and_lasts_as_long_as_its_cause(rig: Rig, pushing: SerialRig) -> None:
    rig.break_down(2, 0, 512)
    assert rig.force_n == 0.0
    with pytest.raises(DeviceFaultError, match=r"over-current.*axis 0, detail 512"):
        ticks(rig, pushing, 1.0)
    pushing.disable()
    with pytest.raises(DeviceFaultError, match="over-current"):
        pushing.enable()
    rig.mend()
    pushing.enable()
    tick(rig, pushing, 1.0)
    assert rig.force_n == 1.0


def test_a_rig_that_has_lost_counts_has_to_be_calibrated_anew(rig: Rig, driver: SerialRig) -> None:
    driver.open()
    assert driver.read().calibrated
    rig.break_down(1, 0, 0)
    rig.mend()
    settle(rig, driver)
    assert not driver.read().calibrated
    with pytest.raises(DriverStateError, match="calibrate"):
        driver.enable()


def test_a_rig_that_restarts_is_a_lost_one_and_has_to_be_calibrated_anew(rig: Rig, pushing: SerialRig) -> None:
    rig.restart()
    with pytest.raises(DeviceDisconnectedError, match="has restarted"):
        ticks(rig, pushing, 1.0)
    pushing.close()
    pushing.open()
    with pytest.raises(DriverStateError, match="calibrate"):
        pushing.enable()


def test_an_unplugged_rig_is_lost_and_found_again(rig: Rig, pushing: SerialRig) -> None:
    rig.unplug()
    with pytest.raises(DeviceDisconnectedError, match="unplugged"):
        tick(rig, pushing, 1.0)
    pushing.close()
    with pytest.raises(DeviceNotFoundError, match="is the rig plugged in"):
        pushing.open()
    rig.plug()
    rig.set_home()
    pushing.open()
    pushing.enable()
    tick(rig, pushing, 1.0)
    assert rig.force_n == 1.0


def test_a_rig_that_says_nothing_any_more_is_lost_after_half_a_second_of_ticks(rig: Rig, driver: SerialRig) -> None:
    driver.open()
    driver.enable()
    tick(rig, driver)
    settle(rig, driver)
    rig.up = lambda data: b""
    ticks(rig, driver, count=490)
    with pytest.raises(DeviceTimeoutError, match="without power"):
        ticks(rig, driver, count=20)
    assert metric(driver, "ticks_without_state") >= 490.0
    rig.up = bytes


def test_a_rig_that_is_behind_is_not_flooded_and_is_heard_again_when_it_has_caught_up(
    rig: Rig, driver: SerialRig
) -> None:
    driver.open()
    settle(rig, driver)
    rig.up = lambda data: b""
    talk = driver._opened()
    before = talk._sequence
    for _ in range(320):
        driver.read()
    assert (talk._sequence - before) & 0xFFFF <= 32 + 320 // 32 + 1
    rig.up = bytes
    before = driver.read().sequence
    for _ in range(33):
        settle(rig, driver)
    assert driver.read().sequence > before


def test_opening_takes_the_force_away_that_another_host_has_left(
    rig: Rig, pushing: SerialRig, make_driver: MakeDriver
) -> None:
    pushing._opened().link.close()  # that host has died
    helper = make_driver()
    helper.open()
    assert rig.force_n == 0.0


def test_a_port_is_for_one_program(rig: Rig, driver: SerialRig, make_driver: MakeDriver) -> None:
    driver.open()
    other = make_driver()
    with pytest.raises(DeviceBusyError, match="another program"):
        other.open()
    driver.close()
    other.open()


def test_what_is_no_rig_is_told_so(rig: Rig, monkeypatch: pytest.MonkeyPatch, make_driver: MakeDriver) -> None:
    monkeypatch.setattr(conversation, "HELLO_PATIENCE_S", 0.3)
    rig.up = lambda data: b"login: \r\n" if data else b""
    with pytest.raises(DeviceTimeoutError, match="answers as a rig does"):
        make_driver().open()


def test_a_port_that_is_no_serial_port_is_told_so(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(DeviceNotFoundError, match="cannot be opened"):
        SerialRig(SerialRigOptions(port=str(file)), PERIOD_S).open()


def test_a_board_that_is_still_in_its_boot_loader_is_waited_for(rig: Rig, make_driver: MakeDriver) -> None:
    """It hears nothing at first, and then has half a frame of ours in its buffer."""
    heard = []

    def deaf_at_first(data: bytes) -> bytes:
        heard.append(data)
        return b"" if len(heard) < 4 else data[2:] if len(heard) == 4 else data

    rig.down = deaf_at_first
    driver = make_driver()
    assert driver.open().model == "host-rig"


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"baud": 115200}, r"device.options.baud = 115200: .* at least 260000 baud"),
        ({"max_force_n": 6.0}, "at most 5 N"),
        ({"axes": [{}, {}]}, "2 tables, and this rig has 1 axes"),
        ({"axes": [{"lowest_m": 0.06}]}, r"axes\[0\].lowest_m = 0.06: must be below"),
    ],
)
def test_what_does_not_fit_the_rig_is_refused_by_its_key(
    options: dict[str, object], says: str, make_driver: MakeDriver
) -> None:
    with pytest.raises(ConfigError, match=says):
        make_driver(**options).open()


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
