"""One direction of a solid's force under a law of its own: along its normal, or along the surface if it may stick."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any

from hapticd.law import LawSnapshot
from hapticd.shapes.pose import Vector
from hapticd.tick.contact import Contact, RunningLaw
from hapticd.tick.energy import EnergyLedger
from hapticd.tick.guard import blended

LEAST_M = 1e-15
"""A spring along the surface is never quite slack, so that a law may divide by its length [m]."""

_LEAST_M2 = LEAST_M * LEAST_M


class Direction:
    """What stands for the wall of a channel; its direction turns with the surface.

    Attributes:
        outward: 1.0, as forces count along the direction.
        axis: 0: a channel knows its own velocity.
        spring_n: the spring's part of the last force along it [N].
    """

    __slots__ = ("axis", "outward", "spring_n")

    def __init__(self) -> None:
        self.outward = 1.0
        self.axis = 0
        self.spring_n = 0.0


class Channel(Contact):
    """One direction of a solid, the law that stabilises it, and its share of what was applied.

    Along the normal x is less the depth. Along the surface x is the stretch of the sticking spring, of either sign.

    Args:
        law: the law of this direction.
        resolution_m: smallest step of the device's position [m].
        ledger: the books of its solid.

    Attributes:
        dx, dy, dz: the direction along which its force acts, a unit vector.
        way_m: since the last sample, along the direction of then [m].
        taken_j: energy that this direction took since the touch, kept of all but the first, which has the rest [J].
        owed_j: its part of what all directions owe, as shared out last [J].
    """

    __slots__ = ("dx", "dy", "dz", "owed_j", "taken_j", "velocity_m_per_s", "way_m", "x_of_law_m")

    def __init__(self, law: RunningLaw, resolution_m: float, ledger: EnergyLedger) -> None:
        super().__init__(Direction(), law, resolution_m)  # type: ignore[arg-type]  # stands for a wall, see there
        self.ledger = ledger
        self.dx = self.dy = 0.0
        self.dz = 1.0
        self.velocity_m_per_s = 0.0
        self.x_of_law_m = 0.0
        self.way_m = 0.0
        self.taken_j = self.owed_j = 0.0

    @property
    def held_n(self) -> float:
        """The spring's part of what is applied [N]."""
        return self._applied_spring_n

    @held_n.setter
    def held_n(self, newton: float) -> None:
        self._applied_spring_n = self.mean_spring_n = newton

    def rest(self) -> None:
        """Be out of touch, at rest and without force."""
        self.in_contact = False
        self.blending = False
        self.x_m = self.x_of_law_m = 0.0
        self._moved_m = self._contact_n = self.way_m = 0.0
        self.velocity_m_per_s = 0.0
        self.force_n = self.requested_n = 0.0
        self.applied_n = self._applied_contact_n = self._applied_spring_n = 0.0
        self.mean_n = self.mean_spring_n = 0.0
        self.waited = self.applied_sum = self.spring_sum = self.own_sum = 0.0
        self.tick.applied_n = self.tick.applied_contact_n = 0.0

    def snapshot(self, velocity_m_per_s: float = 0.0) -> LawSnapshot:
        """What a law that takes over now starts from; the velocity is its own."""
        learned_n_s_per_m = self.damping_n_s_per_m if self.law.learns_damping else 0.0
        return LawSnapshot(self.x_of_law_m, self.velocity_m_per_s, self.applied_n, self.owed_j, learned_n_s_per_m)

    def take_law(self, law: RunningLaw, velocity_m_per_s: float, dt_s: float) -> None:
        """Go on with another law, already started; the caller blends. The velocity is its own."""
        super().take_law(law, self.velocity_m_per_s, dt_s)
        self.tick.x_m = self.x_of_law_m

    def see(
        self,
        depth_m: float,
        x_m: float,
        moved_m: float,
        velocity_m_per_s: float,
        dt_s: float,
        spring_n: float,
        contact_n: float,
    ) -> None:
        """See a new sample.

        Args:
            depth_m: of the device in the solid; 0: out of touch [m].
            x_m: along the channel, as the law sees it [m].
            moved_m: the way since the last sample along the direction of then [m].
            velocity_m_per_s: along the direction of now [m/s].
            dt_s: time since the last sample [s].
            spring_n: of the spring, along the direction [N].
            contact_n: the same with the solid's own damping [N].
        """
        tick = self.tick
        self.x_m = -depth_m
        tick.x_m = self.x_of_law_m = x_m
        tick.moved_m = self._moved_m = self.way_m = moved_m
        tick.velocity_m_per_s = self.velocity_m_per_s = velocity_m_per_s
        tick.dt_s = dt_s
        tick.in_contact = self.in_contact = depth_m > 0.0
        tick.spring_n = self.wall.spring_n = spring_n
        tick.contact_n = self._contact_n = contact_n

    def ask(self, newton: float) -> None:
        """Have its law ask for this and not for what it has [N]; a blend goes over to that."""
        self.requested_n = newton
        self.force_n = blended(self, self.x_m, newton, 0.0) if self.blending else newton

    def apply(self, share: float, spring_n: float) -> None:
        """Remember what is applied from now on.

        Args:
            share: how much of the force the guard let through, 0 to 1.
            spring_n: the spring's part of it [N].
        """
        contact_n = self._contact_n
        if self.blending:
            contact_n += self.force_n - self.requested_n  # so that what is left is the law's own part
        tick = self.tick
        tick.applied_n = self.mean_n = self.applied_n = share * self.force_n
        tick.applied_contact_n = self._applied_contact_n = share * contact_n
        self.mean_spring_n = self._applied_spring_n = spring_n


