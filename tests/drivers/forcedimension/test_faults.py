"""Each thing that can go wrong with a device: how soon it is noticed, what it is called, and that force is off."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable

import pytest

from hapticd.config.loading import parse
from hapticd.driver import DriverState
from hapticd.errors import DeviceDisconnectedError, DeviceFaultError, DriverError
from hapticd.tick.assemble import make_tick
from hapticd.tick.event import EventCode
from hapticd.tick.guard import Mode
from hapticd.tick.motion import FROZEN_S
from hapticd.tick.tick import ControlTick
from hapticd_drivers.forcedimension.driver import ForceDimension
from hapticd_drivers.forcedimension.models import MODELS
from tests.drivers.forcedimension.bench import BRAKE, FORCE, Bench

STATUS_TICKS = 10  # the default of status_every_ticks
OMEGA7, FALCON = 35, 60


@pytest.fixture(params=[OMEGA7, FALCON], ids=["omega7", "falcon"])
def kind(request: pytest.FixtureRequest, bench: Bench) -> int:
    """Which device is on the bench: every fault is tried on each, but for what a device cannot do."""
    bench.set(type=request.param, motor_n=MODELS[request.param].max_force_n)
    return int(request.param)


def pressing(bench: Bench) -> ForceDimension:
    driver = bench.driver()
    driver.open()
    driver.enable()
    for _ in range(25):
        driver.read()
        driver.write([0.0, 0.0, 2.0])
    assert bench.get("mode") == FORCE
    return driver


def ticks_until_fault(bench: Bench, driver: ForceDimension, kind: type[DriverError], text: str) -> tuple[int, float]:
    """Ticks until the error, and the largest force of the device in them [N]."""
    ticks = 0
    peak_n = 0.0

    def press_on() -> None:
        nonlocal ticks, peak_n
        while ticks < 1000:
            ticks += 1
            driver.read()
            driver.write([0.0, 0.0, 2.0])
            peak_n = max(peak_n, push_n(bench))

    with pytest.raises(kind, match=re.escape(text)):
        press_on()
    return ticks, peak_n


def push_n(bench: Bench) -> float:
    """What the device pushes with, magnitude [N]."""
    return math.hypot(*bench.vector("force_n"))


def overspeed(bench: Bench) -> None:
    bench.set(velocity_m_per_s=[6.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("happen", "text", "peak_n"),
    [
        (Bench.press_force_button, "the force button on the device was pressed", 0.0),
        (overspeed, "the device's own velocity limit was exceeded", 0.0),
        (lambda bench: bench.set(error=3), "the device reports an error of its own (3)", 2.0),  # it goes on until told
    ],
)
@pytest.mark.usefixtures("kind")
def test_a_stop_of_the_device_is_noticed_within_the_status_ticks_and_named(
    bench: Bench, happen: Callable[[Bench], None], text: str, peak_n: float
) -> None:
    stops(bench, happen, text, peak_n)


def test_a_stop_by_its_watchdog_is_noticed_and_named_too(bench: Bench) -> None:
    stops(
        bench,
        lambda bench: bench.advance(11_000),
        "the device's watchdog heard nothing from this computer in time",
    )


def stops(bench: Bench, happen: Callable[[Bench], None], text: str, most_n: float = 0.0) -> None:
    """The device stops by itself, the driver says so, and forces come back only when they are enabled anew."""
    driver = pressing(bench)
    happen(bench)
    ticks, peak_n = ticks_until_fault(bench, driver, DeviceFaultError, text)
    assert ticks <= STATUS_TICKS + 1
    assert peak_n == most_n
    driver.disable()
    assert bench.get("mode") == BRAKE
    assert bench.vector("force_n") == [0.0, 0.0, 0.0]
    # It is still there: positions go on, and forces come back only when somebody enables them again.
    bench.set(error=0, velocity_m_per_s=[0.0, 0.0, 0.0])
    for _ in range(3 * STATUS_TICKS):
        driver.read()
    assert bench.get("mode") == BRAKE
    driver.enable()
    for _ in range(3 * STATUS_TICKS):
        driver.read()
        driver.write([0.0, 0.0, 1.0])
    driver.close()


def test_the_watchdog_takes_the_force_away_while_nobody_calls(bench: Bench) -> None:
    driver = pressing(bench)
    bench.advance(9_000)
    assert bench.get("mode") == FORCE
    bench.advance(1_200)
    assert (bench.get("mode"), bench.get("cause")) == (BRAKE, 3)
    assert bench.vector("force_n") == [0.0, 0.0, 0.0]
    driver.close()


def test_a_falcon_keeps_its_force_while_nobody_calls(bench: Bench) -> None:
    """Which is why it needs device.accept_no_watchdog."""
    bench.set(type=FALCON, motor_n=MODELS[FALCON].max_force_n)
    driver = pressing(bench)
    assert driver.info.host_silence_ms is None
    bench.advance(1e6)
    assert (bench.get("mode"), bench.get("force_n", index=2)) == (FORCE, 2.0)
    driver.disable()
    assert bench.vector("force_n") == [0.0, 0.0, 0.0]
    driver.close()


@pytest.mark.usefixtures("kind")
@pytest.mark.parametrize("first", ["read", "write"])
def test_an_unplugged_device_is_noticed_by_the_next_call(bench: Bench, first: str) -> None:
    driver = pressing(bench)
    bench.set(present=0)
    call = driver.read if first == "read" else lambda: driver.write([0.0, 0.0, 0.0])
    with pytest.raises(DeviceDisconnectedError, match=r"communication error, error 2 \(COM\)"):
        call()
    driver.disable()
    driver.disable()
    driver.close()
    assert driver.state is DriverState.CLOSED
    assert driver.force_left == "omega7: dhdEnableForce failed: communication error, error 2 (COM)"
    bench.set(present=1)
    driver.open()
    driver.read()
    assert bench.get("mode") != FORCE
    driver.close()


def test_a_falcon_that_comes_back_takes_forces_again_only_when_they_are_enabled(bench: Bench) -> None:
    """It has nothing to calibrate, so nothing else stands before them."""
    bench.set(type=FALCON, motor_n=MODELS[FALCON].max_force_n, calibrated=0)
    driver = pressing(bench)
    bench.set(present=0)
    with pytest.raises(DeviceDisconnectedError):
        driver.read()
    driver.close()
    bench.set(present=1)
    driver.open()
    driver.read()
    assert bench.get("mode") != FORCE
    driver.enable()
    driver.write([0.0, 0.0, 1.0])
    assert (bench.get("mode"), bench.get("force_n", index=2)) == (FORCE, 1.0)
    driver.close()


def test_a_device_that_lost_its_calibration_while_it_was_away_takes_no_force(bench: Bench) -> None:
    driver = pressing(bench)
    bench.set(present=0)
    with pytest.raises(DeviceDisconnectedError):
        driver.read()
    driver.close()
    bench.set(present=1, calibrated=0)
    driver.open()
    with pytest.raises(DriverError, match="not been calibrated"):
        driver.enable()
    driver.close()


CONFIG = """
[device]
driver = "omega7"
accept_no_watchdog = true
[[scene.walls]]
stiffness_n_per_m = 2000.0
[safety]
auto_arm = true
"""


def armed(bench: Bench) -> tuple[ForceDimension, ControlTick]:
    bench.set(hand_n=[0.0, 0.0, -2.0], viscous_n_s_per_m=20)
    driver = bench.driver()
    tick = make_tick(parse(CONFIG, "test"), driver.open())
    tick.start(driver.read())
    driver.enable()
    tick.arm()
    for _ in range(300):
        driver.write(tick.step(driver.read(), 1e-3))
    assert bench.get("force_n", index=2) == pytest.approx(2.0, abs=0.1)
    return driver, tick


def ticks_until_code(driver: ForceDimension, tick: ControlTick, code: EventCode) -> int:
    for count in range(1, 200):
        force_n = tick.step(driver.read(), 1e-3)
        driver.write(force_n)
        assert all(math.isfinite(newton) for newton in force_n)
        if tick.fault:
            assert tick.fault == code
            return count
    raise AssertionError(f"no {code}")


def until_disarmed(bench: Bench, driver: ForceDimension, tick: ControlTick) -> int:
    """Ticks until it is out; the force only falls on the way."""
    before_n = push_n(bench)
    for count in range(1, 200):
        driver.write(tick.step(driver.read(), 1e-3))
        now_n = push_n(bench)
        assert now_n <= before_n + 1e-9
        before_n = now_n
        if tick.guard.mode is Mode.DISARMED:
            return count
    raise AssertionError("still armed")


@pytest.mark.usefixtures("kind")
def test_data_that_is_never_new_is_a_frozen_device(bench: Bench) -> None:
    driver, tick = armed(bench)
    bench.set(stale=1)
    assert ticks_until_code(driver, tick, EventCode.DEVICE_FROZEN) == round(FROZEN_S / 1e-3)
    assert until_disarmed(bench, driver, tick) <= 51
    assert bench.vector("force_n") == [0.0, 0.0, 0.0]
    driver.close()


@pytest.mark.usefixtures("kind")
@pytest.mark.parametrize("garbage", [1, 2])
def test_garbage_is_an_impossible_sample_and_the_force_is_out_within_10_ms(bench: Bench, garbage: int) -> None:
    driver, tick = armed(bench)
    bench.set(garbage=garbage)
    assert ticks_until_code(driver, tick, EventCode.SAMPLE_IMPOSSIBLE) == 1
    assert until_disarmed(bench, driver, tick) <= 10
    assert bench.vector("force_n") == [0.0, 0.0, 0.0]
    driver.close()


@pytest.mark.usefixtures("kind")
def test_a_slow_call_is_waited_for_and_changes_nothing_else(bench: Bench) -> None:
    driver = pressing(bench)
    bench.set(slow_us=30_000, slow_calls=1)
    before_s = time.monotonic()
    driver.read()
    assert time.monotonic() - before_s >= 0.03
    driver.write([0.0, 0.0, 2.0])
    assert bench.get("force_n", index=2) == 2.0
    driver.close()


@pytest.mark.usefixtures("kind")
def test_a_device_that_repeats_one_position_as_new_cannot_be_told_from_one_that_stands_still(bench: Bench) -> None:
    """The SDK has no count and no clock of the device: docs/omega7.md says so."""
    driver, tick = armed(bench)
    bench.set(frozen=1)
    for _ in range(round(2.0 * FROZEN_S / 1e-3)):
        driver.write(tick.step(driver.read(), 1e-3))
    assert tick.fault == 0
    driver.close()
