"""Each thing that can go wrong with moteus controllers: how soon it is noticed, its name, and what push is left."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hapticd.config.loading import parse
from hapticd.driver import DriverState
from hapticd.errors import DeviceDisconnectedError, DeviceFaultError, DeviceTimeoutError, DriverError
from hapticd.tick.assemble import make_tick
from hapticd.tick.event import EventCode
from hapticd_drivers.moteus.driver import Moteus
from hapticd_drivers.motors import crew
from hapticd_drivers.motors.metrics import DAMAGED, TICKS_WITHOUT_STATE, UNKNOWN
from tests.drivers.moteus.lab import MOST_N_M, RADIUS_M, Lab, lab
from tests.drivers.motors.bench import PATIENCE_S
from tests.drivers.motors.wire import Frames

PUSH_N = 2.0
WATCHDOG_MS = 20.0


@pytest.fixture(params=["fdcanusb", "socketcan"])
def bench(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    monkeypatch.setattr(crew, "URGENT_PATIENCE_S", PATIENCE_S)
    with lab(request.param, tmp_path, 2, monkeypatch) as made:
        yield made


def pressing(made: Lab, ticks: int = 25) -> Moteus:
    driver = made.driver()
    driver._state_wait_s = PATIENCE_S  # a busy computer is no fault
    driver.open()
    driver.enable()
    for _ in range(ticks):
        driver.read()
        driver.write([PUSH_N, -PUSH_N])
    made.bench.settle(driver)
    assert made.first.torque_n_m == pytest.approx(PUSH_N * RADIUS_M)
    return driver


def ticks_until(driver: Moteus, kind: type[DriverError], text: str) -> int:
    driver._state_wait_s = 0.005
    ticks = 0

    def press_on() -> None:
        nonlocal ticks
        while ticks < 2000:
            ticks += 1
            driver.read()
            driver.write([PUSH_N, -PUSH_N])

    with pytest.raises(kind, match=re.escape(text)):
        press_on()
    return ticks


def fall_silent(made: Lab) -> None:
    made.first.deaf = True


def brown_out(made: Lab) -> None:
    made.first.voltage_v = 8.0


def nothing_heard(made: Lab) -> None:
    made.bench.pass_time(1.2e-3 * WATCHDOG_MS)


FAULTS: dict[str, tuple[Callable[[Lab], None], type[DriverError], str, int]] = {
    "the computer says nothing for 24 ms": (nothing_heard, DeviceFaultError, "heard no command for 20 ms", 2),
    "the supply falls": (brown_out, DeviceFaultError, "the supply is too low", 2),
    "switched off and on": (lambda made: made.first.restart(), DeviceFaultError, "switched off and on", 2),
    "encoder fault": (lambda made: made.first.break_down(35), DeviceFaultError, "check magnet and cable", 2),
    "a controller is silent": (fall_silent, DeviceTimeoutError, "has said nothing for 500 ticks", 502),
    "the adapter is unplugged": (lambda made: made.bench.unplug(), DeviceDisconnectedError, "gone", 2),
}
"""What happens, the error, what its text says, and in how many ticks at most it is told."""


@pytest.mark.parametrize("name", FAULTS)
def test_what_goes_wrong_is_named_soon_and_leaves_no_force(
    bench: Lab, name: str, record_property: Callable[[str, object], None]
) -> None:
    happen, kind, text, most_ticks = FAULTS[name]
    driver = pressing(bench)
    bench.first.peak_n_m = 0.0
    happen(bench)
    ticks = ticks_until(driver, kind, text)
    assert ticks <= most_ticks
    assert bench.first.peak_n_m <= PUSH_N * RADIUS_M * 1.001
    driver.disable()
    assert driver.state is DriverState.OPEN
    for controller in bench.controllers:
        controller.advance(0.05)  # those that heard nothing of it have their watchdogs
        assert controller.torque_n_m == 0.0
    driver.close()
    record_property("ticks", ticks)
    record_property("peak_n", bench.first.peak_n_m / RADIUS_M)
    print(f"| {name} | {ticks} | {bench.first.peak_n_m / RADIUS_M:.2f} |")  # noqa: T201 - the table of docs/moteus.md


def test_the_page_names_each_of_them() -> None:
    page = (Path(__file__).parents[3] / "docs" / "moteus.md").read_text()
    assert [name for name in FAULTS if f"| {name} |" not in page] == []


def test_the_watchdog_that_goes_with_each_torque_is_the_one_that_is_declared(bench: Lab) -> None:
    """It holds for as long as it says, and not longer, while the computer is silent."""
    driver = pressing(bench)
    assert driver.info.host_silence_ms == WATCHDOG_MS
    bench.bench.pass_time(1e-3 * (WATCHDOG_MS - 2.0))
    assert bench.first.torque_n_m != 0.0
    bench.bench.pass_time(0.004)
    assert bench.first.torque_n_m == 0.0
    driver.close()


def test_a_controller_that_timed_out_follows_again_only_when_it_is_enabled(bench: Lab) -> None:
    driver = pressing(bench)
    nothing_heard(bench)
    ticks_until(driver, DeviceFaultError, "heard no command")
    driver.disable()
    for _ in range(10):
        driver.read()
    assert bench.first.torque_n_m == 0.0
    driver.enable()
    for _ in range(3):
        driver.read()
        driver.write([PUSH_N, 0.0])
    bench.bench.settle(driver)
    assert bench.first.torque_n_m == pytest.approx(PUSH_N * RADIUS_M)
    driver.close()


def test_frames_that_are_damaged_or_of_others_are_counted_and_never_believed(bench: Lab) -> None:
    driver = pressing(bench)
    dice = random.Random(1)
    end = bench.bench.end

    def spoil(frames: Frames) -> Frames:
        spoilt: Frames = []
        for identifier, data in frames:
            kind = dice.randrange(6)
            if kind == 0:
                spoilt.append((0x7B00, data))  # from a controller that is none of ours
            elif kind == 1:
                spoilt.append((identifier, data[: dice.randrange(3)]))
            elif kind == 2:
                end.send_raw(b"rcv 1z00 21\r\n" if bench.channel.startswith("/") else b"\x01\x02")
            else:
                spoilt.append((identifier, data))
        return spoilt

    driver._state_wait_s = 0.004
    bench.bench.spoil = spoil
    for _ in range(300):
        sample = driver.read()
        assert all(abs(position_m) < 0.06 for position_m in sample.position_m)
        driver.write([PUSH_N, -PUSH_N])
    bench.bench.spoil = list
    bench.bench.settle(driver)
    assert driver.metrics[DAMAGED] > 10
    assert driver.metrics[UNKNOWN] > 10
    assert driver.metrics[TICKS_WITHOUT_STATE] > 10
    before = driver.read().sequence
    driver.write([0.0, 0.0])
    bench.bench.settle(driver)
    assert driver.read().sequence > before
    driver.close()


def test_an_answer_that_is_late_is_used_when_it_comes_and_costs_no_tick(bench: Lab) -> None:
    driver = pressing(bench)
    held: Frames = []

    def hold(frames: Frames) -> Frames:
        held.extend(frames)
        return []

    driver._state_wait_s = 0.002
    bench.bench.spoil = hold
    sequence = driver.read().sequence
    for _ in range(3):
        driver.write([PUSH_N, -PUSH_N])
        assert driver.read().sequence <= sequence + 1
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
    bench.first.position = 1e9
    driver.disable()
    driver.close()
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
    fall_silent(bench)
    driver._state_wait_s = 0.001
    for _ in range(21):
        driver.write(tick.step(driver.read(), 1e-3))
        if tick.fault:
            break
    assert tick.fault == EventCode.DEVICE_FROZEN
    driver.close()
