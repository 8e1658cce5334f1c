"""A calibration tries the watchdog, checks the sign and finds home."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hapticd.errors import DeviceFaultError, DeviceTimeoutError, DriverStateError
from hapticd_drivers.motors import crew, mover
from hapticd_drivers.motors.driver import MotorDriver
from hapticd_drivers.odrive import crew as odrive_crew
from hapticd_drivers.rig import motion
from tests.drivers.motors.bench import PATIENCE_S
from tests.drivers.motors.lab import RADIUS_M
from tests.drivers.odrive.controller import OdriveController
from tests.drivers.odrive.lab import Lab, axes

BOUND_N = 0.5


@pytest.fixture(params=[1])
def bench(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    monkeypatch.setattr(crew, "URGENT_PATIENCE_S", PATIENCE_S)
    monkeypatch.setattr(mover, "RESTARTED_S", 0.5)
    monkeypatch.setattr(odrive_crew, "LOOKED_S", PATIENCE_S)
    monkeypatch.setattr(odrive_crew, "OBEYS_S", PATIENCE_S)
    monkeypatch.setattr(odrive_crew, "HEARTBEAT_S", PATIENCE_S)
    with Lab("slcan", tmp_path, request.param, monkeypatch) as made:
        made.first.shaft.x_m = -0.035
        for one in made.controllers:
            assert isinstance(one, OdriveController)
            one.watchdog_s = 0.2
        made.bench.idle_passes = True
        yield made


def test_it_tries_the_watchdog_and_finds_the_stop(bench: Lab) -> None:
    driver = bench.driver(
        axes=axes(1),
        sign_checked=False,
        watchdog_ms=200.0,
        calibration_speed_m_per_s=0.1,
        calibration_force_n=BOUND_N,
    )
    driver.open()
    with pytest.raises(DriverStateError, match="hapticd calibrate"):
        driver.enable()
    driver.calibrate()
    assert bench.first.peak_n_m <= BOUND_N * RADIUS_M * 1.001
    assert bench.first.torque_n_m == 0.0
    driver._state_wait_s = PATIENCE_S
    assert driver.read().calibrated
    assert driver.read().position_m[0] == pytest.approx(bench.first.shaft.x_m, abs=3e-4)
    driver.enable()
    driver.disable()
    lose_power(bench, driver)
    assert not driver.read().calibrated
    with pytest.raises(DriverStateError, match="not known where the handle is"):
        driver.enable()
    driver.close()
    with bench.driver(axes=axes(1)) as again, pytest.raises(DriverStateError, match="not known where the handle is"):
        again.enable()  # another start of the daemon: it has to be calibrated anew


def test_it_pushes_with_nothing_before_the_odrive_follows(bench: Lab) -> None:
    """What it had come to until then came in one step, or the motor was said not to move the handle."""
    bench.first.preparing = 300
    driver = bench.driver(
        axes=axes(1),
        sign_checked=False,
        watchdog_ms=200.0,
        calibration_speed_m_per_s=0.1,
        calibration_force_n=BOUND_N,
    )
    asked_n_m = bench.asked_before_it_follows()
    driver.open()
    driver.calibrate()
    assert not any(asked_n_m)
    assert len(asked_n_m) > 300
    driver.close()


def lose_power(bench: Lab, driver: MotorDriver[Any]) -> None:
    """For a tenth of a second, in ticks that are not armed; then it counts from where its shaft is."""
    bench.first.deaf = True
    bench.first.restart()
    bench.first.turns = 0.0
    bench.bench.settle(driver)
    driver.read()
    driver._state_wait_s = 0.0
    for _ in range(100):
        driver.read()
    driver._state_wait_s = PATIENCE_S
    bench.first.deaf = False


@pytest.mark.parametrize("bench", [2], indirect=True)
def test_a_calibration_in_which_an_odrive_falls_silent_does_not_pass(
    bench: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has its home already while the other axis moves, and counts from elsewhere when it is heard again."""
    found, last = axes(2)
    driver = bench.driver(axes=[{**found, "homing": "here"}, {**last, "homing": "absolute"}], watchdog_ms=200.0)
    driver.open()
    check_sign, await_states = motion.check_sign, driver._opened().await_states

    def lose_power(drive: motion.Drive) -> None:
        with bench.bench.lock:
            bench.first.deaf = drive.axis == 1
        check_sign(drive)

    def come_back(timeout_s: float) -> bool:
        fresh = await_states(timeout_s)
        if not fresh and bench.first.deaf:
            with bench.bench.lock:
                bench.first.restart()
                bench.first.turns = 0.0
                bench.first.deaf = False
        return fresh

    monkeypatch.setattr(motion, "check_sign", lose_power)
    monkeypatch.setattr(driver._opened(), "await_states", come_back)
    with pytest.raises(DeviceTimeoutError, match="during the calibration"):
        driver.calibrate()
    assert not bench.first.deaf
    for one in bench.controllers:
        assert one.torque_n_m == 0.0
    with pytest.raises(DriverStateError, match="not known where the handle is"):
        driver.enable()
    driver.close()


def test_an_odrive_without_the_watchdog_that_is_declared_does_not_pass(bench: Lab) -> None:
    bench.first.watchdog_s = 0.0
    driver = bench.driver(sign_checked=False)
    driver.open()
    with pytest.raises(DeviceFaultError, match="enable_watchdog = True"):
        driver.calibrate()
    assert bench.first.torque_n_m == 0.0
    assert bench.first.peak_n_m == 0.0
    driver.close()


def test_a_watchdog_that_a_calibration_has_disproved_is_believed_no_more(bench: Lab) -> None:
    """Home and sign are known without one: it armed all the same, and kept its force when the computer fell silent."""
    bench.first.watchdog_s = 0.0
    driver = bench.driver(watchdog_ms=200.0)
    driver.open()
    with pytest.raises(DeviceFaultError, match="enable_watchdog = True"):
        driver.calibrate()
    with pytest.raises(DriverStateError, match=r"enable_watchdog = True.*`hapticd calibrate`"):
        driver.enable()
    bench.first.watchdog_s = 0.2
    driver.calibrate()
    driver.enable()
    driver.close()


def test_a_motor_that_pushes_the_wrong_way_is_refused(bench: Lab) -> None:
    bench.first.shaft.motor = -1.0
    driver = bench.driver(sign_checked=False, watchdog_ms=200.0)
    driver.open()
    with pytest.raises(DeviceFaultError, match="motor_reversed"):
        driver.calibrate()
    assert bench.first.torque_n_m == 0.0
    driver.close()
