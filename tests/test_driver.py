"""What the author of a driver holds in hand: a `with` block that gives the device back, a sample that shows itself."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from hapticd.driver import DeviceInfo, Driver, DriverState, Sample
from hapticd.errors import DeviceDisconnectedError, DeviceNotFoundError, DeviceProtocolError, DeviceTimeoutError
from hapticd.simulation.options import SimulationOptions
from hapticd_drivers.loopback import Loopback

PERIOD_S = 0.001


class Absent(Loopback):
    closed = 0

    def _open(self) -> None:  # type: ignore[override]  # it never comes to an answer
        raise DeviceNotFoundError("plug it in")

    def _close(self) -> None:
        self.closed += 1


def failing(driver: Driver[SimulationOptions], error: BaseException) -> None:
    """Fail inside the block, with the force on."""
    with driver:
        driver.enable()
        driver.read()
        driver.write([1.0])
        raise error


@pytest.mark.parametrize("error", [ValueError("mine"), KeyboardInterrupt(), SystemExit(3)])
def test_a_block_that_fails_closes_the_device_and_keeps_its_error(error: BaseException) -> None:
    driver = Loopback(SimulationOptions(), PERIOD_S)
    with pytest.raises(type(error)) as raised:
        failing(driver, error)
    assert raised.value is error
    assert driver.state is DriverState.CLOSED
    assert driver._force_n == 0.0


def test_a_block_may_close_the_device_itself_and_be_entered_again() -> None:
    driver = Loopback(SimulationOptions(), PERIOD_S)
    for _ in range(2):
        with driver as opened:
            assert opened.info.model
            opened.close()
        assert driver.state is DriverState.CLOSED


def test_a_device_that_cannot_be_opened_is_not_entered() -> None:
    driver = Absent(SimulationOptions(), PERIOD_S)
    with pytest.raises(DeviceNotFoundError, match="plug it in"), driver:
        pytest.fail("the block was entered")
    assert driver.state is DriverState.CLOSED
    assert driver.closed == 1


@pytest.mark.parametrize(
    ("declared", "said"),
    [
        ({"max_force_n": math.nan}, "max_force_n = nan: must be more than 0 N"),
        ({"max_force_n": -5.0}, r"max_force_n = -5\.0: must be more than 0 N"),
        ({"max_force_n": math.inf, "simulated": False}, "max_force_n = inf: must be more than 0 N, infinite only"),
        ({"axes": ()}, "axes"),
        ({"axes": ("x", "x")}, "axes"),
        ({"workspace_m": ()}, "workspace_m"),
        ({"workspace_m": ((0.1, -0.1),)}, "workspace_m"),
        ({"safe_damping_n_s_per_m": -1.0}, "safe_damping_n_s_per_m"),
        ({"nominal_rate_hz": 0.0}, "nominal_rate_hz"),
        ({"resolution_m": math.nan}, "resolution_m"),
        ({"host_silence_ms": -1.0}, "host_silence_ms"),
    ],
)
def test_a_device_that_declares_what_none_can_be_is_not_opened(declared: dict[str, Any], said: str) -> None:
    """Every limit of the guard is made of it: with a force limit that is no number nothing would be limited."""

    class Odd(Loopback):
        def _open(self) -> DeviceInfo:
            return replace(super()._open(), **declared)

    driver = Odd(SimulationOptions(), PERIOD_S)
    with pytest.raises(DeviceProtocolError, match=rf"Odd: DeviceInfo\.{said}"):
        driver.open()
    assert driver.state is DriverState.CLOSED


@pytest.mark.parametrize("hook", ["_open", "_enable", "_calibrate"])
def test_what_a_hook_raises_names_driver_hook_and_place(monkeypatch: pytest.MonkeyPatch, hook: str) -> None:
    """A device that could not be armed for it ended the loop, and a library that exits did so without a word."""

    class Odd(Loopback):
        pass

    def leave(_: Loopback) -> None:
        raise SystemExit(7)

    driver = Odd(SimulationOptions(), PERIOD_S)
    monkeypatch.setattr(Odd, hook, leave)
    steps = [driver.open, *([] if hook == "_open" else [getattr(driver, hook.removeprefix("_"))])]
    for step in steps[:-1]:
        step()
    with pytest.raises(DeviceProtocolError, match=rf"driver .*Odd: {hook}: SystemExit: 7 \(test_driver\.py:\d+\)"):
        steps[-1]()
    assert driver.state is (DriverState.CLOSED if hook == "_open" else DriverState.OPEN)


class TwoMotors(Loopback):
    """The second of two motors refuses, with the first enabled already."""

    def __init__(self, clings: bool) -> None:
        super().__init__(SimulationOptions(), PERIOD_S)
        self.clings = clings
        self.enabled = 0

    def _enable(self) -> None:
        self.enabled = 1
        raise DeviceProtocolError("motor 2 refuses")

    def _disable(self) -> None:
        if self.clings:
            raise DeviceTimeoutError("motor 1 does not answer")
        self.enabled = 0


@pytest.mark.parametrize("clings", [False, True])
def test_a_device_that_was_enabled_halfway_is_disabled_again(clings: bool) -> None:
    """The first motor stayed enabled, and to disarm did nothing, since nothing had been armed."""
    with TwoMotors(clings) as driver:
        with pytest.raises(DeviceProtocolError, match="motor 2 refuses"):
            driver.enable()
        assert driver.state is DriverState.OPEN
        assert (driver.enabled, driver.force_left) == ((1, "motor 1 does not answer") if clings else (0, ""))
        driver.clings = False


def test_a_sample_shows_its_fields() -> None:
    sample = Sample(2)
    sample.position_m[1] = 0.25
    assert repr(sample).startswith("Sample(")
    assert "position_m=[0.0, 0.25]" in repr(sample)
    assert "calibrated=True" in repr(sample)


class Hesitant(Loopback):
    """Lets go when it is asked for the third time."""

    def __init__(self, error: BaseException) -> None:
        super().__init__(SimulationOptions(), PERIOD_S)
        self.error = error
        self.asked = 0

    def _disable(self) -> None:
        self.asked += 1
        if self.asked < 3:
            raise self.error
        super()._disable()


@pytest.mark.parametrize(
    ("error", "left"),
    [
        (DeviceTimeoutError("busy"), ""),
        (DeviceDisconnectedError("unplugged"), "unplugged"),
        (KeyError("x"), "_disable: KeyError: 'x' (test_driver.py:"),
        (SystemExit(7), "_disable: SystemExit: 7 (test_driver.py:"),
    ],
)
def test_a_device_that_answers_late_is_asked_again_as_it_is_closed(error: BaseException, left: str) -> None:
    """Where a computer is busy, and a loop could not have waited; what is gone or broken is not asked again."""
    driver = Hesitant(error)
    with driver:
        driver.enable()
    assert driver.state is DriverState.CLOSED
    assert driver.force_left.startswith(left)
    assert bool(driver.force_left) == bool(left)
    assert driver.asked == (1 if left else 3)
