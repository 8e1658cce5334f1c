"""Which device is opened, what each type declares, and what is said when none can be."""

from __future__ import annotations

import os
from contextlib import nullcontext
from pathlib import Path

import pytest

from hapticd.driver import DriverState
from hapticd.errors import ConfigError, DeviceBusyError, DeviceNotFoundError, DriverStateError, PluginError
from hapticd_drivers.forcedimension.driver import ForceDimension
from hapticd_drivers.forcedimension.models import MODELS
from tests.drivers.forcedimension.bench import BRAKE, FORCE, RIGHT, Bench


def test_a_device_is_picked_by_its_serial_number_and_the_others_are_left(bench: Bench) -> None:
    bench.set(-1, count=3)
    driver = bench.driver(serial=1003)
    assert driver.open().serial == "1003"
    assert [bench.get("holder", device) for device in range(3)] == [0, 0, os.getpid()]
    other = bench.driver()
    assert other.open().serial == "1001"
    third = bench.driver(serial=1003)
    with pytest.raises(DeviceBusyError, match=r"omega\.7 1001 is already open in this process"):
        third.open()
    with pytest.raises(DeviceBusyError):
        bench.driver(serial=1003).open()
    assert bench.get("holder", 2) == os.getpid()  # opening again what this process has must not close it
    driver.read()
    driver.close()
    other.close()
    with pytest.raises(
        DeviceNotFoundError, match=r"serial number 7; there is omega\.7 1001, omega\.7 1002, omega\.7 1003"
    ):
        bench.driver(serial=7).open()


def test_the_first_device_that_can_be_used_is_taken(bench: Bench) -> None:
    bench.set(-1, count=3)
    bench.set(0, type=206)
    bench.set(1, holder=1)  # process 1 is alive
    driver = bench.driver()
    assert driver.open().serial == "1003"
    driver.close()


@pytest.mark.parametrize("device_type", [102, 103, 110, 111, 131, 132, 203, 206, 209, 1000])
@pytest.mark.parametrize(("wrist", "gripper"), [(0, 0), (1, 0), (1, 1)])
def test_a_type_that_is_not_known_is_driven_once_the_user_says_what_it_bears(
    bench: Bench, device_type: int, wrist: int, gripper: int
) -> None:
    bench.set(type=device_type, wrist=wrist, gripper=gripper)
    (found,) = ForceDimension.find(bench.driver().options)
    assert found.problem == ""
    assert "set device.options.max_force_n" in found.note
    with pytest.raises(ConfigError, match=rf"max_force_n is not set: .* fake haptic device of type {device_type} 1001"):
        bench.driver().open()
    driver = bench.driver(max_force_n=6.0)
    info = driver.open()
    assert info.model.removesuffix(", left-handed") == f"fake haptic device of type {device_type}"
    assert info.max_force_n == 6.0
    assert (info.has_orientation, info.has_gripper) == (bool(wrist), bool(gripper))
    driver.enable()
    driver.read()
    driver.write([0.0, 0.0, 5.0])
    assert bench.vector("force_n") == [0.0, 0.0, 5.0]
    driver.close()


def test_a_known_device_goes_before_one_that_is_not_only_where_no_force_is_named(bench: Bench) -> None:
    bench.set(-1, count=2)
    bench.set(0, type=206)
    driver = bench.driver()
    assert driver.open().serial == "1002"
    driver.close()
    driver = bench.driver(max_force_n=6.0)
    assert driver.open().serial == "1001"
    driver.close()
    bench.set(-1, no_strings=1)
    assert ForceDimension.find(bench.driver().options)[0].model == "device of type 206"


def test_a_falcon_takes_forces_without_a_calibration_and_has_no_watchdog(bench: Bench) -> None:
    bench.set(type=60, calibrated=0, motor_n=8)
    (found,) = ForceDimension.find(bench.driver().options)
    assert (found.model, found.problem) == ("Novint Falcon", "")
    assert "device.accept_no_watchdog = true" in found.note
    driver = bench.driver()
    info = driver.open()
    assert (info.model, info.max_force_n, info.host_silence_ms, info.buttons) == ("Novint Falcon", 8.0, None, 4)
    assert driver.read().calibrated
    driver.enable()
    driver.write([0.0, 8.0, 0.0])
    assert bench.vector("force_n") == [0.0, 8.0, 0.0]
    driver.disable()
    assert bench.vector("force_n") == [0.0, 0.0, 0.0]
    with pytest.raises(DriverStateError, match="cannot calibrate itself"):
        driver.calibrate()
    driver.close()
    assert bench.get("moves") == 0


def test_a_device_of_another_process_is_busy(bench: Bench) -> None:
    bench.set(holder=1)
    with pytest.raises(DeviceBusyError, match=r"another program has the device \(.*device already in use"):
        bench.driver().open()


def test_every_type_has_limits_of_its_own(bench: Bench) -> None:
    seen = {}
    for device_type in MODELS:
        bench.set(type=device_type)
        driver = bench.driver()
        info = driver.open()
        seen[info.model] = (info.max_force_n, info.has_orientation, info.has_gripper)
        driver.close()
    assert seen["omega.3"] == (12.0, False, False)
    assert seen["omega.6, left-handed"] == (12.0, True, False)
    assert seen["omega.7"] == (12.0, True, True)
    assert seen["delta.3"] == (20.0, False, False)
    assert seen["sigma.7"] == (12.0, True, True)
    assert "lambda.7, left-handed" in seen


def test_safe_damping_falls_with_the_rate() -> None:
    model = MODELS[RIGHT]
    assert model.safe_damping_n_s_per_m(1e-3) == 30.0
    assert model.safe_damping_n_s_per_m(1e-2) == pytest.approx(5.0)


def test_an_sdk_that_is_too_old_is_refused(bench: Bench) -> None:
    bench.set(-1, minor=13)
    with pytest.raises(PluginError, match=r"is SDK 3\.13\.5\.0; hapticd needs 3\.14 or newer"):
        bench.driver().open()


def test_without_the_sdk_the_driver_says_how_to_get_it(tmp_path: Path) -> None:
    driver = ForceDimension(ForceDimension.Options.model_validate({"library": str(tmp_path)}), 1e-3)
    with pytest.raises(PluginError, match=r"SDK cannot be loaded \(.*no libdrd\.so in it\): install it and set FDSDK"):
        driver.open()
    assert driver.state is DriverState.CLOSED
    (diagnosis,) = ForceDimension.diagnose(driver.options)
    assert (diagnosis.mark, "cannot be loaded" in diagnosis.text) == ("problem", True)
    assert "forcedimension.com" in diagnosis.mend[0]


@pytest.mark.parametrize("options", [{}, {"max_force_n": 99.0}])
def test_forces_that_a_dead_program_left_on_are_off_once_the_device_is_opened_even_with_bad_options(
    bench: Bench, options: dict[str, float]
) -> None:
    left = bench.driver()
    left.open()
    left.enable()
    left.write([0.0, 0.0, 3.0])
    bench.die()
    assert bench.get("mode") == FORCE
    driver = bench.driver(**options)
    with pytest.raises(ConfigError) if options else nullcontext():
        driver.open()
    assert bench.get("mode") == BRAKE
    assert bench.vector("force_n") == [0.0, 0.0, 0.0]
    driver.close()
