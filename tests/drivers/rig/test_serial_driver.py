"""The serial rig's driver with the firmware's protocol core at the other end of a pty."""

from __future__ import annotations

from pathlib import Path

import pytest

from hapticd.errors import (
    ConfigError,
    DeviceBusyError,
    DeviceDisconnectedError,
    DeviceFaultError,
    DeviceNotFoundError,
    DeviceTimeoutError,
    DriverStateError,
)
from hapticd_drivers.rig import conversation
from hapticd_drivers.rig.serial_rig import SerialRig, SerialRigOptions
from tests.drivers.rig.device import COUNT_M, Rig
from tests.drivers.rig.ticking import PERIOD_S, MakeDriver, metric, settle, tick, ticks


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
    with pytest.raises(DriverStateError, match="push the right way"):
        driver.enable()
    assert not driver.read().calibrated


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
    assert "unplugged" in pushing.force_left
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


def test_a_calibration_that_does_not_end_is_not_taken_for_a_force_that_is_gone(pushing: SerialRig) -> None:
    with pushing._lock:
        pushing.disable()
    assert pushing.force_left == "serial-rig: a calibration that was called off has not ended within 1 s"
    pushing.disable()
    assert pushing.force_left == ""
