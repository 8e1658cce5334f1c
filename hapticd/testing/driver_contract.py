"""What every driver must do, whatever the device: a test module subclasses `DriverContract` and names its driver."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Sequence
from typing import Any

import pytest

from hapticd.device import MOST_METRICS
from hapticd.driver import Driver, DriverState
from hapticd.errors import DriverStateError

AnyDriver = Driver[Any]

FOLLOWS_S = 2.0
"""Within this time after it was enabled a device follows what is written [s]."""


class DriverContract:
    """Subclass as `TestYourDriver(DriverContract)`; provide the fixture `driver` and the method `force_on_device`.

    class TestMyRig(DriverContract):
        @pytest.fixture
        def driver(self): ...                        # a closed driver whose device, or its double, is there
        def force_on_device(self, driver): ...       # what the device says it is pushed with
    """

    @pytest.fixture
    def driver(self) -> AnyDriver:
        """A closed driver whose device, or its double, is there; a new one for each test."""
        raise NotImplementedError("give the test class a fixture `driver`: a closed driver whose device is there")

    def force_on_device(self, driver: Any) -> Sequence[float]:
        """What the device, and not the driver, says it is being pushed with now [N]; asked while the driver is open."""
        raise NotImplementedError("give the test class a method `force_on_device`: what the device is pushed with [N]")

    @pytest.fixture
    def enabled(self, driver: AnyDriver) -> AnyDriver:
        driver.open()
        driver.enable()
        return driver

    def a_force(self, driver: AnyDriver) -> list[float]:
        """At most half of the limit; each axis has its own size and the other direction than the one before it."""
        axes = len(driver.info.axes)
        newton = min(driver.info.max_force_n, 10.0) / (2.0 * math.sqrt(axes))
        return [newton * (1.0 - 0.1 * axis) * (-1.0) ** axis for axis in range(axes)]

    def test_it_declares_a_device_that_makes_sense(self, driver: AnyDriver) -> None:
        info = driver.open()
        assert info is driver.info
        assert info.model
        assert not info.flaw
        assert info.resolution_m < 0.01
        driver.close()

    def test_its_metrics_have_names_of_their_own_and_start_at_zero(self, driver: AnyDriver) -> None:
        names = [metric.name for metric in driver.METRICS]
        assert len(set(names)) == len(names) <= MOST_METRICS
        assert all(re.fullmatch("[a-z][a-z0-9_]*", name) for name in names)
        assert all(metric.meaning for metric in driver.METRICS)
        assert not any(driver.metrics)

    def test_samples_are_finite_and_have_one_element_an_axis(self, enabled: AnyDriver) -> None:
        info = enabled.info
        for _ in range(20):
            sample = enabled.read()
            assert len(sample.position_m) == len(info.axes)
            assert len(sample.velocity_m_per_s) == len(info.axes)
            assert len(sample.orientation) == 9
            numbers = [*sample.position_m, *sample.velocity_m_per_s, *sample.orientation, sample.gripper_m]
            assert all(math.isfinite(number) for number in numbers)
            assert 0 <= sample.buttons < 1 << max(info.buttons, 0) if info.buttons else sample.buttons == 0
            enabled.write([0.0] * len(info.axes))
        enabled.close()

    def test_positions_stream_before_force_is_enabled(self, driver: AnyDriver) -> None:
        driver.open()
        assert all(math.isfinite(position) for position in driver.read().position_m)
        driver.close()

    def test_a_declared_clock_or_count_is_there_and_never_runs_back(self, enabled: AnyDriver) -> None:
        seen = [(sample.time_ns, sample.sequence) for sample in (enabled.read() for _ in range(5))]
        declared = (enabled.info.has_clock, enabled.info.has_sequence)
        for is_there, counts in zip(declared, zip(*seen, strict=True), strict=True):
            if is_there:
                assert counts[0] >= 0
                assert list(counts) == sorted(counts)
            else:
                assert set(counts) == {-1}
        enabled.close()

    def test_each_step_of_life_may_be_called_twice(self, driver: AnyDriver) -> None:
        assert driver.open() is driver.open()
        states = []
        for step in (driver.enable, driver.disable, driver.close):
            step()
            step()
            states.append(driver.state)
        assert states == [DriverState.ENABLED, DriverState.OPEN, DriverState.CLOSED]

    def test_it_can_be_opened_again_after_it_was_closed(self, driver: AnyDriver) -> None:
        for _ in range(2):
            driver.open()
            driver.enable()
            driver.read()
            driver.write(self.a_force(driver))
            driver.close()
        assert driver.state is DriverState.CLOSED

    def test_a_closed_device_neither_reads_nor_writes_nor_says_what_it_is(self, driver: AnyDriver) -> None:
        for _ in range(2):
            with pytest.raises(DriverStateError):
                driver.read()
            with pytest.raises(DriverStateError):
                driver.write([0.0])
            with pytest.raises(DriverStateError):
                driver.enable()
            with pytest.raises(DriverStateError):
                driver.calibrate()
            with pytest.raises(DriverStateError):
                _ = driver.info
            driver.open()
            driver.close()

    def test_closing_or_disabling_what_was_never_opened_is_nothing(self, driver: AnyDriver) -> None:
        driver.disable()
        driver.close()
        assert driver.state is DriverState.CLOSED

    def test_an_open_device_takes_no_force_until_it_is_enabled(self, driver: AnyDriver) -> None:
        driver.open()
        driver.read()
        with pytest.raises(DriverStateError):
            driver.write(self.a_force(driver))
        assert not any(self.force_on_device(driver))
        driver.close()

    def test_force_is_zero_from_enable_until_the_first_write(self, driver: AnyDriver) -> None:
        driver.open()
        driver.enable()
        driver.read()
        assert not any(self.force_on_device(driver))
        driver.close()

    def test_it_says_soon_that_forces_flow_and_then_they_do(self, driver: AnyDriver) -> None:
        """A loop writes nothing but zero before it does, and arms nothing."""
        driver.open()
        driver.enable()
        end_s = time.monotonic() + FOLLOWS_S
        while not driver.forces_flow:
            assert time.monotonic() < end_s
            driver.read()
            driver.write([0.0] * len(driver.info.axes))
        force = self.a_force(driver)
        for _ in range(3):
            driver.read()
            driver.write(force)
        assert list(self.force_on_device(driver)) == pytest.approx(force, rel=0.01)
        driver.close()

    def test_a_written_force_arrives(self, enabled: AnyDriver) -> None:
        for sign in (1.0, -1.0):
            force = [sign * newton for newton in self.a_force(enabled)]
            for _ in range(3):
                enabled.read()
                enabled.write(force)
            assert list(self.force_on_device(enabled)) == pytest.approx(force, rel=0.01)
        enabled.close()

    @pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e200])
    def test_a_force_that_is_no_force_is_refused_and_the_last_one_stays(self, enabled: AnyDriver, bad: float) -> None:
        axes = len(enabled.info.axes)
        force = self.a_force(enabled)
        enabled.write(force)
        for axis in range(axes):
            with pytest.raises(DriverStateError):
                enabled.write([bad if at == axis else 0.0 for at in range(axes)])
        assert list(self.force_on_device(enabled)) == pytest.approx(force, rel=0.01)
        enabled.close()

    def test_a_force_beyond_the_limit_of_a_real_device_is_refused(self, enabled: AnyDriver) -> None:
        info = enabled.info
        over = [1.001 * info.max_force_n] + [0.0] * (len(info.axes) - 1)
        if info.simulated:
            if math.isfinite(info.max_force_n):
                enabled.write(over)  # saturates by itself
                assert abs(self.force_on_device(enabled)[0]) <= info.max_force_n
        else:
            with pytest.raises(DriverStateError):
                enabled.write(over)
            # All axes together: each within the limit, the magnitude beyond it.
            if len(info.axes) > 1:
                with pytest.raises(DriverStateError):
                    enabled.write([0.99 * info.max_force_n] * len(info.axes))
        enabled.close()

    def test_a_force_for_another_number_of_axes_is_refused(self, enabled: AnyDriver) -> None:
        axes = len(enabled.info.axes)
        for wrong in ([], [0.0] * (axes + 1), [0.0] * (axes - 1)):
            with pytest.raises(DriverStateError):
                enabled.write(wrong)
        enabled.close()

    def test_disable_takes_the_force_away(self, enabled: AnyDriver) -> None:
        enabled.read()
        enabled.write(self.a_force(enabled))
        enabled.disable()
        assert enabled.force_left == ""
        assert not any(self.force_on_device(enabled))
        with pytest.raises(DriverStateError):
            enabled.write(self.a_force(enabled))
        enabled.close()

    def test_force_is_zero_again_after_disable_and_enable(self, enabled: AnyDriver) -> None:
        enabled.write(self.a_force(enabled))
        enabled.disable()
        enabled.enable()
        enabled.read()
        assert not any(self.force_on_device(enabled))
        enabled.close()

    def test_calibration_is_refused_while_force_is_enabled(self, enabled: AnyDriver) -> None:
        with pytest.raises(DriverStateError):
            enabled.calibrate()
        assert enabled.state is DriverState.ENABLED
        enabled.close()

    def test_a_with_block_opens_the_device_and_gives_it_back_without_force(self, driver: AnyDriver) -> None:
        """Also when the block fails while the device pushes."""
        with pytest.raises(ZeroDivisionError):
            self._fail_inside(driver)
        assert driver.state is DriverState.CLOSED
        with driver:
            driver.read()
            assert not any(self.force_on_device(driver))
        assert driver.state is DriverState.CLOSED

    def _fail_inside(self, driver: AnyDriver) -> None:
        """Leave a `with` block by an error while the device pushes."""
        with driver as opened:
            assert opened is driver
            assert driver.state is DriverState.OPEN
            driver.enable()
            driver.read()
            driver.write(self.a_force(driver))
            raise ZeroDivisionError
