"""The last word on force: finite, within limits, ramped at every transition, latched after a fault.

The guard reduces all contacts alike by one share, so that what they applied still sums to what was sent. Force limits
hold always; ramps only at transitions, since a slew limit inside contact would itself be a controller.
"""

from __future__ import annotations

import enum
import math
import sys
from collections.abc import Sequence
from typing import Any

from hapticd.config.safety import SafetyConfig
from hapticd.device import DeviceInfo
from hapticd.errors import ConfigError

DEFAULT_MAX_SPEED_M_PER_S = 2.0
"""Over-speed stop of a real device, where the configuration names none [m/s]."""

BLIND_RAMP_S = 0.01
"""How long the last force is let out when the position is no longer known [s].

Without a position there is no wall, only a constant push; at 12 N and 0.25 kg this bounds it to about 0.25 m/s.
"""

MOST_LONGER = 10.0
"""So many ramps may a transition last whose contact holds more than the limit against another one."""


class BlendFields:
    """The scalar fields that a blend of one contact's force keeps, `start_blend` to `blended`."""

    blending: bool
    blend_tick: float  # periods done, -1 or less before the first tick
    blend_ticks: float  # periods from the old force to the new one
    blend_from_n: float  # the old force, held
    blend_from_x_m: float  # where it was applied
    blend_limit_n: float  # largest force that the new one comes to within these


def start_blend(state: Any, from_n: float, x_m: float, limit_n: float, ticks: int) -> None:
    """Begin a transition of one contact, from the force that is applied inside the wall.

    One that holds more than the limit, against another that does, may go on to as much and takes so much longer: what
    it lets go is the other's force on the device. It is over within `MOST_LONGER` ramps, since the other may go first.

    Args:
        state: an object with the fields of `BlendFields`.
        from_n: force applied now, outward [N].
        x_m: where, relative to the wall, < 0 [m].
        limit_n: largest force that one contact may come to [N].
        ticks: how many periods it takes.
    """
    state.blending = True
    state.blend_tick = -1.0
    held_n = abs(from_n)
    longer = min(held_n / limit_n, MOST_LONGER) if 0.0 < limit_n < held_n else 1.0
    state.blend_ticks = longer * ticks
    state.blend_from_n = from_n
    state.blend_from_x_m = x_m
    state.blend_limit_n = longer * limit_n


def begin_late(state: Any, periods: float) -> None:
    """Delay a transition whose first tick is still to come.

    Args:
        state: the fields of `BlendFields`.
        periods: from the last tick on, in periods of the loop; inf: it begins with its first tick, however late.
    """
    if state.blending and state.blend_tick < 0.0:
        state.blend_tick = -1.0 - periods


def blended(state: Any, x_m: float, force_n: float, periods: float) -> float:
    """The force of one tick of a transition [N]; call it once a tick while `state.blending` and in contact.

        F = (1 - w) F_old min(1, x / x_old) + w F_new,     w = 0, 1/N, 2/N ... 1 where no tick is late

    The old force is held, and let out with the depth, so that nothing is left of it where contact ends. The new one
    is taken up to the limit only: a wall that asks for ten times the limit must not come in ten times as fast. When
    w is 1 that bound opens at the same rate, by the limit over each N ticks, until the force is within it: that matters
    only where several walls share the limit.

    From tick to tick F changes by at most 2 limit / N, and by what the motion changes of F_new and of x / x_old.

    Args:
        state: the fields of `BlendFields`.
        x_m: position relative to the wall, < 0 [m].
        force_n: the new force [N].
        periods: time since the last tick, in periods of the loop; more than one where deadlines were skipped.
    """
    done: float = state.blend_tick + periods
    if not done >= 0.0:  # the first tick comes sooner than that: begun it has all the same
        done = 0.0
    state.blend_tick = done
    weight: float = done / state.blend_ticks
    reach_n: float = state.blend_limit_n
    if weight >= 1.0:
        reach_n = reach_n * weight
        if -reach_n <= force_n <= reach_n:
            state.blending = False
            return force_n
    if force_n > reach_n:
        force_n = reach_n
    elif force_n < -reach_n:
        force_n = -reach_n
    if weight >= 1.0:
        return force_n
    old_n: float = state.blend_from_n
    if x_m > state.blend_from_x_m:
        old_n = old_n * (x_m / state.blend_from_x_m)
    return (1.0 - weight) * old_n + weight * force_n


