"""The tick that a configuration asks for, put together from its parts."""

from __future__ import annotations

from functools import partial
from typing import Any

from hapticd.config.loading import LoadedConfig
from hapticd.config.plugin_tables import PORT_LAW
from hapticd.config.remote import COME_IN_S, PortLimits
from hapticd.device import DeviceInfo
from hapticd.errors import ConfigError
from hapticd.tick.contact import RunningLaw
from hapticd.tick.guard import Guard
from hapticd.tick.motion import Motion
from hapticd.tick.remote.coupling import Coupling
from hapticd.tick.remote.port_site import PortSite
from hapticd.tick.remote.remote_object import RemoteContact
from hapticd.tick.remote.streamed_force import StreamedForce
from hapticd.tick.space.tick import SpaceTick
from hapticd.tick.tick import ControlTick


def make_tick(config: LoadedConfig, info: DeviceInfo) -> ControlTick:
    """The tick that a configuration asks for on a device.

    Raises:
        ConfigError: scene or limits do not fit the device.
    """
    settings = config.config
    try:
        parts = (
            settings.scene,
            settings.velocity,
            Guard(settings.safety, info),
            info,
            lambda: RunningLaw(config.law, config.params),
            settings.loop.period_s,
            settings.safety.ramp_s,
            partial(_make_port, config),
        )
        return SpaceTick(*parts, RemoteContact) if len(info.axes) == 3 else ControlTick(*parts)
    except ConfigError as error:
        raise ConfigError(*(f"{config.path}: {problem}" for problem in error.problems)) from None


def place_device(config: LoadedConfig, driver: Any) -> None:
    """Tell a simulated device where the first wall is."""
    walls = config.config.scene.walls
    if walls:
        driver.place(walls[0].position_m, 1 if walls[0].free_side == "positive" else -1)


def _make_port(
    config: LoadedConfig, limits: PortLimits, motion: Motion, resolution_m: float, ramp_s: float
) -> Coupling | StreamedForce:
    """A coupling or a force, under the law of [remote]."""
    kind = Coupling if limits.kind == "coupling" else StreamedForce
    law = RunningLaw(config.port_law, config.port_params)
    come_in_s = COME_IN_S if config.config.remote.law == PORT_LAW else 0.0
    return kind(limits, PortSite(motion, law.another, resolution_m, config.config.loop.period_s, ramp_s, come_in_s))