def lay_along(channels: Sequence[Channel]) -> None:
    """Lay the second and third channel of a solid across the first one, its normal."""
    normal, first, second = channels
    nx, ny, nz = normal.dx, normal.dy, normal.dz
    tx, ty, tz = (0.0, -nz, ny) if -0.7 < nx < 0.7 else (-nz, 0.0, nx)
    length = sqrt(tx * tx + ty * ty + tz * tz)
    first.dx, first.dy, first.dz = tx, ty, tz = tx / length, ty / length, tz / length
    second.dx, second.dy, second.dz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx


def slip_along(
    channels: Sequence[Channel],
    held: int,
    depth_m: float,
    stretch: Vector,
    stiffness_n_per_m: float,
    velocity: Vector,
    way: Vector,
    dt_s: float,
) -> None:
    """See a new sample along the surface; the first channel has its normal of now.

    Args:
        channels: of a solid, the normal first.
        held: how many directions along the surface are held, from the first on; the others are out of touch.
        depth_m: of the device in the solid [m].
        stretch: of the spring; what of it is along the normal does not count [m].
        stiffness_n_per_m: of the spring [N/m].
        velocity: of the device [m/s].
        way: of the device since the last sample [m].
        dt_s: time since then [s].
    """
    normal, first, second = channels
    vx, vy, vz = velocity
    wx, wy, wz = way
    sx, sy, sz = stretch
    nx, ny, nz = normal.dx, normal.dy, normal.dz
    first_m = first.dx * wx + first.dy * wy + first.dz * wz
    second_m = second.dx * wx + second.dy * wy + second.dz * wz
    # The first direction stays as far as the surface lets it; the second stands across.
    off = first.dx * nx + first.dy * ny + first.dz * nz
    tx = first.dx - off * nx
    ty = first.dy - off * ny
    tz = first.dz - off * nz
    length = sqrt(tx * tx + ty * ty + tz * tz)
    if length < 0.5:  # it has become the normal: take another
        lay_along(channels)
    else:
        first.dx = tx = tx / length
        first.dy = ty = ty / length
        first.dz = tz = tz / length
        second.dx = ny * tz - nz * ty
        second.dy = nz * tx - nx * tz
        second.dz = nx * ty - ny * tx
    for channel, moved_m in ((first, first_m), (second, second_m)):
        x_m = -(sx * channel.dx + sy * channel.dy + sz * channel.dz)
        if x_m * x_m < _LEAST_M2:
            x_m = -LEAST_M
        v_m_per_s = channel.dx * vx + channel.dy * vy + channel.dz * vz
        if held > 0:
            spring_n = -stiffness_n_per_m * x_m
            channel.see(depth_m, x_m, moved_m, v_m_per_s, dt_s, spring_n, spring_n)
        else:
            channel.see(0.0, 0.0, moved_m, v_m_per_s, dt_s, 0.0, 0.0)
        held -= 1


