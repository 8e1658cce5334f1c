"""What can go wrong with moteus controllers, over fdcanusb and over SocketCAN."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from hapticd.config.loading import parse
from hapticd.errors import DeviceDisconnectedError, DeviceFaultError, DeviceTimeoutError, DriverError
from hapticd.tick.assemble import make_tick
from hapticd.tick.event import EventCode
from hapticd_drivers.moteus import crew as moteus_crew
from hapticd_drivers.motors import crew
from hapticd_drivers.motors.metrics import TICKS_WITHOUT_STATE
from tests.drivers.moteus.lab import Lab
from tests.drivers.motors.bench import PATIENCE_S
from tests.drivers.motors.fault_contract import (
    PUSH_N,
    MotorFault,
    MotorFaultContract,
    brown_out,
    deafen,
    nothing_heard,
    pressing,
    ticks_until,
    unplug,
)
from tests.drivers.motors.lab import MOST_N_M, RADIUS_M
from tests.drivers.motors.wire import Frames

FAULTS = (
    MotorFault("the computer says nothing for 24 ms", nothing_heard, DeviceFaultError, "heard no command for 20 ms", 2),
    MotorFault("the supply falls", brown_out, DeviceFaultError, "the supply is too low", 2),
    MotorFault("switched off and on", lambda made: made.first.restart(), DeviceFaultError, "switched off and on", 2),
    MotorFault("encoder fault", lambda made: made.first.break_down(35), DeviceFaultError, "check magnet and cable", 2),
    MotorFault("a controller is silent", deafen, DeviceTimeoutError, "has said nothing for 500 ticks", 502, 0.001),
    MotorFault("the adapter is unplugged", unplug, DeviceDisconnectedError, "gone", 2),
)


@pytest.fixture(params=["fdcanusb", "socketcan"])
def bench(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    monkeypatch.setattr(crew, "URGENT_PATIENCE_S", PATIENCE_S)
    with Lab(request.param, tmp_path, 2, monkeypatch) as made:
        yield made


@pytest.fixture(params=FAULTS, ids=lambda fault: fault.name)
def fault(request: pytest.FixtureRequest) -> MotorFault:
    found: MotorFault = request.param
    return found


class TestMoteus(MotorFaultContract):
    PAGE = "moteus.md"
    FAULTS = FAULTS
    TIMED_OUT = "heard no command"
    STRANGER = 0x7B00
    BROKEN_LINE = b"rcv 1z00 21\r\n"
    LONGEST_CUT = 3


def test_an_answer_that_is_late_is_used_when_it_comes_and_costs_no_tick(bench: Lab) -> None:
    driver = pressing(bench)
    held: Frames = []

    def hold(frames: Frames) -> Frames:
        held.extend(frames)
        return []

    driver._state_wait_s = 0.002
    bench.bench.spoil = hold
    sequence = driver.read().sequence
    without = driver.metrics[TICKS_WITHOUT_STATE]
    for _ in range(3):
        driver.write([PUSH_N, -PUSH_N])
        assert driver.read().sequence <= sequence + 1
    assert driver.metrics[TICKS_WITHOUT_STATE] >= without + 2
    bench.bench.settle(driver)  # or a newer answer would be on its way before those that are held
    bench.bench.spoil = list
    for identifier, data in held:
        bench.bench.end.send(identifier, data)
    driver._state_wait_s = PATIENCE_S
    assert driver.read().sequence > sequence
    driver.close()


def test_a_place_that_is_no_number_is_no_place(bench: Lab) -> None:
    driver = pressing(bench)
    bench.first.position = float("nan")
    ticks_until(driver, DriverError, "does not know where its shaft is")
    driver.disable()
    assert driver.force_left == ""
    assert all(one.torque_n_m == 0.0 for one in bench.controllers)
    driver.close()
    assert driver.force_left == ""
    with pytest.raises(DriverError, match="does not know where its shaft is"):
        bench.driver().open()
    bench.first.position = None


def test_a_place_that_cannot_be_is_no_place(bench: Lab) -> None:
    driver = pressing(bench)
    bench.first.position = 1e9
    ticks_until(driver, DriverError, "1e+09 turns")
    driver.close()


def test_a_controller_that_prepares_is_given_its_time(bench: Lab) -> None:
    bench.first.preparing = 5
    driver = pressing(bench)
    driver.close()


def test_one_that_has_followed_and_gets_ready_anew_has_let_go(bench: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also soon after it was enabled: its force would come back in one step."""
    monkeypatch.setattr(moteus_crew, "PREPARING_S", PATIENCE_S)
    driver = pressing(bench)
    bench.first.preparing = 1000
    assert ticks_until(driver, DeviceFaultError, "controller 1 has let go: it is in mode 3") <= 3
    driver.close()


def test_a_device_whose_controller_does_not_answer_is_refused_by_its_address(
    bench: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(crew, "GREETING_PATIENCE_S", 0.1)
    bench.controllers[1].deaf = True
    with pytest.raises(DeviceTimeoutError, match="controller 2 on"):
        bench.driver().open()


def test_a_handle_in_a_loop_is_let_go_when_its_controller_falls_silent(bench: Lab) -> None:
    """The loop sees it as frozen after 20 ticks; by then the controller's own watchdog has let go."""
    driver = pressing(bench)
    loaded = parse(
        '[device]\ndriver = "moteus"\n[device.options]\nchannel = "/dev/null"\n'
        f"[[device.options.axes]]\nid = 1\nradius_m = {RADIUS_M}\nmax_torque_n_m = {MOST_N_M}\n"
        "lowest_m = -0.05\nhighest_m = 0.05\n"
        '[[scene.walls]]\naxis = "x"\nstiffness_n_per_m = 500.0\n',
        "test",
    )
    tick = make_tick(loaded, driver.info)
    tick.start(driver.read())
    tick.arm()
    deafen(bench)
    driver._state_wait_s = 0.001
    for _ in range(21):
        driver.write(tick.step(driver.read(), 1e-3))
        if tick.fault:
            break
    assert tick.fault == EventCode.DEVICE_FROZEN
    driver.close()
