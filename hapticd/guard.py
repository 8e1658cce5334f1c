"""The last word on force: finite, within limits, ramped at every transition, latched after a fault.

The guard reduces all contacts alike by one share, so that what they applied still sums to what was sent. Force limits
hold always; ramps only at transitions, since a slew limit inside contact would itself be a controller.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence

from hapticd.config.models import SafetyConfig
from hapticd.contracts.driver import DeviceInfo
from hapticd.contracts.errors import ConfigError

DEFAULT_MAX_SPEED_M_PER_S = 2.0
"""Over-speed stop of a real device, where the configuration names none [m/s]."""

BLIND_RAMP_S = 0.01
"""How long the last force is let out when the position is no longer known [s].

Without a position there is no wall, only a constant push; at 12 N and 0.25 kg this bounds it to about 0.25 m/s.
"""


class Mode(enum.IntEnum):
    """What the guard lets through."""

    DISARMED = 0
    ARMED = 1
    RELEASING = 2


class Guard:
    """Force limits and the armed, releasing and latched states.

    Args:
        safety: the [safety] table.
        info: what the device declares.

    Attributes:
        mode: what is let through.
        latched: stopped by a fault until `clear`.
        max_force_n: force magnitude limit [N]; `inf` in simulation.
        max_speed_m_per_s: over-speed stop [m/s]; `inf` in simulation.
        limited: whether the last force was reduced by a limit.

    Raises:
        ConfigError: the simulation profile on a real device, or a limit above the device's own.
    """

    __slots__ = ("_gain", "_max_axis_n", "_ramp_s", "limited", "latched", "max_force_n", "max_speed_m_per_s", "mode")

    def __init__(self, safety: SafetyConfig, info: DeviceInfo) -> None:
        self.latched = False
        self.limited = False
        self._ramp_s = safety.ramp_s
        self.drop()
        self.configure(safety, info)

    def configure(self, safety: SafetyConfig, info: DeviceInfo) -> None:
        """Take limits from the configuration and the device.

        Raises:
            ConfigError: the simulation profile on a real device, or a limit above the device's own.
        """
        if safety.profile == "simulation":
            if not info.simulated:
                raise ConfigError(
                    f'safety.profile = "simulation": {info.model} is a real device; its force limits stay in force'
                )
            self.max_force_n = self._max_axis_n = self.max_speed_m_per_s = math.inf
            return
        max_force_n = info.max_force_n if safety.max_force_n is None else safety.max_force_n
        if max_force_n > info.max_force_n:
            raise ConfigError(
                f"safety.max_force_n = {max_force_n:g}: {info.model} takes at most {info.max_force_n:g} N"
            )
        self.max_force_n = max_force_n
        self._max_axis_n = max_force_n if safety.max_axis_force_n is None else safety.max_axis_force_n
        if safety.max_speed_m_per_s is not None:
            self.max_speed_m_per_s = safety.max_speed_m_per_s
        else:
            self.max_speed_m_per_s = math.inf if info.simulated else DEFAULT_MAX_SPEED_M_PER_S

    def arm(self) -> bool:
        """Let forces through from now on; False while latched. The caller blends contacts in from zero."""
        if self.latched:
            return False
        self.mode = Mode.ARMED
        self._gain = 1.0
        return True

    def release(self, ramp_s: float, latch: bool = False) -> None:
        """Ramp the force to zero and stay disarmed.

        Args:
            ramp_s: time from full force to none [s]; a release under way is only ever made faster.
            latch: refuse to arm again until cleared.
        """
        self.latched = self.latched or latch
        if self.mode is Mode.ARMED:
            self.mode = Mode.RELEASING
            self._ramp_s = ramp_s
        elif self.mode is Mode.RELEASING:
            self._ramp_s = min(self._ramp_s, ramp_s)

    def drop(self) -> None:
        """Be disarmed at once, for a force that has already been let out."""
        self.mode = Mode.DISARMED
        self._gain = 0.0

    def clear(self) -> None:
        """Forget the fault; the device stays disarmed until armed."""
        self.latched = False

    def share(self, force_n: Sequence[float], dt_s: float) -> float:
        """How much of a force is let through, 0 to 1, the same for every axis and contact.

        Args:
            force_n: force asked for along each axis, finite [N].
            dt_s: time since the last tick [s].
        """
        if self.mode is not Mode.ARMED:
            if self.mode is Mode.DISARMED:
                return 0.0
            self._gain -= dt_s / self._ramp_s
            if self._gain <= 0.0:
                self.drop()
                return 0.0
        share = 1.0
        squared = 0.0
        max_axis_n = self._max_axis_n
        for newton in force_n:
            squared += newton * newton
            if newton > max_axis_n or newton < -max_axis_n:
                share = min(share, max_axis_n / abs(newton))
        if squared > self.max_force_n * self.max_force_n:
            share = min(share, self.max_force_n / math.sqrt(squared))
        self.limited = share < 1.0
        return share * self._gain
