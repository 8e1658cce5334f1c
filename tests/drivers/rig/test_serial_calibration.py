"""The serial rig's calibration: home, and the sign of the motor."""

from __future__ import annotations

import threading
import time

import pytest

from hapticd.driver import DriverState
from hapticd.errors import (
    DeviceFaultError,
    DeviceTimeoutError,
    DriverError,
    DriverStateError,
)
from hapticd_drivers.rig import conversation
from hapticd_drivers.rig.conversation import Conversation
from hapticd_drivers.rig.messages import State
from hapticd_drivers.rig.serial_rig import SerialRig
from tests.drivers.rig.device import HALF_TRAVEL_M, PATIENCE_S, Rig
from tests.drivers.rig.ticking import PERIOD_S, MakeDriver, settle, tick


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


def test_a_sign_that_a_calibration_has_disproved_is_believed_no_more(rig: Rig, make_driver: MakeDriver) -> None:
    """With a reversed motor a wall pulls the hand in."""
    driver = make_driver(axes=[{"homing": "here"}], sign_checked=True)
    driver.open()
    driver.calibrate()
    driver.enable()
    driver.disable()
    rig.plant.motor = -1.0
    with pytest.raises(DeviceFaultError, match="motor_reversed"):
        driver.calibrate()
    with pytest.raises(DriverStateError, match="has not been checked that the motors push the right way"):
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


def lost_answers(rig: Rig, driver: SerialRig, monkeypatch: pytest.MonkeyPatch) -> None:
    """Calibrate, with the rig hearing where its home is and its answers lost."""
    monkeypatch.setattr(conversation, "PATIENCE_S", 1.0)
    rig.up = lambda said: b"" if said[2:3] == b"\x82" else said  # AXIS; a state that is lost is waited for
    with pytest.raises(DeviceTimeoutError):
        driver.calibrate()
    rig.up = bytes
    monkeypatch.setattr(conversation, "PATIENCE_S", PATIENCE_S)


def test_a_home_that_the_rig_may_have_taken_and_the_driver_has_not_is_none(
    rig: Rig, make_driver: MakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was believed to be in the middle of the travel, 40 mm away, and force was let through."""
    rig.plant.position_m = 0.04
    rig.restart()
    axis = {"homing": "here", "home_m": 0.04, "lowest_m": -0.05, "highest_m": 0.05}
    driver = make_driver(axes=[axis], sign_checked=True)
    driver.open()
    lost_answers(rig, driver, monkeypatch)
    settle(rig, driver)
    assert not driver.read().calibrated
    with pytest.raises(DriverStateError, match="hapticd calibrate"):
        driver.enable()
    driver.calibrate()
    assert settle(rig, driver) == pytest.approx(0.04, abs=2e-3)
    driver.enable()


def test_a_slip_before_the_rig_is_told_its_home_fails_the_calibration(
    rig: Rig, make_driver: MakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver = make_driver(axes=[{"homing": "here"}], sign_checked=True)
    driver.open()
    set_home = Conversation.set_home

    def late(talk: Conversation, axis: int, home: int) -> None:
        rig.break_down(1, 0, 0)
        rig.mend()
        set_home(talk, axis, home)

    with monkeypatch.context() as patch:
        patch.setattr(Conversation, "set_home", late)
        with pytest.raises(DeviceFaultError):
            driver.calibrate()
    settle(rig, driver)
    with pytest.raises(DriverStateError, match="hapticd calibrate"):
        driver.enable()
    assert rig.force_n == 0.0
    driver.calibrate()
    driver.enable()


def test_a_slip_as_the_motor_is_switched_off_fails_the_calibration(
    rig: Rig, make_driver: MakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The home of before was told after it, was believed, and force was let through."""
    driver = make_driver(axes=[{"homing": "here"}], sign_checked=True)
    driver.open()
    disable, before = Conversation.disable, []

    def late(talk: Conversation, urgent: bool) -> State:
        before.append(rig.force_n)
        if len(before) == 2:
            rig.break_down(1, 0, 0)
            rig.mend()
        return disable(talk, urgent)

    with monkeypatch.context() as patch:
        patch.setattr(Conversation, "disable", late)
        with pytest.raises(DeviceFaultError, match="has just lost its home: calibrate once more"):
            driver.calibrate()
    assert before == [0.0, 0.0], "no force while the rig is told its home"
    settle(rig, driver)
    assert not driver.read().calibrated
    with pytest.raises(DriverStateError, match="hapticd calibrate"):
        driver.enable()
    driver.calibrate()
    driver.enable()


def test_a_home_that_is_lost_since_the_last_tick_is_seen_before_forces_pass(rig: Rig, make_driver: MakeDriver) -> None:
    rig.set_home()
    driver = make_driver(sign_checked=True)
    driver.open()
    assert driver.read().calibrated
    rig.break_down(1, 0, 0)
    rig.mend()
    with pytest.raises(DriverStateError, match="lost its home"):
        driver.enable()
    assert rig.force_n == 0.0
    with pytest.raises(DriverStateError, match="hapticd calibrate"):
        driver.enable()


def test_a_calibration_pushes_no_harder_than_the_device_may(rig: Rig, make_driver: MakeDriver) -> None:
    rig.plant.friction_n = 0.3
    witness = Witness(rig)
    driver = make_driver(axes=[{"homing": "here"}], max_force_n=0.2, calibration_force_n=0.5)
    driver.open()
    with pytest.raises(DeviceFaultError, match="more than the friction"):
        driver.calibrate()
    assert witness.most_n == pytest.approx(0.2)
