"""A calibration moves the handle gently, finds its home, and refuses a motor that pushes the wrong way."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hapticd.errors import DeviceFaultError, DriverStateError
from hapticd_drivers.motors import crew
from tests.drivers.moteus.lab import Lab, axes
from tests.drivers.motors.bench import PATIENCE_S
from tests.drivers.motors.lab import RADIUS_M

BOUND_N = 0.5


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    monkeypatch.setattr(crew, "URGENT_PATIENCE_S", PATIENCE_S)
    with Lab("fdcanusb", tmp_path, 1, monkeypatch) as made:
        made.first.shaft.x_m = -0.035
        yield made


def opened(bench: Lab, **keys: Any) -> Any:
    driver = bench.driver(
        axes=axes(1, **keys), sign_checked=False, calibration_speed_m_per_s=0.1, calibration_force_n=BOUND_N
    )
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