def blended_again(state: Any, x_m: float, force_n: float, periods: float) -> float:
    """The same at a tick without a new sample; a transition begins with the first one after the change.

    What to go over to is not known before. Where samples are further apart than the transition takes, it would be over
    by then, and the new force come all at once.
    """
    if state.blend_tick < 0.0:
        from_n: float = state.blend_from_n
        return from_n
    return blended(state, x_m, force_n, periods)


class Mode(enum.IntEnum):
    """What the guard lets through."""

    DISARMED = 0
    ARMED = 1
    RELEASING = 2


_DISARMED, _ARMED = Mode.DISARMED, Mode.ARMED  # Python 3.11 takes 0.1 us to look a member up, each time


class Guard:
    """Force limits and the armed, releasing and latched states.

    Args:
        safety: the [safety] table.
        info: what the device declares.

    Attributes:
        mode: what is let through.
        gain: how far a release has come, 1 armed to 0 disarmed.
        latched: stopped by a fault until `clear`.
        max_force_n, max_axis_n: force limits now, magnitude and along one axis [N]; `inf` where there is none.
        limit_n: the smaller one, largest force of a single contact [N].
        max_speed_m_per_s: over-speed stop [m/s]; `inf` in simulation.
        limited: whether the last force was reduced by a limit.
        changing: a limit or the gain is on its way.

    Raises:
        ConfigError: the simulation profile on a real device, or a limit above the device's own.
    """

    __slots__ = (
        "_axis_goal_n",
        "_axis_rate",
        "_force_goal_n",
        "_force_rate",
        "_late_s",
        "_max_squared",
        "_ramp_s",
        "changing",
        "gain",
        "latched",
        "limit_n",
        "limited",
        "max_axis_n",
        "max_force_n",
        "max_speed_m_per_s",
        "mode",
    )

    def __init__(self, safety: SafetyConfig, info: DeviceInfo) -> None:
        self.latched = False
        self._late_s = 0.0  # of the next tick's time, what had passed when the limits began to move
        self._ramp_s = safety.ramp_s
        self.max_force_n, self.max_axis_n, self.max_speed_m_per_s = limits(safety, info)
        self._aim(self.max_force_n, self.max_axis_n, safety.ramp_s)
        self.drop()

    def configure(self, safety: SafetyConfig, info: DeviceInfo, force_n: Sequence[float] = ()) -> None:
        """Take other limits; the force limits move there by a ramp.

        Args:
            safety: the [safety] table.
            info: what the device declares.
            force_n: what is applied now, one element an axis [N].

        Raises:
            ConfigError: the simulation profile on a real device, or a limit above the device's own.
        """
        goal_n, goal_axis_n, self.max_speed_m_per_s = limits(safety, info)
        # Coming down, what is not in use of a limit goes at once, and what is in use by the ramp. A limit counts before
        # the gain of a release.
        used_n = [newton / self.gain for newton in force_n] if self.gain > 0.0 else [0.0]
        self.max_force_n = min(self.max_force_n, max(goal_n, math.hypot(*used_n)))
        self.max_axis_n = min(self.max_axis_n, max(goal_axis_n, *map(abs, used_n), 0.0))
        self._aim(goal_n, goal_axis_n, safety.ramp_s)

    def begin_late(self, late_s: float) -> None:
        """Have limits that are to move begin so long after the last tick, and not right with it [s]."""
        if self.changing:
            self._late_s = late_s

    def arm(self) -> bool:
        """Let forces through from now on; False while latched. The caller blends contacts in."""
        if self.latched:
            return False
        self.mode = Mode.ARMED
        self.gain = 1.0
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
            self.changing = True
        elif self.mode is Mode.RELEASING:
            self._ramp_s = min(self._ramp_s, ramp_s)

    def drop(self) -> None:
        """Be disarmed at once, for a force that has already been let out."""
        self.mode = Mode.DISARMED
        self.gain = 0.0
        self.limited = False
        self.changing = True

    def clear(self) -> None:
        """Forget the fault; the device stays disarmed until armed."""
        self.latched = False

    def reduce(self, force_n: list[float], dt_s: float) -> float:
        """Reduce a force, in place, to what is let through.

        A force that is not a finite number becomes zero, and the guard stops and latches.

        Args:
            force_n: force asked for along each axis [N].
            dt_s: time that a tick counts for in a ramp [s].

        Returns:
            The share that is left, 0 to 1, the same for every axis and contact.
        """
        if self.changing:
            self._change(dt_s)
        share = 1.0
        squared = 0.0
        max_axis_n = self.max_axis_n
        for newton in force_n:
            squared += newton * newton
            if newton > max_axis_n or newton < -max_axis_n:
                share = min(share, max_axis_n / abs(newton))
        if not squared <= self._max_squared:  # true for NaN as well
            if squared < math.inf:
                share = min(share, self.max_force_n / math.sqrt(squared))
            else:
                self.latched = True
                self.drop()
        self.limited = share < 1.0
        if self.mode is not _ARMED:
            if self.mode is _DISARMED:
                self.limited = False
                for axis in range(len(force_n)):
                    force_n[axis] = 0.0
                return 0.0
            share *= self.gain
        if share != 1.0:
            for axis in range(len(force_n)):
                force_n[axis] *= share
        return share

    def _aim(self, goal_n: float, goal_axis_n: float, ramp_s: float) -> None:
        self._force_goal_n = goal_n
        self._axis_goal_n = goal_axis_n
        self._force_rate = _rate(self.max_force_n, goal_n, ramp_s)
        self._axis_rate = _rate(self.max_axis_n, goal_axis_n, ramp_s)
        self._take_limits()
        self.changing = True

    def _take_limits(self) -> None:
        self.limit_n = min(self.max_force_n, self.max_axis_n)
        self._max_squared = min(self.max_force_n * self.max_force_n, sys.float_info.max)

    def _change(self, dt_s: float) -> None:
        """Move what is under way by one tick: force limits, a release."""
        moving = False
        moved_s = max(0.0, dt_s - self._late_s)
        self._late_s = 0.0
        if self.max_force_n != self._force_goal_n:
            self.max_force_n = _towards(self.max_force_n, self._force_goal_n, self._force_rate * moved_s)
            moving = True
        if self.max_axis_n != self._axis_goal_n:
            self.max_axis_n = _towards(self.max_axis_n, self._axis_goal_n, self._axis_rate * moved_s)
            moving = True
        if moving:
            self._take_limits()
        if self.mode is Mode.RELEASING:
            self.gain = let_out(self.gain, self._ramp_s, dt_s)
            if self.gain == 0.0:
                self.drop()
        self.changing = moving or self.mode is Mode.RELEASING


