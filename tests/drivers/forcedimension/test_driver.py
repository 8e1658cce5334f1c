"""What the driver asks of the SDK, in which order, and what it makes of the answers."""

from __future__ import annotations

import math
import os
import threading
from typing import Any

import pytest

from hapticd.config.loading import parse
from hapticd.driver import DriverState
from hapticd.errors import (
    ConfigError,
    DeviceFaultError,
    DeviceNotFoundError,
    DeviceTimeoutError,
    DriverError,
    DriverStateError,
)
from hapticd.plugins import driver as installed
from hapticd.tick.assemble import make_tick
from hapticd.tick.event import EventCode
from hapticd_drivers.forcedimension.driver import STOP_ATTEMPTS, ForceDimension
from tests.drivers.forcedimension.bench import BRAKE, FORCE, IDLE, LEFT, RIGHT, WATCHDOG, Bench

VELOCITY = """
[device]
driver = "omega7"
[velocity]
estimator = "{estimator}"
[[scene.walls]]
stiffness_n_per_m = 2000.0
"""


def test_it_is_installed_as_omega7() -> None:
    assert installed("omega7") is ForceDimension


def test_forces_are_enabled_in_the_order_known_to_work_and_the_first_is_zero(bench: Bench) -> None:
    driver = bench.driver(gripper_button=True)
    driver.open()
    bench.clear_log()
    driver.enable()
    assert bench.log() == [
        "drdIsInitialized",
        "dhdSetMaxForce",
        "dhdSetBrakes",
        "dhdEnableExpertMode",
        "dhdSetWatchdog",
        "dhdGetWatchdog",
        "dhdDisableExpertMode",
        "dhdEnableForce",
        "dhdSetGravityCompensation",
        "dhdEmulateButton",
        "dhdSetForceAndTorqueAndGripperForce",
    ]
    assert bench.get("mode") == FORCE
    assert bench.get("max_force_n") == 12.0
    driver.close()
    assert bench.get("mode") == BRAKE
    assert bench.log()[-2:] == ["dhdStop", "drdClose"]


def test_a_tick_is_one_group_of_getters_and_one_force(bench: Bench) -> None:
    driver = bench.driver(status_every_ticks=3)
    driver.open()
    driver.enable()
    bench.clear_log()
    for _ in range(3):
        driver.read()
        driver.write([1.0, 0.0, 0.0])
    getters = ["dhdGetPosition", "dhdGetLinearVelocity", "dhdGetGripperGap"]
    force = ["dhdSetForceAndTorqueAndGripperForce"]
    first = [*getters, "dhdGetStatus", *force]  # since the driver was enabled: whether forces flow
    assert bench.log() == first + 2 * (getters + force)
    bench.clear_log()
    for _ in range(3):
        driver.read()
        driver.write([1.0, 0.0, 0.0])
    assert bench.log() == first + 2 * (getters + force)
    driver.close()


def test_opening_leaves_alone_what_nobody_asked_for(bench: Bench) -> None:
    driver = bench.driver()
    info = driver.open()
    asked = {name for name in bench.log() if "Set" in name or "Config" in name or "Enable" in name}
    assert asked == {"dhdEnableExpertMode"}
    assert not bench.expert()
    assert info.host_silence_ms == 10.0
    assert bench.get("watchdog") == 0
    assert bench.get("mode") == IDLE
    assert bench.get("moves") == 0
    driver.close()


