"""What the author of a driver holds in hand: a `with` block that gives the device back, a sample that shows itself."""

from __future__ import annotations

import pytest

from hapticd.driver import Driver, DriverState, Sample
from hapticd.errors import DeviceNotFoundError
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


def test_a_sample_shows_its_fields() -> None:
    sample = Sample(2)
    sample.position_m[1] = 0.25
    assert repr(sample).startswith("Sample(")
    assert "position_m=[0.0, 0.25]" in repr(sample)
    assert "calibrated=True" in repr(sample)
