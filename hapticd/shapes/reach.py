"""Which solids the device may touch soon; the others cost one comparison together."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

from hapticd.shapes.solid import Proxy


class Nearby:
    """The solids in reach, looked up only when the device has gone as far as to the nearest of the others.

    Args:
        proxies: all of them.
    """

    __slots__ = ("_free_m2", "_proxies", "_x", "_y", "_z")

    def __init__(self, proxies: Sequence[Proxy]) -> None:
        self._proxies = list(proxies)
        self.reset()

    def reset(self) -> None:
        """Look anew at the next tick: something has moved."""
        self._x = self._y = self._z = 0.0
        self._free_m2 = -1.0

    def moved_out(self, x: float, y: float, z: float) -> bool:
        """Whether the device has left the ball in which nothing else comes into reach."""
        x -= self._x
        y -= self._y
        z -= self._z
        return x * x + y * y + z * z > self._free_m2

    def look(self, x: float, y: float, z: float) -> list[int]:
        """Indices of the solids in reach or touched, from here on until `moved_out`."""
        found = []
        least_m = 1e3
        for at, proxy in enumerate(self._proxies):
            free_m = slack_m(proxy, x, y, z)
            if free_m <= proxy.margin_m or proxy.touching:
                found.append(at)
            elif free_m < least_m:
                least_m = free_m
        self.stay(x, y, z, least_m)
        return found

    def stay(self, x: float, y: float, z: float, least_m: float) -> None:
        """Take what is in reach here for what is in reach within a ball, of a radius [m], from now on."""
        self._x = x
        self._y = y
        self._z = z
        self._free_m2 = least_m * least_m


def slack_m(proxy: Proxy, x: float, y: float, z: float) -> float:
    """How far the device can go at least before it is in reach of a solid [m]; below 0 in reach."""
    linear = proxy.reach_x * x + proxy.reach_y * y + proxy.reach_z * z
    if proxy.reach_w == 0.0:
        return linear - proxy.reach_limit
    square = x * x + y * y + z * z
    centre_m2 = 0.25 * (proxy.reach_x * proxy.reach_x + proxy.reach_y * proxy.reach_y + proxy.reach_z * proxy.reach_z)
    if proxy.reach_w > 0.0:
        return sqrt(max(0.0, square + linear + centre_m2)) - sqrt(proxy.reach_limit + centre_m2)
    return sqrt(max(0.0, centre_m2 - proxy.reach_limit)) - sqrt(max(0.0, square - linear + centre_m2))