def test_options_reach_the_device(bench: Bench) -> None:
    driver = bench.driver(
        base_tilt_deg=30.0,
        effector_mass_kg=0.2,
        gravity_compensation=False,
        max_force_n=7.0,
        velocity_window_ms=5,
        time_guard_us=50,
        watchdog_ms=20.1,
    )
    info = driver.open()
    driver.enable()
    names = ("angle_deg", "effector_kg", "gravity", "max_force_n", "window_ms", "guard_us", "watchdog")
    assert [bench.get(name) for name in names] == [30.0, 0.2, 0.0, 7.0, 5.0, 50.0, 161.0]
    assert (info.max_force_n, info.host_silence_ms) == (7.0, 20.125)
    with pytest.raises(DriverStateError):
        driver.write([0.0, 0.0, 7.1])
    driver.close()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"max_force_n": 12.5}, r"max_force_n = 12\.5: a omega\.7 takes at most 12 N"),
        ({"watchdog_ms": 1.5}, r"watchdog_ms = 1\.5: must be 0, or at least two ticks \(2 ms\)"),
    ],
)
def test_an_option_that_does_not_fit_is_refused_by_its_key(bench: Bench, options: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        bench.driver(**options).open()
    assert bench.get("holder") == 0


def test_a_slow_loop_gets_a_slow_watchdog(bench: Bench) -> None:
    driver = bench.driver(period_s=5e-3)
    assert driver.open().host_silence_ms == 20.0
    driver.close()


@pytest.mark.parametrize(("has_watchdog", "firmware"), [(0, 3.0), (1, 2.4)])
def test_a_device_without_a_watchdog_says_so(bench: Bench, has_watchdog: int, firmware: float) -> None:
    """The daemon then wants an explicit word from the user before it runs."""
    bench.set(has_watchdog=has_watchdog, firmware=firmware)
    driver = bench.driver()
    assert driver.open().host_silence_ms is None
    driver.close()
    off = bench.driver(watchdog_ms=0.0)
    assert off.open().host_silence_ms is None
    off.close()


def test_expert_mode_is_left_even_when_the_call_inside_it_fails(bench: Bench) -> None:
    bench.set(has_watchdog=0)
    driver = bench.driver()
    driver.open()
    assert not bench.expert()
    driver.close()


def test_nothing_moves_the_arm_but_calibrate(bench: Bench) -> None:
    bench.set(calibrated=0, auto_init_us=1000)
    driver = bench.driver()
    driver.open()
    with pytest.raises(DriverStateError, match="hapticd calibrate"):
        driver.enable()
    assert driver.state is DriverState.OPEN
    assert bench.get("moves") == 0
    bench.clear_log()
    driver.calibrate()
    watchdog = ["dhdEnableExpertMode", "dhdSetWatchdog", "dhdGetWatchdog", "dhdDisableExpertMode"]
    moving = ["drdAutoInit", "drdStop", "dhdStop", "drdIsInitialized"]
    assert bench.log() == ["drdIsSupported", *watchdog, *moving]
    assert (bench.get("moves"), bench.get("mode"), bench.get("regulating")) == (1, BRAKE, 0)
    driver.enable()
    assert driver.read().calibrated
    driver.close()
    assert bench.get("moves") == 1


def test_an_arm_that_was_put_into_its_pit_by_hand_is_seen_to_be_calibrated(bench: Bench) -> None:
    bench.set(calibrated=0)
    driver = bench.driver(status_every_ticks=3)
    driver.open()
    assert not driver.read().calibrated
    bench.set(calibrated=1)
    seen = [driver.read().calibrated for _ in range(6)]
    assert seen[-1]
    assert not seen[0]
    driver.enable()
    assert driver.read().calibrated
    driver.close()


def test_a_calibration_that_fails_leaves_no_force(bench: Bench) -> None:
    bench.set(calibrated=0, auto_init_fails=1)
    driver = bench.driver()
    driver.open()
    with pytest.raises(DeviceTimeoutError, match=r"drdAutoInit failed: timeout, error 7 \(TIMEOUT\)"):
        driver.calibrate()
    assert bench.get("mode") not in (FORCE, IDLE)
    driver.close()


def test_left_and_right_hands_open_the_gripper_the_same_way(bench: Bench) -> None:
    """Of the gap's sign on a left-handed device nothing is documented: either must read as an opening."""
    for device_type, negative in ((RIGHT, 0), (LEFT, 0), (LEFT, 1)):
        bench.set(type=device_type, left_gap_negative=negative, gripper_rad=0.3)
        driver = bench.driver()
        assert ("left" in driver.open().model) == (device_type == LEFT)
        assert driver.read().gripper_m == pytest.approx(0.015)
        driver.close()


def test_the_sample_carries_everything_that_the_device_senses(bench: Bench) -> None:
    bench.set(position_m=[0.01, -0.02, 0.03], turn_rad=0.5, gripper_rad=0.0)
    driver = bench.driver(gripper_button=True)
    info = driver.open()
    assert (info.buttons, info.has_gripper, info.has_orientation, info.axes) == (1, True, True, ("x", "y", "z"))
    driver.enable()
    sample = driver.read()
    assert sample.position_m == pytest.approx([0.01, -0.02, 0.03])
    cosine, sine = math.cos(0.5), math.sin(0.5)
    assert sample.orientation == pytest.approx([cosine, -sine, 0, sine, cosine, 0, 0, 0, 1])
    assert sample.buttons == 1
    bench.set(gripper_rad=0.2)
    assert driver.read().buttons == 0
    assert driver.read() is sample
    driver.close()


def test_velocity_is_zero_until_the_sdk_has_one_and_then_the_sdks(bench: Bench) -> None:
    bench.set(viscous_n_s_per_m=0, velocity_m_per_s=[0.1, 0.0, -0.2], resolution_m=0)
    driver = bench.driver()
    driver.open()
    assert driver.read().velocity_m_per_s == [0.0, 0.0, 0.0]
    assert driver.read().velocity_m_per_s == pytest.approx([0.1, 0.0, -0.2])
    driver.close()


def test_a_sample_that_the_time_guard_gave_again_is_a_success_and_does_not_count_as_new(bench: Bench) -> None:
    driver = bench.driver()
    driver.open()
    first = driver.read().sequence
    bench.set(-1, held=1)
    assert [driver.read().sequence for _ in range(3)] == [first] * 3
    assert driver.metrics[0] == 3.0
    bench.advance(200)
    assert driver.read().sequence == first + 1
    driver.close()


def test_a_force_that_the_motors_scale_down_is_a_success_and_is_counted(bench: Bench) -> None:
    bench.set(motor_n=5)
    driver = bench.driver()
    driver.open()
    driver.enable()
    driver.write([6.0, 0.0, 8.0])
    assert bench.vector("force_n") == pytest.approx([3.0, 0.0, 4.0])
    assert driver.metrics[1] == 1.0
    driver.write([0.0, 3.0, 0.0])
    assert driver.metrics[1] == 1.0
    driver.close()


def test_gravity_is_carried_from_the_first_force_on(bench: Bench) -> None:
    bench.set(weight_n=2.0)
    driver = bench.driver()
    driver.open()
    driver.read()
    driver.enable()
    for _ in range(50):
        driver.read()
        driver.write([0.0, 0.0, 0.0])
    assert abs(bench.get("position_m", index=2)) < 1e-6
    driver.close()


@pytest.mark.parametrize("fails", [1, STOP_ATTEMPTS - 1, 1000])
def test_disable_insists_and_then_finds_another_way(bench: Bench, fails: int) -> None:
    driver = bench.driver()
    driver.open()
    driver.enable()
    driver.write([1.0, 1.0, 1.0])
    bench.set(stop_fails=fails)
    driver.disable()
    assert bench.get("mode") != FORCE
    assert bench.vector("force_n") == [0.0, 0.0, 0.0]
    driver.close()


def test_an_sdk_without_words_still_gives_an_error_with_its_number(bench: Bench) -> None:
    bench.set(-1, no_strings=1)
    driver = bench.driver()
    driver.open()
    bench.set(present=0)
    with pytest.raises(DriverError, match=r"failed: error 2 \(COM\)"):
        driver.read()
    driver.close()


def test_the_error_is_the_one_of_the_thread_that_failed(bench: Bench) -> None:
    driver = bench.driver()
    driver.open()
    said: list[str] = []

    def fail() -> None:
        try:
            driver._opened().call("drdOpenID", 9)
        except DeviceNotFoundError as error:
            said.append(str(error))

    driver._opened().dhdSetWatchdog(1, 0)  # this thread's last error is another: expert mode is off
    thread = threading.Thread(target=fail)
    thread.start()
    thread.join()
    assert said == ["omega7: drdOpenID failed: invalid index, error 15 (INVALID_INDEX)"]
    assert bench.library.fake_last_error() == 9
    driver.close()


def test_a_device_that_never_takes_forces_is_a_fault_but_one_that_is_slow_to_say_so_is_not(bench: Bench) -> None:
    driver = bench.driver()

    def go_on() -> None:
        for _ in range(300):
            driver.read()
            driver.write([0.0, 0.0, 0.0])

    bench.set(status_lag=5)
    driver.open()
    driver.enable()
    go_on()
    driver.disable()
    bench.set(status_lag=1000)
    driver.enable()
    with pytest.raises(DeviceFaultError, match="lets no forces through: press the FORCE button on it, then arm again"):
        go_on()
    driver.close()


def test_it_says_that_forces_flow_with_the_first_sample_where_the_device_does(bench: Bench) -> None:
    bench.set(late_forces=15)
    driver = bench.driver()
    driver.open()
    driver.enable()
    flows = []
    for _ in range(30):
        driver.read()
        flows.append(driver.forces_flow)
        driver.write([0.0, 0.0, 1.0])
        assert not (flows[-1] and bench.get("force_n", index=2) == 0.0)
    assert flows == [tick >= 14 for tick in range(30)]
    driver.disable()
    driver.enable()
    assert not driver.forces_flow
    driver.close()


def test_with_its_force_button_off_the_device_says_which_button_to_press(bench: Bench) -> None:
    """No call fails while that button is off: only the status shows that forces never come on."""
    bench.set(button_off=1)
    driver = bench.driver()
    driver.open()
    driver.enable()

    def go_on() -> None:
        for _ in range(300):
            driver.read()
            driver.write([0.0, 0.0, 1.0])

    with pytest.raises(DeviceFaultError, match="press the FORCE button on it"):
        go_on()
    driver.disable()
    bench.press_force_button()
    driver.enable()
    go_on()
    assert bench.vector("force_n") == [0.0, 0.0, 1.0]
    driver.close()


def test_a_calibration_runs_without_the_watchdog_which_only_force_commands_feed(bench: Bench) -> None:
    bench.set(calibrated=0, auto_init_us=60_000)
    driver = bench.driver(watchdog_ms=10.0)
    driver.open()
    driver.calibrate()
    assert driver.read().calibrated
    driver.enable()
    assert bench.get("watchdog") == 80
    driver.close()
    bench.set(calibrated=0)
    again = bench.driver()  # a device whose watchdog is still set from before
    again.open()
    again.calibrate()
    again.close()


def test_reading_alone_does_not_feed_the_watchdog(bench: Bench) -> None:
    driver = bench.driver(status_every_ticks=1000)
    driver.open()
    driver.enable()
    driver.read()
    driver.write([0.0, 0.0, 1.0])
    for _ in range(12):
        driver.read()
    assert (bench.get("mode"), bench.get("cause")) == (BRAKE, WATCHDOG)
    driver.close()


def test_threads_of_the_sdk_are_not_bound_to_the_loops_processor(bench: Bench) -> None:
    everywhere = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(everywhere)})
    try:
        driver = bench.driver()
        driver.open()
        assert bench.get("processors") == len(everywhere)
        bench.set(calibrated=0, processors=0)
        driver.calibrate()
        assert bench.get("processors") == len(everywhere)
        assert os.sched_getaffinity(0) == {min(everywhere)}
        driver.close()
    finally:
        os.sched_setaffinity(0, everywhere)


def test_a_velocity_that_the_sdk_cannot_give_matters_only_to_the_estimator_that_uses_it(bench: Bench) -> None:
    driver = bench.driver()
    info = driver.open()
    ticks = {
        estimator: make_tick(parse(VELOCITY.format(estimator=estimator), "test"), info)
        for estimator in ("difference", "device")
    }
    for _ in range(5):
        sample = driver.read()
    for tick in ticks.values():
        tick.start(sample)
        tick.step(sample, 1e-3)
        assert tick.fault == 0
    bench.set(velocity_fails=8)
    sample = driver.read()
    assert driver.metrics[2] == 1.0
    ticks["difference"].step(sample, 1e-3)
    ticks["device"].step(sample, 1e-3)
    assert ticks["difference"].fault == 0
    assert ticks["device"].fault == EventCode.SAMPLE_IMPOSSIBLE
    driver.close()
