"""A calibration moves the handle gently, finds its home, and refuses a motor that pushes the wrong way."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hapticd.errors import DeviceFaultError, DeviceProtocolError, DriverStateError
from hapticd_drivers.motors import crew
from hapticd_drivers.rig import motion
from tests.drivers.moteus.controller import COUNTS_PER_TURN
from tests.drivers.moteus.lab import Lab, axes
from tests.drivers.motors.bench import PATIENCE_S
from tests.drivers.motors.lab import RADIUS_M
from tests.drivers.motors.shaft_clock import move_by_the_shaft
from tests.drivers.motors.wire import Frames

BOUND_N = 0.5


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    monkeypatch.setattr(crew, "URGENT_PATIENCE_S", PATIENCE_S)
    with Lab("fdcanusb", tmp_path, 1, monkeypatch) as made:
        made.first.shaft.x_m = -0.035
        move_by_the_shaft(made.first.shaft, monkeypatch)
        yield made


def opened(bench: Lab, **keys: Any) -> Any:
    driver = bench.driver(
        axes=axes(1, **keys), sign_checked=False, calibration_speed_m_per_s=0.1, calibration_force_n=BOUND_N
    )
    driver._state_wait_s = PATIENCE_S  # a busy computer is no fault
    driver.open()
    return driver


def test_it_finds_the_stop_and_the_controllers_remember_home(bench: Lab) -> None:
    driver = opened(bench)
    assert not driver.read().calibrated
    with pytest.raises(DriverStateError, match="hapticd calibrate"):
        driver.enable()
    bench.first.peak_n_m = 0.0
    driver.calibrate()
    assert bench.first.peak_n_m <= BOUND_N * RADIUS_M * 1.001
    assert bench.first.torque_n_m == 0.0
    assert driver.read().calibrated
    assert driver.read().position_m[0] == pytest.approx(bench.first.shaft.x_m, abs=2e-4)
    driver.enable()
    driver.close()
    again = bench.driver(axes=axes(1))
    again._state_wait_s = PATIENCE_S
    again.open()  # another start of the daemon
    assert again.read().calibrated
    assert again.read().position_m[0] == pytest.approx(bench.first.shaft.x_m, abs=2e-4)
    bench.first.restart()
    for _ in range(3):
        again.read()
    assert not again.read().calibrated
    with pytest.raises(DriverStateError, match="not known where the handle is"):
        again.enable()
    again.close()


@pytest.mark.parametrize("before", ["low_stop", "high_stop", "here"])
@pytest.mark.parametrize("after", ["low_stop", "high_stop", "here"])
def test_a_home_that_is_remembered_means_the_same_when_it_would_be_found_otherwise(
    bench: Lab, before: str, after: str
) -> None:
    home_m = bench.first.shaft.x_m if before == "here" else 0.02
    with opened(bench, homing=before, home_m=home_m) as driver:
        driver.calibrate()
        # What is home "here" is where the handle rests after it was nudged both ways.
        beside_m = driver.read().position_m[0] - bench.first.shaft.x_m if before == "here" else 0.0
        assert abs(beside_m) < 5e-3
    with bench.driver(axes=axes(1, homing=after, home_m=home_m)) as again:
        again._state_wait_s = PATIENCE_S
        sample = again.read()
        assert sample.calibrated
        assert sample.position_m[0] == pytest.approx(bench.first.shaft.x_m + beside_m, abs=2e-4)


def lose_homes(bench: Lab, monkeypatch: pytest.MonkeyPatch, most: int) -> list[bytes]:
    """Lose this many of the frames that tell the controller its home; those that were lost so far."""
    hear, lost = bench.first.hear, list[bytes]()

    def hear_others(identifier: int, data: bytes) -> Frames:
        if b"\x0d\xb1\x02" in data and len(lost) < most:  # SET_OUTPUT_EXACT
            lost.append(data)
            return []
        answers: Frames = hear(identifier, data)
        return answers

    monkeypatch.setattr(bench.first, "hear", hear_others)
    return lost


def test_a_home_that_was_lost_on_the_way_is_told_again(bench: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    """That it has a home the controller says all the time: it has an older one."""
    bench.first.home_state = 2
    with bench.driver(axes=axes(1)) as driver:
        motors = driver._opened()
        lost = lose_homes(bench, monkeypatch, 1)
        assert abs(motors.motors[0].turns) > 0.1
        motors.set_home([motors.motors[0].turns])
        assert len(lost) == 1
        assert motors.motors[0].turns == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("part_of_a_count", [0.0, 0.3, 0.7])
def test_a_home_that_is_where_it_was_is_taken(bench: Lab, part_of_a_count: float) -> None:
    """As in a second calibration; places come in whole counts of the encoder."""
    bench.first.shaft.x_m = (-9000 + part_of_a_count) / COUNTS_PER_TURN * 2.0 * math.pi * RADIUS_M
    with bench.driver(axes=axes(1)) as driver:
        motors = driver._opened()
        for _ in range(3):
            motors.set_home([motors.motors[0].turns])
            assert motors.motors[0].turns == pytest.approx(0.0, abs=1.0 / COUNTS_PER_TURN)


def test_a_home_that_is_not_taken_leaves_none(bench: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    driver = opened(bench, homing="here")
    driver.calibrate()
    bench.first.shaft.x_m += 0.01  # else its home could be where it was, which is no other
    monkeypatch.setattr(crew, "GREETING_PATIENCE_S", 0.3)
    lose_homes(bench, monkeypatch, 1000)
    with pytest.raises(DeviceProtocolError, match="has not taken its home"):
        driver.calibrate()
    with pytest.raises(DriverStateError, match="not known where the handle is"):
        driver.enable()
    driver.close()


def test_home_may_be_where_the_handle_is(bench: Lab) -> None:
    driver = opened(bench, homing="here", home_m=0.01, reversed=True)
    driver.calibrate()
    at_m = bench.first.shaft.x_m
    assert driver.read().position_m[0] == pytest.approx(0.01, abs=1e-5)
    bench.first.shaft.x_m += 0.005
    driver.read()
    assert driver.read().position_m[0] == pytest.approx(0.005, abs=2e-4), at_m  # positions grow the other way
    driver.close()


def test_a_motor_that_pushes_the_wrong_way_is_refused(bench: Lab) -> None:
    bench.first.shaft.motor = -1.0
    driver = opened(bench)
    with pytest.raises(DeviceFaultError, match="motor_reversed"):
        driver.calibrate()
    assert bench.first.torque_n_m == 0.0
    assert abs(bench.first.shaft.x_m + 0.035) < 5e-3
    with pytest.raises(DriverStateError):
        driver.enable()
    driver.close()


def test_a_controller_that_restarts_just_before_it_is_armed_is_refused(bench: Lab) -> None:
    """It counts from 50 mm away; its answer to the arming is the first to show that it was switched off and on."""
    driver = opened(bench)
    driver.calibrate()
    driver.enable()
    driver.disable()
    driver.read()
    with bench.bench.lock:
        bench.first.restart()
    with pytest.raises(DeviceFaultError, match="switched off and on"):
        driver.enable()
    assert bench.first.torque_n_m == 0.0
    for _ in range(3):
        driver.read()
    assert not driver.read().calibrated
    with pytest.raises(DriverStateError, match="not known where the handle is"):
        driver.enable()
    driver.close()


def test_a_calibration_in_which_a_controller_restarts_does_not_pass(
    bench: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver = opened(bench)
    find_stop = motion.find_stop

    def find(drive: motion.Drive, towards: float) -> int:
        at = find_stop(drive, towards)
        with bench.bench.lock:
            bench.first.restart()
        drive.push(0.0)
        return at

    monkeypatch.setattr(motion, "find_stop", find)
    with pytest.raises(DeviceFaultError, match="switched off and on"):
        driver.calibrate()
    assert bench.first.torque_n_m == 0.0
    driver.close()


@pytest.mark.parametrize("sign_checked", [False, True], ids=["it had passed before", "the options say so"])
def test_a_sign_that_a_calibration_has_disproved_is_believed_no_more(bench: Lab, sign_checked: bool) -> None:
    """With a reversed motor a wall pulls the hand in."""
    driver = bench.driver(axes=axes(1), sign_checked=sign_checked, calibration_speed_m_per_s=0.1)
    driver._state_wait_s = PATIENCE_S
    driver.open()
    driver.calibrate()
    driver.enable()
    driver.disable()
    bench.first.shaft.motor = -1.0
    with pytest.raises(DeviceFaultError, match="motor_reversed"):
        driver.calibrate()
    with pytest.raises(DriverStateError, match="not been checked that the motors push the right way"):
        driver.enable()
    assert not driver.read().calibrated
    bench.first.shaft.motor = 1.0
    driver.calibrate()
    driver.enable()
    driver.close()


def test_a_motor_without_supply_does_not_pass(bench: Lab) -> None:
    bench.first.shaft.motor = 0.0
    driver = opened(bench)
    with pytest.raises(DeviceFaultError, match="does not move the handle"):
        driver.calibrate()
    driver.close()


def test_it_ends_without_force_when_it_is_called_off(bench: Lab) -> None:
    driver = opened(bench)
    threading.Timer(0.5, driver.call_off).start()
    with pytest.raises(DriverStateError, match="called off"):
        driver.calibrate()
    assert bench.first.torque_n_m == 0.0
    driver.close()
