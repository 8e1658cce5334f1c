"""Virtual walls: a plane across one axis, a spring behind it, a damper that may be active.

A wall is compiled from its configuration into the shortest evaluation that it needs: one without damping evaluates no
damping, one without changes looks at no clock.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from hapticd.config.objects import ObjectConfig
from hapticd.config.timing import first_tick
from hapticd.config.walls import WallConfig
from hapticd.device import DeviceInfo
from hapticd.errors import ConfigError


class Wall:
    """One wall, ready to be evaluated each tick.

        F = -k x - b v   for x < 0, else 0         (the paper's eq. 5, with the wall's own damping)

    Args:
        config: the wall's table.
        axis: index of its axis in the device's positions.
        period_s: time between ticks, to count `at_s` in ticks [s].

    Attributes:
        keys: what the table says, quick to compare.
        axis: index of the axis.
        outward: +1.0 when the free side is the positive one, else -1.0.
        position_m: the plane on the axis [m].
        stiffness_n_per_m, damping_n_s_per_m: in force now.
        spring_n: the spring's part of the last force [N].
        changes_left: whether a change is still to come; then `pass_time` must be called at each tick.
    """

    __slots__ = (
        "_changes",
        "_periods",
        "axis",
        "changes_left",
        "config",
        "damping_n_s_per_m",
        "keys",
        "outward",
        "position_m",
        "spring_n",
        "stiffness_n_per_m",
    )

    def __init__(self, config: WallConfig, axis: int, period_s: float) -> None:
        self.config = config
        self.keys = tuple(config.__dict__.values())
        self.axis = axis
        self.outward = 1.0 if config.free_side == "positive" else -1.0
        self.position_m = config.position_m
        self.stiffness_n_per_m = config.stiffness_n_per_m
        self.damping_n_s_per_m = config.damping_n_s_per_m
        self.spring_n = 0.0
        self._periods = -1.0  # since the first tick
        self._changes = [(first_tick(change.at_s, period_s), change) for change in config.changes]
        self.changes_left = bool(self._changes)

    def pass_time(self, periods: float) -> bool:
        """Bring changes into force whose time has come; whether there were any.

        Args:
            periods: time since the last tick, in periods of the loop.
        """
        self._periods += periods
        changed = False
        while self._changes and self._periods >= self._changes[0][0]:
            _, change = self._changes.pop(0)
            changed = True
            if change.stiffness_n_per_m is not None:
                self.stiffness_n_per_m = change.stiffness_n_per_m
            if change.damping_n_s_per_m is not None:
                self.damping_n_s_per_m = change.damping_n_s_per_m
        self.changes_left = bool(self._changes)
        return changed

    def force(self, x_m: float, velocity_m_per_s: float) -> float:
        """Force on the device inside the wall, positive pushes out [N].

        Args:
            x_m: position relative to the wall, < 0 [m].
            velocity_m_per_s: along the outward normal [m/s].
        """
        self.spring_n = spring_n = -self.stiffness_n_per_m * x_m
        if self.damping_n_s_per_m == 0.0:
            return spring_n
        return spring_n - self.damping_n_s_per_m * velocity_m_per_s

    def stored_j(self, x_m: float, limit_n: float) -> float:
        """Energy in the spring [J]: k x^2 / 2, and force times depth where the guard's limit flattens it.

        Args:
            x_m: position relative to the wall [m].
            limit_n: largest force that the guard lets through [N].
        """
        if x_m >= 0.0:
            return 0.0
        spring_n = -self.stiffness_n_per_m * x_m
        if spring_n <= limit_n:
            return -0.5 * spring_n * x_m
        return limit_n * (-x_m - 0.5 * limit_n / self.stiffness_n_per_m)

    def let_go(self) -> None:
        """Be gone: without force from now on."""
        self.stiffness_n_per_m = self.damping_n_s_per_m = 0.0
        self._changes.clear()
        self.changes_left = False

    def same_wall(self, other: Wall) -> bool:
        """Whether the tables of the two say the same."""
        return self.keys == other.keys

    def same_place(self, other: Wall) -> bool:
        """Whether the two planes coincide, so that one may turn into the other under a hand."""
        return self.position_m == other.position_m and self.axis == other.axis and self.outward == other.outward


def check_objects(objects: Sequence[ObjectConfig], info: DeviceInfo) -> None:
    """Refuse objects on a device that is not in space.

    Raises:
        ConfigError: it has fewer than three axes.
    """
    if objects and len(info.axes) < 3:
        raise ConfigError(
            f'scene.objects[0] "{objects[0].name}": objects need three axes, and {info.model} has {len(info.axes)}'
        )


def compile_walls(walls: Iterable[WallConfig], info: DeviceInfo, period_s: float) -> list[Wall]:
    """Walls on the axes of a device.

    Raises:
        ConfigError: a wall on an axis that the device has not, or on two axes of a device that has one.
    """
    compiled = []
    placed = ""
    for index, config in enumerate(walls):
        if len(info.axes) == 1:
            placed = placed or config.axis
            if config.axis != placed:
                raise ConfigError(
                    f'scene.walls[{index}].axis = "{config.axis}": {info.model} has a single axis, and the first '
                    f'wall has put it on "{placed}"'
                )
            axis = 0
        elif config.axis in info.axes:
            axis = info.axes.index(config.axis)
        else:
            raise ConfigError(
                f'scene.walls[{index}].axis = "{config.axis}": {info.model} has only {", ".join(info.axes)}'
            )
        compiled.append(Wall(config, axis, period_s))
    return compiled
