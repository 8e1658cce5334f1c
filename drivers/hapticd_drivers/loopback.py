"""The loopback: a simulated device in the place of a real one, always there and never dangerous."""

from __future__ import annotations

from hapticd.device import FoundDevice
from hapticd.simulation.driver import SimulatedDriver
from hapticd.simulation.options import SimulationOptions


class Loopback(SimulatedDriver):
    """The simulated one-axis device of `hapticd.simulation`."""

    NAME = "loopback"

    @classmethod
    def find(cls, options: SimulationOptions | None = None) -> list[FoundDevice]:
        """The model, which is always there."""
        return [FoundDevice(f"{(options or cls.Options()).model} model, simulated", "")]
