"""In the simulation profile books and laws see the force that the device applies, and not one that it cannot."""

from __future__ import annotations

import pytest

from hapticd.config.loading import parse
from hapticd.driver import Driver
from hapticd.simulation.driver import SimulatedDriver
from hapticd.simulation.options import SimulationOptions
from hapticd.tick.assemble import make_tick, place_device
from hapticd.tick.tick import ControlTick
from hapticd_drivers.loopback import Loopback

PERIOD_S = 1e-3
PRESSED = """
[device.options]
model = "omega7"
resolution_m = 0.0
initial_position_m = 0.05
hand.force = {{ profile = "constant", newton = -4.0 }}
{device}
[[scene.walls]]
stiffness_n_per_m = 40000.0
[controller]
law = "{law}"
[safety]
profile = "simulation"
"""


def pressed(law: str = "none", device: str = "") -> tuple[ControlTick, SimulatedDriver]:
    """A fall into a wall that is too stiff for the device, so that it meets its largest force."""
    config = parse(PRESSED.format(law=law, device=device), "pressed")
    driver: Driver[SimulationOptions] = config.driver(config.options, PERIOD_S)
    assert isinstance(driver, Loopback)
    place_device(config, driver)
    tick = make_tick(config, driver.open())
    tick.start(driver.read())
    driver.enable()
    assert tick.arm()
    return tick, driver


@pytest.mark.parametrize("law", ["none", "tdpa", "energy-cycle", "ring-damping"])
def test_the_books_and_the_law_have_the_energy_that_really_flowed(law: str) -> None:
    """C13: the actuator applies a force from the write to the next sample, so its work is exact."""
    tick, driver = pressed(law)
    flowed_j, saturated = 0.0, 0
    contact = tick.contacts[0]
    for _ in range(1500):
        before_m = driver.model.x_m
        force_n = tick.step(driver.read(), PERIOD_S)
        flowed_j -= driver.model.applied_n * (driver.model.x_m - before_m)
        assert contact.ledger.energy_j == pytest.approx(flowed_j, abs=1e-9)
        driver.write(force_n)
        assert contact.tick.applied_n == force_n[0]
        saturated += abs(force_n[0]) == pytest.approx(12.0)
        assert abs(force_n[0]) <= 12.0 * (1.0 + 1e-12)
    assert saturated > 20


def test_a_device_that_never_saturates_is_asked_for_everything() -> None:
    tick, driver = pressed(device="max_force_n = 0.0")
    peak_n = 0.0
    for _ in range(500):
        force_n = tick.step(driver.read(), PERIOD_S)
        driver.write(force_n)
        peak_n = max(peak_n, abs(force_n[0]))
    assert peak_n > 30.0


def test_where_the_saturation_changes_the_largest_is_declared() -> None:
    for changes, largest_n in (
        ("[{ at_s = 1.0, max_force_n = 20.0 }]", 20.0),
        ("[{ at_s = 1.0, max_force_n = 3.0 }]", 12.0),
    ):
        tick, _ = pressed(device=f"changes = {changes}")
        assert tick.info.max_force_n == tick.guard.max_force_n == largest_n
    tick, _ = pressed(device="changes = [{ at_s = 1.0, max_force_n = 0.0 }]")
    assert tick.info.max_force_n == float("inf")
