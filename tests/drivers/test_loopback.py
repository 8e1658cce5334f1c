"""The loopback driver is the simulated device, number for number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import pytest

from hapticd.errors import DeviceFaultError, DeviceProtocolError
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from hapticd.testing.driver_contract import AnyDriver, DriverContract
from hapticd_drivers.loopback import Loopback

T = 1e-3
ROUGH = {
    "coulomb_n": 0.2,
    "noise_m": 2e-5,
    "force_delay_samples": 2,
    "bandwidth_hz": 300.0,
    "initial_position_m": 0.002,
    "hand": {"force": {"profile": "press-and-release", "newton": -4}, "stiffness_n_per_m": 80, "damping_n_s_per_m": 1},
    "changes": [{"at_s": 0.2, "viscous_n_s_per_m": -1}, {"at_s": 0.5, "mass_kg": 0.4}],
}


def loopback(**keys: Any) -> Loopback:
    return Loopback(SimulationOptions.model_validate(keys), T)


class TestLoopback(DriverContract):
    @pytest.fixture
    def driver(self) -> AnyDriver:
        return loopback()

    def force_on_device(self, driver: AnyDriver) -> Sequence[float]:
        assert isinstance(driver, Loopback)
        driver.read()  # the force acts over the period that a read ends
        driver.read()
        assert driver.model is not None
        return [driver.model.applied_n]


def wall(x_m: float) -> float:
    return -3000.0 * x_m if x_m < 0.0 else 0.0


@pytest.mark.parametrize(
    "keys", [{"initial_velocity_m_per_s": -0.2}, {"model": "paper-simulation", "initial_velocity_m_per_s": -0.1}, ROUGH]
)
@pytest.mark.parametrize(("wall_m", "outward"), [(0.0, 1), (0.0, -1), (0.03125, 1), (-0.5, -1)])
def test_the_driver_and_the_offline_device_give_the_same_numbers(
    keys: dict[str, Any], wall_m: float, outward: int
) -> None:
    driver = loopback(**keys)
    driver.place(wall_m, outward)
    driver.open()
    driver.enable()
    device = SimulatedDevice(SimulationOptions.model_validate(keys), T)
    sample = driver.read()
    for tick in range(1500):
        assert sample.position_m[0] == wall_m + outward * device.measured_m
        assert sample.time_ns == tick * 1_000_000
        assert sample.sequence == tick
        force_n = wall(device.measured_m)
        driver.write([outward * force_n])
        device.advance(force_n)
        sample = driver.read()
    assert device.x_m != 0.0


def test_the_first_sample_is_the_initial_state() -> None:
    driver = loopback(initial_position_m=0.004, initial_velocity_m_per_s=0.1)
    driver.place(0.1, -1)
    driver.open()
    assert driver.read().position_m == [pytest.approx(0.096)]
    assert driver.read().position_m[0] < 0.096


def test_a_force_acts_until_it_is_written_anew_and_a_missed_tick_is_none() -> None:
    """The model advances by executed ticks only: two runs agree whatever the host did in between."""
    once, again = loopback(), loopback()
    for driver in (once, again):
        driver.open()
        driver.enable()
        driver.read()
        driver.write([1.0])
    again._now_ns = lambda: 10**15
    assert [once.read().position_m[0] for _ in range(50)] == [again.read().position_m[0] for _ in range(50)]


def test_on_the_wall_clock_the_model_keeps_real_time() -> None:
    driver = loopback(clock="wall", viscous_n_s_per_m=0, resolution_m=0, initial_velocity_m_per_s=0.5)
    now = [5_000_000_000]
    driver._now_ns = lambda: now[0]
    driver.open()
    assert driver.read().time_ns == 0
    now[0] += 3_400_000
    assert driver.read().time_ns == 3_000_000
    now[0] += 500_000
    assert driver.read().time_ns == 3_000_000
    now[0] += 200_000
    sample = driver.read()
    assert sample.time_ns == 4_000_000
    assert sample.position_m[0] == pytest.approx(0.5 * 4e-3, rel=1e-12)
    now[0] += 60_000_000_000
    assert driver.read().time_ns == 1_004_000_000  # a host that was stopped makes up for a second, not a minute
    now[0] += 1_000_000
    assert driver.read().time_ns == 1_005_000_000


def test_a_model_that_flies_away_is_a_fault_and_not_a_number() -> None:
    driver = loopback(max_force_n=0, viscous_n_s_per_m=-100, initial_velocity_m_per_s=1)
    driver.open()

    def run() -> None:
        for _ in range(2000):
            assert math.isfinite(driver.read().position_m[0])

    with pytest.raises(DeviceFaultError, match="diverged"):
        run()


def test_a_hand_too_stiff_for_the_rate_is_refused_by_key() -> None:
    driver = loopback(coulomb_n=0.1, hand={"stiffness_n_per_m": 1e9})
    with pytest.raises(DeviceProtocolError, match=r"device\.options\.hand\.stiffness_n_per_m"):
        driver.open()


@pytest.mark.parametrize(("delay", "ceiling"), [(0, 2.0), (1, 0.829), (2, 0.536), (3, 0.399)])
def test_the_declared_damping_is_half_of_what_would_shake_the_device_or_less(delay: int, ceiling: float) -> None:
    driver = loopback(force_delay_samples=delay, mass_kg=0.3)
    info = driver.open()
    assert 0.2 * ceiling < info.safe_damping_n_s_per_m * T / 0.3 <= 0.5 * ceiling


@pytest.mark.parametrize("delay", [0, 1, 2, 3, 8])
def test_the_declared_damping_brings_the_device_to_rest(delay: int) -> None:
    driver = loopback(
        model="paper-simulation", force_delay_samples=delay, initial_velocity_m_per_s=1.0, initial_position_m=1.0
    )
    damping = driver.open().safe_damping_n_s_per_m
    driver.enable()
    last_m = driver.read().position_m[0]
    for _ in range(400):
        position_m = driver.read().position_m[0]
        driver.write([-damping * (position_m - last_m) / T])
        last_m, before_m = position_m, last_m
    assert abs(last_m - before_m) < 1e-9