def hold_stroke(channels: Sequence[Channel], proxy: Any, stiffness_n_per_m: float) -> None:
    """Let no law hold a stroke over a rough solid with creases by more than static friction and its spring do.

    That is across the way to the proxy, however the channels lie: pinned in a crease they stay as they are, and the
    bound must not step where that ends. What a held spring leaks there, k dt / 2 times the speed, a law may take twice.

    Args:
        channels: of the solid, the normal first.
        proxy: of it.
        stiffness_n_per_m: of the spring [N/m].
    """
    nx, ny, nz = proxy.normal_x, proxy.normal_y, proxy.normal_z
    fx = fy = fz = vx = vy = vz = 0.0
    for channel in channels:
        newton, speed_m_per_s = channel.requested_n, channel.velocity_m_per_s
        fx += newton * channel.dx
        fy += newton * channel.dy
        fz += newton * channel.dz
        vx += speed_m_per_s * channel.dx
        vy += speed_m_per_s * channel.dy
        vz += speed_m_per_s * channel.dz
    off = fx * nx + fy * ny + fz * nz
    fx -= off * nx
    fy -= off * ny
    fz -= off * nz
    off = vx * nx + vy * ny + vz * nz
    way_m = channels[0].tick.dt_s * sqrt(max(0.0, vx * vx + vy * vy + vz * vz - off * off))
    most_n = stiffness_n_per_m * (proxy.static_friction * proxy.depth_m + way_m)
    asked_n2 = fx * fx + fy * fy + fz * fz
    if asked_n2 > most_n * most_n:
        less = 1.0 - most_n / sqrt(asked_n2)
        for channel in channels:
            channel.ask(channel.requested_n - less * (fx * channel.dx + fy * channel.dy + fz * channel.dz))


def settle_along(contact: Any, share: float, gain: float, limit_n: float, dt_s: float) -> None:
    """Enter the tick into the books of a solid; each channel holds its part of the vector, along its own direction.

    Args:
        contact: of the solid.
        share: how much of the force the guard let through, 0 to 1.
        gain: how much of that a release has left, 0 to 1.
        limit_n: the guard's limit for one contact [N].
        dt_s: time since the last sample; 0: this is the same once more, and the books wait for the next [s].
    """
    solid = contact.solid
    proxy = solid.proxy
    channels = contact.channels
    normal = channels[0]
    stretch_m = stretched_m(proxy) if contact.depth_m > 0.0 else 0.0
    if dt_s > 0.0:
        taken_j = spring_j = 0.0
        for channel in channels:
            given_j = channel.mean_n * channel.way_m
            channel.taken_j -= given_j
            taken_j -= given_j
            spring_j -= channel.mean_spring_n * channel.way_m
        stored_j = gain * solid.stored_j(stretch_m, limit_n)
        ledger = contact.ledger
        lost_j = 0.0
        if proxy.lost_m2 != 0.0:
            lost_j = gain * solid.stiffness_n_per_m * proxy.lost_m2
            sticking_m = sqrt(stretch_m * stretch_m + 2.0 * proxy.lost_m2)  # how long the spring was before it slipped
            if solid.stiffness_n_per_m * sticking_m > limit_n:
                lost_j = gain * solid.stored_j(sticking_m, limit_n) - stored_j
            contact.friction_j += lost_j
            ledger.dissipated_j += lost_j
        ledger.update(-1.0, taken_j, spring_j, stored_j + lost_j, normal.in_contact, normal.damping_n_s_per_m, dt_s)
        ledger.stored_j = stored_j
        contact.friction_stored_j = stored_j * share_along(proxy, stretch_m)
    held = gain
    if solid.stiffness_n_per_m * stretch_m > limit_n:
        held *= limit_n / (solid.stiffness_n_per_m * stretch_m)
    for channel in channels:
        channel.apply(share, held * channel.wall.spring_n)


def share_debt(channels: Sequence[Channel], debt_j: float) -> None:
    """Have each direction owe its part of what all do: once in all, where it was given.

    One that took more than it gave owes nothing, and what it took lessens the parts of the others alike.

    Args:
        channels: of a solid or a port, which share its books.
        debt_j: what it owes [J].
    """
    first = channels[0]
    first.taken_j = -debt_j
    for channel in channels[1:]:
        first.taken_j -= channel.taken_j
    given_j = 0.0
    for channel in channels:
        channel.owed_j = max(0.0, -channel.taken_j)
        given_j += channel.owed_j
    if given_j > 0.0:
        for channel in channels:
            channel.owed_j *= debt_j / given_j


def share_along(proxy: Any, stretch_m: float) -> float:
    """How much of the energy in a spring is of its stretch along the surface, 0 to 1.

    Args:
        proxy: of its solid.
        stretch_m: length of the whole spring [m].
    """
    along_m2 = proxy.stretch_x * proxy.stretch_x + proxy.stretch_y * proxy.stretch_y
    along_m2 += proxy.stretch_z * proxy.stretch_z
    whole_m2 = stretch_m * stretch_m
    return along_m2 / whole_m2 if along_m2 < whole_m2 else 1.0


def stretched_m(proxy: Any) -> float:
    """Length of the whole spring, from the device to a proxy that touches [m]."""
    sx = proxy.depth_m * proxy.normal_x + proxy.stretch_x
    sy = proxy.depth_m * proxy.normal_y + proxy.stretch_y
    sz = proxy.depth_m * proxy.normal_z + proxy.stretch_z
    return sqrt(sx * sx + sy * sy + sz * sz)