def let_out(gain: float, ramp_s: float, dt_s: float) -> float:
    """What a ramp to zero leaves of a force after a tick.

    What is written now is held until the next write, so that the ramp is over already where that one would come too
    late.

    Args:
        gain: what it left before, 0 to 1.
        ramp_s: time from full force to none [s].
        dt_s: time since the last tick, and as far as is known until the next [s].
    """
    if ramp_s <= dt_s:
        return 0.0
    gain -= dt_s / ramp_s
    return gain if gain * ramp_s >= dt_s * (1.0 - 1e-6) else 0.0


def limits(safety: SafetyConfig, info: DeviceInfo) -> tuple[float, float, float]:
    """Force limit, limit along one axis [N] and over-speed stop [m/s] of a configuration on a device.

    Raises:
        ConfigError: the simulation profile on a real device, or a limit above the device's own.
    """
    if safety.profile == "simulation":
        if not info.simulated:
            raise ConfigError(
                f'safety.profile = "simulation": {info.model} is a real device; its force limits stay in force'
            )
        return info.max_force_n, info.max_force_n, math.inf  # beyond that it saturates: no force, and none in the books
    max_force_n = info.max_force_n if safety.max_force_n is None else safety.max_force_n
    if not max_force_n <= info.max_force_n:
        raise ConfigError(f"safety.max_force_n = {max_force_n:g}: {info.model} takes at most {info.max_force_n:g} N")
    if not (max_force_n < math.inf or info.simulated):
        raise ConfigError(f"safety.max_force_n: {info.model} is a real device and declares no limit; it needs one")
    max_axis_n = max_force_n if safety.max_axis_force_n is None else safety.max_axis_force_n
    max_speed_m_per_s = safety.max_speed_m_per_s
    if max_speed_m_per_s is None:
        max_speed_m_per_s = math.inf if info.simulated else DEFAULT_MAX_SPEED_M_PER_S
    return max_force_n, max_axis_n, max_speed_m_per_s


def _rate(now: float, goal: float, ramp_s: float) -> float:
    return 0.0 if now == goal else abs(goal - now) / ramp_s


def _towards(now: float, goal: float, step: float) -> float:
    return min(goal, now + step) if goal > now else max(goal, now - step)
