"""Counts to metres and newtons to micronewtons, along one axis."""

from __future__ import annotations

from hapticd.errors import ConfigError
from hapticd_drivers.rig.messages import Axis
from hapticd_drivers.rig.options import AxisOptions

_PM_PER_M = 1e12
_UN = 1e6
_MOST_COUNTS = (1 << 31) - 1


class AxisMap:
    """How one axis of a rig lies in space.

        x = x_home + c (n - n_home)         c < 0 when positions grow where counts shrink

    Args:
        axis: what the rig says.
        options: what the configuration says.

    Attributes:
        count_m: change of position from one count to the next [m].
        lowest_m, highest_m: ends of the travel [m].
        max_force_n: largest force that the handle can give [N].

    Raises:
        ConfigError: neither says what is needed.
    """

    def __init__(self, axis: Axis, options: AxisOptions) -> None:
        key = f"device.options.axes[{axis.axis}]"
        size_m = options.count_m or axis.count_pm / _PM_PER_M
        if not size_m:
            raise ConfigError(f"{key}.count_m is not set, and the rig does not know what a count is at its handle")
        self.count_m = -size_m if options.reversed else size_m
        self.home_m = options.home_m
        ends_m = sorted((self.home_m + axis.lowest * self.count_m, self.home_m + axis.highest * self.count_m))
        if axis.lowest >= axis.highest and (options.lowest_m is None or options.highest_m is None):
            raise ConfigError(f"{key}.lowest_m and highest_m are not set, and the rig does not know its travel")
        self.lowest_m = ends_m[0] if options.lowest_m is None else options.lowest_m
        self.highest_m = ends_m[1] if options.highest_m is None else options.highest_m
        if self.lowest_m >= self.highest_m:
            raise ConfigError(
                f"{key}.lowest_m = {self.lowest_m:g}: must be below the upper end of the travel, {self.highest_m:g} m"
            )
        self.max_force_n = axis.max_force_un / _UN * options.force_scale
        if not self.max_force_n:
            raise ConfigError(f"{key}: the rig's largest force is 0")
        pushes = -1.0 if options.reversed is not options.motor_reversed else 1.0
        self._un_per_n = pushes * _UN / options.force_scale
        self._max_un = min(axis.max_force_un, _MOST_COUNTS)
        self._zero_m = 0.0
        self.put_home(axis.home)

    def put_home(self, count: int) -> None:
        """The rig's home is at this count."""
        self._zero_m = self.home_m - count * self.count_m

    def put_middle(self, count: int) -> None:
        """Nobody knows where home is: take this count for the middle of the travel."""
        self._zero_m = 0.5 * (self.lowest_m + self.highest_m) - count * self.count_m

    def home_if(self, count: int, at_m: float) -> int:
        """Count of the home when the position at a count is known."""
        return count - round((at_m - self.home_m) / self.count_m)

    def position_m(self, count: int) -> float:
        """Position at a count [m]."""
        return self._zero_m + count * self.count_m

    def force_un(self, force_n: float) -> int:
        """What to tell the rig for a force on the handle [uN]."""
        return max(-self._max_un, min(self._max_un, round(force_n * self._un_per_n)))
