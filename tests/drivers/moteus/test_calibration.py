"""A calibration moves the handle gently, finds its home, and refuses a motor that pushes the wrong way."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hapticd.errors import ConfigError, DeviceFaultError, DeviceProtocolError, DriverStateError
from hapticd_drivers.moteus import crew as moteus_crew
from hapticd_drivers.motors import crew
from hapticd_drivers.motors.drum import Drum
from hapticd_drivers.motors.options import DrumOptions
from hapticd_drivers.rig import motion
from tests.drivers.moteus.controller import MoteusController
from tests.drivers.moteus.lab import Lab, axes
from tests.drivers.motors.bench import PATIENCE_S
from tests.drivers.motors.lab import RADIUS_M
from tests.drivers.motors.shaft_clock import move_by_the_shaft
from tests.drivers.motors.wire import Frames

BOUND_N = 0.5


def be_patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy computer is no fault."""
    monkeypatch.setattr(crew, "URGENT_PATIENCE_S", PATIENCE_S)
    monkeypatch.setattr(moteus_crew, "AT_ONCE_S", 0.25)


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    be_patient(monkeypatch)
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


def test_it_pushes_with_nothing_before_the_controller_follows(bench: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it had come to until then came in one step, or the motor was said not to move the handle."""
    monkeypatch.setattr(moteus_crew, "PREPARING_S", PATIENCE_S)
    driver = opened(bench)
    asked_n_m = bench.asked_before_it_follows()
    monkeypatch.setattr(moteus_crew.MoteusCrew, "prove_watchdog", lambda _crew: setattr(bench.first, "preparing", 300))
    driver.calibrate()
    assert not any(asked_n_m)
    assert len(asked_n_m) > 290
    driver.close()


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
    with bench.driver(axes=axes(1)) as driver:
        motors = driver._opened()
        (motor,) = motors.motors
        motors.set_home([motor.turns])
        lost = lose_homes(bench, monkeypatch, 1)
        motors.set_home([motor.turns])
        assert len(lost) == 1
        assert motor.turns == pytest.approx(motor.home_turns, abs=1e-4)


def test_a_home_that_is_where_it_was_is_taken(bench: Lab) -> None:
    """As in a second calibration."""
    with bench.driver(axes=axes(1)) as driver:
        motors = driver._opened()
        (motor,) = motors.motors
        for _ in range(3):
            motors.set_home([motor.turns])
            assert motor.turns == pytest.approx(motor.home_turns, abs=1e-4)


@pytest.mark.parametrize("obeyed", [False, True], ids=["it was not heard", "its answer was lost"])
def test_a_home_that_is_told_again_is_where_it_was_and_not_where_the_handle_is_by_then(
    bench: Lab, monkeypatch: pytest.MonkeyPatch, obeyed: bool
) -> None:
    hear, lost = bench.first.hear, list[float]()

    def hear_late(identifier: int, data: bytes) -> Frames:
        if lost or b"\x0d\xb1\x02" in data:
            lost.append(bench.first.shaft.x_m)
            if len(lost) <= 2:
                if obeyed:
                    hear(identifier, data)
                bench.first.shaft.x_m += 0.005
                return []
        answers: Frames = hear(identifier, data)
        return answers

    with opened(bench, homing="here") as driver:
        monkeypatch.setattr(bench.first, "hear", hear_late)
        driver.calibrate()
        driver.read()
        assert driver.read().position_m[0] == pytest.approx(bench.first.shaft.x_m - lost[0], abs=2e-4)


def test_a_controller_that_restarts_while_it_is_told_its_home_is_refused(
    bench: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It counts from elsewhere by then, and would take that for the old count."""
    hear, lost = bench.first.hear, list[bytes]()

    def restart(identifier: int, data: bytes) -> Frames:
        if b"\x0d\xb1\x02" in data and not lost:
            lost.append(data)
            bench.first.restart()
            return []
        answers: Frames = hear(identifier, data)
        return answers

    with opened(bench, homing="here") as driver:
        monkeypatch.setattr(bench.first, "hear", restart)
        with pytest.raises(DeviceFaultError, match="switched off and on"):
            driver.calibrate()
        with pytest.raises(DriverStateError, match="not known where the handle is"):
            driver.enable()


def test_a_home_that_a_controller_has_from_elsewhere_is_not_taken_for_one_that_it_was_told(bench: Lab) -> None:
    """Such as from motor_position.output.reference_source: it has that as soon as it is switched on."""
    bench.first.wakes_at_home = True
    bench.first.restart()
    with bench.driver(axes=axes(1, homing="here")) as driver:
        driver._state_wait_s = PATIENCE_S
        assert bench.first.home_state == 2
        assert not driver.read().calibrated
        with pytest.raises(DriverStateError, match="not known where the handle is"):
            driver.enable()
        driver.calibrate()
        driver.enable()
        driver.disable()
        bench.first.restart()
        for _ in range(3):
            driver.read()
        assert not driver.read().calibrated
        with pytest.raises(DriverStateError, match="not known where the handle is"):
            driver.enable()


@pytest.mark.parametrize("radius_m", [1.0, RADIUS_M, 1e-3, 1e-4])
def test_where_a_told_home_is_counted_no_controller_gets_to_by_itself(radius_m: float) -> None:
    """It wakes within half a turn of 0, and goes through the whole travel."""
    (table,) = axes(1, radius_m=radius_m, home_m=-0.05)
    drum = Drum(DrumOptions.model_validate(table))
    motor = moteus_crew.MoteusMotor(drum)
    motor.home_state = 2
    most_turns = drum.options.most_turns
    for motor.turns in (0.0, 0.5 + most_turns, -0.5 - most_turns):
        assert motor.home_turns is None
    for mark_turns in (motor.mark_turns, -motor.mark_turns):
        for motor.turns in (mark_turns - 1.1 * most_turns, mark_turns, mark_turns + 1.1 * most_turns):
            assert motor.home_turns == mark_turns


SHORT = {"homing": "absolute", "lowest_m": -0.03, "highest_m": 0.03}
"""Less than half a turn to either side."""


@pytest.mark.parametrize(
    ("home_state", "zero", "problem"),
    [
        (0, 0.0, "does not know where its shaft is"),
        (1, 0.0, ""),
        (2, 0.0, ""),
        (2, 64.0, "counts from a home that it was told: switch it off and on"),
    ],
)
def test_a_controller_that_does_not_know_its_place_is_refused_as_absolute(
    bench: Lab, home_state: int, zero: float, problem: str
) -> None:
    bench.first.home_state = home_state
    bench.first._zero = zero
    driver = bench.driver(axes=axes(1, **SHORT))
    if not problem:
        driver.open()
        driver.enable()
    else:
        with pytest.raises(ConfigError, match=rf'device.options.axes\[0\].homing = "absolute": controller 1 {problem}'):
            driver.open()


def test_one_that_knows_no_place_after_a_restart_is_refused_when_it_is_to_be_armed(bench: Lab) -> None:
    with bench.driver() as driver:
        driver._state_wait_s = PATIENCE_S
        bench.first.restart()
        bench.first.home_state = 0
        driver.read()
        driver.read()
        with pytest.raises(DeviceFaultError, match="does not know where its shaft is"):
            driver.enable()
        assert bench.first.torque_n_m == 0.0


def test_an_axis_that_is_told_its_home_beside_one_that_knows_it_can_be_armed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    be_patient(monkeypatch)
    with Lab("fdcanusb", tmp_path, 2, monkeypatch) as bench:
        for one in bench.controllers:
            assert isinstance(one, MoteusController)
            one.home_state = 1
        shaft = bench.controllers[1].shaft
        shaft.x_m = 0.02
        move_by_the_shaft(bench.first.shaft, monkeypatch)
        knows, told = axes(2, lowest_m=-0.03, highest_m=0.03)
        tables = [{**knows, "homing": "absolute"}, {**told, "homing": "here"}]
        with bench.driver(axes=tables) as driver:
            driver._state_wait_s = PATIENCE_S
            driver.calibrate()
            home_m = shaft.x_m
            for _ in range(2):
                driver.enable()
                driver.write([0.0, 0.0])
                driver.read()
                assert driver.read().position_m[1] == pytest.approx(shaft.x_m - home_m, abs=2e-4)
                driver.disable()
                driver.read()
                assert driver.read().calibrated
        with bench.driver(axes=tables) as again:
            again.enable()


def test_a_home_that_is_not_taken_leaves_none(bench: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    driver = opened(bench, homing="here")
    driver.calibrate()
    bench.first.shaft.x_m += 0.01  # else its home could be where it was, which is no other
    monkeypatch.setattr(moteus_crew, "GREETING_PATIENCE_S", 0.3)
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


COUNTER = pytest.mark.parametrize("has_counter", [True, False], ids=["counts milliseconds", "older firmware"])


@COUNTER
@pytest.mark.parametrize("homing", ["low_stop", "here"])
def test_a_calibration_in_which_a_controller_restarts_does_not_pass(
    bench: Lab, monkeypatch: pytest.MonkeyPatch, has_counter: bool, homing: str
) -> None:
    """Older firmware shows it by the place that it counts from: it was taken for home, 50 mm beside it."""
    bench.first.has_counter = has_counter
    driver = opened(bench, homing=homing)
    name = "here" if homing == "here" else "find_stop"
    find = getattr(motion, name)

    def restart(*asked: Any) -> int:
        at: int = find(*asked)
        with bench.bench.lock:
            bench.first.restart()
        asked[0].push(0.0)
        return at

    monkeypatch.setattr(motion, name, restart)
    with pytest.raises(DeviceFaultError, match="switched off and on"):
        driver.calibrate()
    assert bench.first.torque_n_m == 0.0
    driver.read()
    with pytest.raises(DriverStateError, match="not known where the handle is"):
        driver.enable()
    driver.close()


def press_on(driver: Any) -> None:
    for _ in range(3):
        driver.write([0.1])
        driver.read()


@COUNTER
def test_a_controller_that_restarts_under_force_is_let_go(bench: Lab, has_counter: bool) -> None:
    """It follows the next torque at once, and the handle seemed to be 3 m away."""
    bench.first.has_counter = has_counter
    with opened(bench, homing="here") as driver:
        driver.calibrate()
        driver.enable()
        driver.write([0.1])
        driver.read()
        bench.first.restart()
        with pytest.raises(DeviceFaultError, match="switched off and on"):
            press_on(driver)


@pytest.mark.parametrize("calls", [1, 2, 3])
def test_older_firmware_finds_the_same_home_and_has_none_while_it_is_looked_for(
    bench: Lab, monkeypatch: pytest.MonkeyPatch, calls: int
) -> None:
    """A daemon that is killed in between must not leave what the next one takes for a home."""
    bench.first.has_counter = False
    find_stop, homes = motion.find_stop, list[float | None]()

    def find(drive: motion.Drive, towards: float) -> int:
        homes.append(driver._opened().motors[0].home_turns)
        if len(homes) < calls:
            raise DeviceFaultError("given up")
        return find_stop(drive, towards)

    monkeypatch.setattr(motion, "find_stop", find)
    with opened(bench) as driver:
        beside_m = driver.read().position_m[0] - bench.first.shaft.x_m
        for _ in range(calls - 1):
            with pytest.raises(DeviceFaultError, match="given up"):
                driver.calibrate()
            assert not driver.read().calibrated
            assert driver.read().position_m[0] - bench.first.shaft.x_m == pytest.approx(beside_m, abs=2e-4)
        driver.calibrate()
        assert homes == [None] * calls
        assert driver.read().calibrated
        assert driver.read().position_m[0] == pytest.approx(bench.first.shaft.x_m, abs=2e-4)
        driver.calibrate()
        driver.enable()
    with bench.driver(axes=axes(1)) as again:
        again._state_wait_s = PATIENCE_S
        assert again.read().calibrated
        assert again.read().position_m[0] == pytest.approx(bench.first.shaft.x_m, abs=2e-4)


def test_older_firmware_that_knows_its_place_by_itself_is_told_none(bench: Lab) -> None:
    bench.first.has_counter = False
    bench.first.shaft.x_m = 0.0
    with bench.driver(axes=axes(1, **SHORT), sign_checked=False, calibration_speed_m_per_s=0.1) as driver:
        driver._state_wait_s = PATIENCE_S
        driver.calibrate()
        assert bench.first._zero == 0.0
        driver.enable()


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


def test_a_calibration_that_fails_at_the_second_axis_leaves_the_home_of_the_first_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was moved to where the handle was, and could be armed so until hapticd was started anew."""
    be_patient(monkeypatch)
    with Lab("fdcanusb", tmp_path, 2, monkeypatch) as bench:
        driver = bench.driver(axes=axes(2, homing="here"))
        driver._state_wait_s = PATIENCE_S
        driver.open()
        motors = driver._opened()
        motors.set_home([motor.turns for motor in motors.motors])
        driver.close()
        driver.open()
        bench.first.shaft.x_m += 0.02
        for _ in range(2):
            before_m = driver.read().position_m[0]

        def held(drive: motion.Drive) -> None:
            if drive.axis == 1:
                raise DeviceFaultError("held")

        monkeypatch.setattr(motion, "check_sign", held)
        monkeypatch.setattr(moteus_crew.MoteusCrew, "prove_watchdog", lambda crew: crew.enable())
        with pytest.raises(DeviceFaultError, match="held"):
            driver.calibrate()
        for _ in range(2):
            assert driver.read().position_m[0] == pytest.approx(before_m, abs=1e-4)
        assert before_m == pytest.approx(0.02, abs=1e-4)
        driver.close()


def test_it_ends_without_force_when_it_is_called_off(bench: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    driver = opened(bench)
    find_stop = motion.find_stop

    def find(drive: motion.Drive, towards: float) -> int:
        driver.call_off()
        return find_stop(drive, towards)

    monkeypatch.setattr(motion, "find_stop", find)
    with pytest.raises(DriverStateError, match="called off"):
        driver.calibrate()
    assert bench.first.torque_n_m == 0.0
    driver.close()
