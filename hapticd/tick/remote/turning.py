"""How a followed object is turned: quaternions w x y z, and the way from one to another as a rotation vector."""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, inf, sin, sqrt

from hapticd.tick.remote.follower import Follower

Quaternion = tuple[float, float, float, float]


class Turning:
    """An orientation that goes after a client's, without a jump and no faster than a limit.

    What is left to turn is a rotation vector from where it was at the last update, along which a `Follower` goes.

    Args:
        orientation: to begin with, of any length.
        max_turning_rad_per_s: how fast it may turn [rad/s].
        hold_s: how long it goes on with an angular velocity that was said [s].

    Attributes:
        follower: of the rotation vector.
        now: the orientation, of length 1.
    """

    __slots__ = ("_from", "follower", "now")

    def __init__(self, orientation: Sequence[float], max_turning_rad_per_s: float, hold_s: float) -> None:
        self.follower = Follower(3, max_turning_rad_per_s, hold_s)
        self.now = self._from = unit(orientation) or (1.0, 0.0, 0.0, 0.0)

    def stop(self) -> None:
        """Stay as it is."""
        self._from = self.now
        self.follower.begin((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self.follower.aim((0.0, 0.0, 0.0))

    def aim(
        self,
        orientation: Sequence[float] | None,
        turning_rad_per_s: Sequence[float] | None,
        since_s: float = inf,
        said_s: float = 0.0,
    ) -> None:
        """Turn to a client's orientation by the shorter way, and on with its angular velocity.

        Args:
            orientation: of any length; None, or of none: what it has come to by what was said.
            turning_rad_per_s: in the frame around; None: it stands as far as is known [rad/s].
            since_s: how long ago that will be after the next move [s].
            said_s: how long it has turned on with that already [s].
        """
        goal = (None if orientation is None else unit(orientation)) or _turned(self.follower.goal_m, self._from)
        self._from = self.now
        speed = list(self.follower.speed_m_per_s)
        self.follower.begin((0.0, 0.0, 0.0), speed)
        self.follower.aim(_way(self.now, goal), turning_rad_per_s, since_s, said_s)

    def move(self, dt_s: float) -> None:
        """Go on by a tick [s]."""
        self.follower.move(dt_s)
        self.now = _turned(self.follower.at_m, self._from)


def unit(orientation: Sequence[float]) -> Quaternion | None:
    """The same of length 1; None where it has no length that a number can tell."""
    largest = max(map(abs, orientation))
    if not 0.0 < largest < inf:
        return None
    w, x, y, z = (each / largest for each in orientation)
    length = sqrt(w * w + x * x + y * y + z * z)
    return w / length, x / length, y / length, z / length


def _turned(way: Sequence[float], of: Quaternion) -> Quaternion:
    """An orientation, turned on by a rotation vector in the frame around [rad]."""
    x, y, z = way
    angle = sqrt(x * x + y * y + z * z)
    if angle == 0.0:
        return of
    share = sin(0.5 * angle) / angle
    return _product((cos(0.5 * angle), share * x, share * y, share * z), of)


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    """First b, then a."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def _way(of: Quaternion, to: Quaternion) -> tuple[float, float, float]:
    """The rotation vector, in the frame around, that turns one into another by the shorter way [rad]."""
    w, x, y, z = _product(to, (of[0], -of[1], -of[2], -of[3]))
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    length = sqrt(x * x + y * y + z * z)
    share = 2.0 * atan2(length, w) / length if length > 0.0 else 0.0
    return share * x, share * y, share * z
