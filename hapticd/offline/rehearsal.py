"""A configuration on its simulated device, as fast as it goes: the daemon's tick without clock, process or telemetry.

The numbers are the daemon's to the last bit, tick by tick, since the parts are the same and the simulated device
advances by one period a tick whatever the host does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from hapticd.config.loading import LoadedConfig
from hapticd.errors import ConfigError, DriverError
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.driver import FARTHEST_M, SimulatedDriver
from hapticd.simulation.options import SimulationOptions
from hapticd.tick.assemble import make_tick, place_device
from hapticd.tick.guard import Mode

MakeDevice = Callable[[SimulationOptions, float], SimulatedDevice]
"""Makes the model of a device, given its options and the period [s]."""


class Rehearsal:
    """One run of a configuration offline.

    Args:
        loaded: the configuration.
        options: of its device; None: the configuration's own.
        make_device: makes the device model.

    Attributes:
        model: the simulated device.
        tick: the daemon's tick on it.
        fault: why the daemon would have stopped, once it is known; None as long as it would not.
        diverged: whether the model left all bounds.

    Raises:
        ConfigError: the configuration is not one for a simulated device.
    """

    def __init__(
        self,
        loaded: LoadedConfig,
        options: SimulationOptions | None = None,
        make_device: MakeDevice | None = None,
    ) -> None:
        wanted = simulation_options(loaded) if options is None else options
        loaded = replace(loaded, options=wanted)
        self.period_s = loaded.config.loop.period_s
        self.fault: str | None = None
        self.diverged = False
        driver = loaded.driver(wanted, self.period_s)
        assert isinstance(driver, SimulatedDriver)
        if make_device is not None:
            driver.make_model = make_device
        self._driver = driver
        place_device(loaded, self._driver)
        self._driver.open()
        try:
            self.model = self._driver.model
            self.tick = make_tick(loaded, self._driver.info)
        except BaseException:
            self._driver.close()
            raise

    def run(self, ticks: int) -> Iterator[int]:
        """Run, and stop after each tick; its number is given. Ends early when the model has diverged."""
        driver, tick = self._driver, self.tick
        guard = tick.guard
        try:
            tick.start(driver.read())
            driver.enable()
            tick.arm()
            for count in range(ticks):
                sample = driver.read()
                force_n = tick.step(sample, self.period_s)
                if guard.mode is not Mode.DISARMED:
                    driver.write(force_n)
                else:
                    driver.disable()
                if tick.fault:
                    self.fault = self.fault or f"{count * self.period_s:g} s: {tick.fault_text}"
                    tick.fault = 0
                yield count
        except DriverError as error:
            self.fault = self.fault or str(error)
            self.diverged = not abs(self.model.measured_m) < FARTHEST_M
        finally:
            driver.close()


def simulation_options(loaded: LoadedConfig) -> SimulationOptions:
    """The device model of a configuration that can run offline.

    Raises:
        ConfigError: it is not one for a simulated device, or not for one that counts ticks.
    """
    if not (isinstance(loaded.options, SimulationOptions) and issubclass(loaded.driver, SimulatedDriver)):
        raise ConfigError(
            f'{loaded.path}: device.driver = "{loaded.config.device.driver}": only a simulated device runs offline, '
            'such as "loopback"'
        )
    if loaded.options.clock != "ticks":
        raise ConfigError(f'{loaded.path}: device.options.clock = "{loaded.options.clock}": must be "ticks" offline')
    return loaded.options
