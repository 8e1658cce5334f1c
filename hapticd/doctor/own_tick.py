"""The tick that a configuration asks for, where its device is not open."""

from __future__ import annotations

import math

from hapticd.config.loading import LoadedConfig
from hapticd.device import DeviceInfo
from hapticd.tick.assemble import make_tick
from hapticd.tick.tick import ControlTick

_AXES = ("x", "y", "z")
_RESOLUTION_M = 1e-5
"""Of usual devices."""


def own_tick(config: LoadedConfig) -> ControlTick:
    """The tick of a configuration, on a device without limits.

    It has three axes where the driver's options name no other number: how many there are is known once it is open, and
    a tick on fewer computes for less.

    Raises:
        ConfigError: the scene fits no such device.
    """
    axes = _axes(config)
    info = DeviceInfo(
        model="no device",
        serial="",
        axes=axes,
        max_force_n=math.inf,
        resolution_m=_RESOLUTION_M,
        workspace_m=((-math.inf, math.inf),) * len(axes),
        nominal_rate_hz=config.config.loop.rate_hz,
        safe_damping_n_s_per_m=0.0,
        host_silence_ms=0.0,
        simulated=True,
        has_velocity=True,
        has_clock=True,
    )
    return make_tick(config, info)


def _axes(config: LoadedConfig) -> tuple[str, ...]:
    named = getattr(config.options, "axes", ())
    return _AXES[: len(named) if isinstance(named, tuple) else named] or _AXES
