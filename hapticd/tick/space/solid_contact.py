"""One solid under its laws: the held force as a vector, its share of what was applied, its books.

Energy into the solid is the work of the vector that was held, E(n) = E(n-1) - F(n-1) . (p(n) - p(n-1)), exact however
the normal turns. Each law sees a scalar of it: the force of its direction, and the way along that same direction.
Where a solid holds, what it applies and what is booked of it are in one module: each is wrong without the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from copy import copy
from math import inf, sqrt

from hapticd.shapes.pose import Vector
from hapticd.shapes.proxy import follow, place, place_before
from hapticd.shapes.solid import Proxy
from hapticd.tick.contact import RunningLaw
from hapticd.tick.energy import EnergyLedger
from hapticd.tick.space.channel import (
    Channel,
    hold_stroke,
    lay_along,
    settle_along,
    share_along,
    share_debt,
    slip_along,
    stretched_m,
)
from hapticd.tick.space.crease import TURNED, grip
from hapticd.tick.space.solid import FARTHEST_M, Solid

OUTSIDE_S = 0.5
"""How long a law that keeps time outside is asked after the touch, such as of a ring that dies away [s]."""


class SolidContact:
    """One solid, the laws that stabilise it and the ledger that watches them.

    Args:
        solid: the compiled solid.
        make_law: a fresh law, one a direction.
        resolution_m: smallest step of the device's position [m].

    Attributes:
        channels: along the normal, and where friction can stick or a crease may be two along the surface.
        sides: how many of them have anything to do.
        grip: in how many directions the proxy is pinned in a crease.
        off_m: how far the proxy has gone across the crease since [m].
        to_x, to_y, to_z: the way from the device to where its proxy would be without friction [m].
        ledger: the books of the whole vector.
        quiet: out of touch, without force, and nothing left to book.
        moved_j: work that changes of the solid itself did on its spring [J].
        friction_j: energy that slipping took, a part of what is dissipated [J].
        friction_stored_j: energy in the spring along the surface, a part of what is stored [J].
        depth_m: of the device in the solid [m].
        moves: whether a client moves it.
        carried_j: work of its force along its own way [J].
    """

    moves = False
    carried_j = 0.0

    __slots__ = (
        "_away",
        "_moved_m",
        "_outside_s",
        "_ux",
        "_uy",
        "_uz",
        "channels",
        "depth_m",
        "friction_j",
        "friction_stored_j",
        "grip",
        "leaving",
        "ledger",
        "moved_j",
        "normal",
        "off_m",
        "quiet",
        "resolution_m",
        "sides",
        "solid",
        "to_x",
        "to_y",
        "to_z",
        "turned",
    )

    def __init__(self, solid: Solid, make_law: Callable[[], RunningLaw], resolution_m: float) -> None:
        self.solid = solid
        self.resolution_m = resolution_m
        self.ledger = EnergyLedger()
        self.normal = Channel(make_law(), resolution_m, self.ledger)
        self.channels = [self.normal]
        self.channels += self.rougher(solid, make_law)
        self.quiet = True
        self.leaving = False
        self.moved_j = self.friction_j = self.friction_stored_j = 0.0
        self.depth_m = 0.0
        self._away = False
        self._moved_m = 0.0
        self._outside_s = 0.0
        self.turned = False
        self._ux = self._uy = 0.0
        self._uz = 1.0
        self.sides = 3 if solid.rough else 1
        self.grip = 0
        self.off_m = self.to_x = self.to_y = self.to_z = 0.0

    @property
    def in_contact(self) -> bool:
        """Whether the device is inside."""
        return self.normal.in_contact

    @property
    def faded(self) -> bool:
        """Whether nothing is left of its force, nor to book."""
        return self.quiet or not any(
            channel.blending or channel.applied_n != 0.0 or channel.applied_sum != 0.0 for channel in self.channels
        )

    def reach(self) -> Proxy:
        """What tells where the device may touch it, until its proxy is another."""
        return self.solid.proxy

    def start(self, x: float, y: float, z: float) -> None:
        """Have the device at a point of the world, at rest and without force [m]."""
        proxy = self.solid.proxy
        place(proxy, proxy.others, proxy.voxels, x, y, z)
        for channel in self.channels:
            channel.rest()
        self._stand()

    def take_side(self, held: Iterable[Proxy], x: float, y: float, z: float) -> None:
        """Begin before the side on which one of those holds the device, the first where that is outside, or anew."""
        proxy = self.solid.proxy
        stays = any(place_before(proxy, proxy.others, proxy.voxels, each, x, y, z) for each in held)
        (follow if stays else place)(proxy, proxy.others, proxy.voxels, x, y, z)
        self._stand()

    def rougher(self, solid: Solid, make_law: Callable[[], RunningLaw]) -> list[Channel]:
        """Channels along the surface that another solid in the place of this one needs, and this one has not."""
        if not (solid.rough or solid.creases) or len(self.channels) == 3:
            return []
        return [Channel(make_law(), self.resolution_m, self.ledger) for _ in range(2)]

    def shade(self, make_law: Callable[[], RunningLaw]) -> SolidContact:
        """A contact that holds what this one applies and has nothing of its own: it is there to fade out."""
        shade = SolidContact(copy(self.solid), make_law, self.resolution_m)
        shade.solid.proxy = copy(self.solid.proxy)
        shade.let_go(inf, 1.0)
        for of, channel in zip(self.channels, shade.channels, strict=False):
            channel.dx, channel.dy, channel.dz = of.dx, of.dy, of.dz
            channel.in_contact, channel.x_m = of.in_contact, of.x_m
            channel.applied_n = channel.mean_n = of.applied_n
            channel.waited, channel.applied_sum = of.waited, of.applied_sum
        shade.depth_m = self.depth_m
        shade.grip, shade.sides = self.grip, self.sides
        shade.quiet = False
        return shade

    def change(
        self, solid: Solid, along: list[Channel], held: Iterable[Proxy], limit_n: float, gain: float, at: Vector
    ) -> None:
        """Go on with another solid in the place of this one, and without force: its shade keeps that.

        A device that it holds stays where it was held, or with another shape on the side from which it was, as does one
        that another solid holds. For one that is free nothing is known of the way since the solid was last in reach,
        and a change is no motion: it begins anew. What the change does to the spring is the scene's own work.

        Args:
            solid: it.
            along: channels along the surface, where it has friction and the one before had none.
            held: what holds the device, this one or others.
            limit_n: the guard's limit for one contact [N].
            gain: how much of the force a release has left, 0 to 1.
            at: where the device is [m].
        """
        before = self.solid
        stays = solid.inherit(before) and solid.proxy.touching
        self.solid = solid
        if not (solid.rough or solid.creases):
            del self.channels[1:]
        self.channels += along
        for channel in self.channels:
            channel.rest()
        proxy = solid.proxy
        (follow if stays else place)(proxy, proxy.others, proxy.voxels, *at)
        if not stays and (proxy.touching or before.proxy.touching):
            self.take_side(held, *at)
        self._stand()
        self._restore(limit_n, gain)

    def let_go(self, limit_n: float, gain: float) -> None:
        """Be gone: what is left of the force fades out."""
        self.solid.let_go()
        self._restore(limit_n, gain)
        self.leaving = True

    def observe(self, at: Vector, velocity: Vector, way: Vector, dt_s: float) -> bool:
        """See a new sample; False when there is nothing to do: out of touch, and all that was held has been booked.

        Args:
            at: where the device is [m].
            velocity: of the device [m/s].
            way: since the last sample [m].
            dt_s: time since then [s].
        """
        solid = self.solid
        proxy = solid.proxy
        x, y, z = at
        if self.quiet:
            reach = proxy.reach_x * x + proxy.reach_y * y + proxy.reach_z * z
            if reach + proxy.reach_w * (x * x + y * y + z * z) > proxy.reach_limit:
                self._away = True
                return False
            if self._away:  # its way in is from where it was: a late tick's may end behind the middle
                self._away = False
                wx, wy, wz = way
                place(proxy, proxy.others, proxy.voxels, x - wx, y - wy, z - wz)
        follow(proxy, proxy.others, proxy.voxels, x, y, z)
        if not proxy.touching:
            return not self.quiet and self._lose(velocity, way, dt_s)
        normal = self.normal
        reach_m = proxy.depth_m
        if not reach_m < FARTHEST_M:
            raise ArithmeticError  # compiled as well: which one it is finds `astray`
        self.depth_m = reach_m
        nx = proxy.normal_x
        ny = proxy.normal_y
        nz = proxy.normal_z
        wx, wy, wz = way
        if not normal.in_contact:  # the way to the surface counts along its normal
            self.quiet = False
            normal.dx, normal.dy, normal.dz = nx, ny, nz
            for channel in self.channels:
                channel.taken_j = 0.0
        self._moved_m = moved_m = normal.dx * wx + normal.dy * wy + normal.dz * wz
        if solid.creases:
            before = self.grip
            nx, ny, nz = grip(self, proxy, way)
            self.sides = 3 if solid.rough else 1 + max(self.grip, before)
        normal.dx = nx
        normal.dy = ny
        normal.dz = nz
        vx, vy, vz = velocity
        if self.sides > 1:
            sx, sy, sz = proxy.stretch_x, proxy.stretch_y, proxy.stretch_z
            if self.grip > 0:
                reach_m = 0.0
                sx += self.depth_m * proxy.normal_x
                sy += self.depth_m * proxy.normal_y
                sz += self.depth_m * proxy.normal_z
            reach_m += nx * sx + ny * sy + nz * sz
            held = 2 if solid.rough else self.grip
            slip_along(self.channels, held, self.depth_m, (sx, sy, sz), solid.stiffness_n_per_m, velocity, way, dt_s)
        if nx * self._ux + ny * self._uy + nz * self._uz < TURNED:
            self.turned = True
        v_m_per_s = nx * vx + ny * vy + nz * vz
        spring_n = contact_n = solid.stiffness_n_per_m * reach_m
        if solid.damping_n_s_per_m != 0.0:
            contact_n -= solid.damping_n_s_per_m * v_m_per_s
        normal.see(self.depth_m, -reach_m, moved_m, v_m_per_s, dt_s, spring_n, contact_n)
        return True

    def act(self, periods: float) -> None:
        """Ask the laws for their forces.

        Args:
            periods: time since the last tick, in periods of the loop, for a blend.

        Raises:
            BaseException: whatever a law raises.
        """
        if self.turned:
            normal = self.normal
            self._ux, self._uy, self._uz = normal.dx, normal.dy, normal.dz
            self.turned = False
            share_debt(self.channels, self.ledger.debt_j)
            for channel in self.channels[: self.sides]:
                if channel.felt_mass_kg > 0.0 or (channel.law.publishes_mass and channel.law.learns_damping):
                    channel.law.start(channel.snapshot())
        for channel in self.channels[: self.sides]:
            channel.act(periods)
        solid = self.solid
        if self.sides > 1 and not solid.creases:
            _, first, second = self.channels
            most_n = solid.proxy.static_friction * solid.stiffness_n_per_m * self.depth_m
            # What `hold_stroke` does, for less: here the channels always lie along the surface.
            asked_n2 = first.requested_n * first.requested_n + second.requested_n * second.requested_n
            if asked_n2 > most_n * most_n:  # no law holds a stroke by more than static friction does
                part = most_n / sqrt(asked_n2)
                first.ask(part * first.requested_n)
                second.ask(part * second.requested_n)
        elif solid.rough:
            hold_stroke(self.channels, solid.proxy, solid.stiffness_n_per_m)

    def hold(self, periods: float) -> None:
        """Stay with what the laws asked for last, at a tick without a new sample; a blend goes on."""
        for channel in self.channels:
            channel.hold(periods)

    def add(self, force_n: list[float]) -> bool:
        """Add what it applies to the sums over all contacts, one element an axis [N].

        Returns:
            Whether a blend is under way, so that its laws asked for something else.
        """
        blending = False
        x, y, z = force_n
        for channel in self.channels[: self.sides]:
            newton = channel.force_n
            x += channel.dx * newton
            y += channel.dy * newton
            z += channel.dz * newton
            if channel.blending:
                blending = True
        force_n[:] = x, y, z
        return blending

    def add_requested(self, requested_n: list[float]) -> None:
        """Add what its laws asked for."""
        for channel in self.channels:
            newton = channel.requested_n
            requested_n[0] += channel.dx * newton
            requested_n[1] += channel.dy * newton
            requested_n[2] += channel.dz * newton

    def settle(self, share: float, gain: float, limit_n: float, dt_s: float) -> None:
        """Enter the tick into the books and remember what is applied from now on.

        Args:
            share: how much of the force the guard let through, 0 to 1.
            gain: how much of that a release has left, 0 to 1.
            limit_n: the guard's limit for one contact [N].
            dt_s: time since the last sample; 0: this is the same once more, and the books wait for the next [s].
        """
        solid = self.solid
        depth_m = self.depth_m
        if self.sides > 1:
            settle_along(self, share, gain, limit_n, dt_s)
            if depth_m == 0.0:
                self._rest()
            return
        normal = self.normal
        if dt_s > 0.0:
            self.ledger.update(
                self._moved_m,
                normal.mean_n,
                normal.mean_spring_n,
                gain * solid.stored_j(depth_m, limit_n),
                normal.in_contact,
                normal.damping_n_s_per_m,
                dt_s,
            )
        spring_n = solid.stiffness_n_per_m * depth_m
        normal.apply(share, gain * (spring_n if spring_n <= limit_n else limit_n))
        if depth_m == 0.0:
            self._rest()

    @property
    def force(self) -> Vector:
        """What was applied in the end [N]."""
        channels = self.channels
        return (
            sum([channel.dx * channel.applied_n for channel in channels]),
            sum([channel.dy * channel.applied_n for channel in channels]),
            sum([channel.dz * channel.applied_n for channel in channels]),
        )

    def _rest(self) -> None:
        """Be out of touch: nothing is left to do a sample later, or once a law that keeps time has had its time.

        By that sample no force is held any more, with which the ledger ends the touch.
        """
        self.quiet = self._outside_s > (0.0 if self.normal.law.rests else OUTSIDE_S)

    def _lose(self, velocity: Vector, way: Vector, dt_s: float) -> bool:
        """See a sample out of touch."""
        self._outside_s = self._outside_s + dt_s if self.depth_m == 0.0 else 0.0
        self.depth_m = 0.0
        self.turned = False
        free_m = max(self.solid.proxy.d, 0.0)  # a device that is let be in it is as good as at its surface
        vx, vy, vz = velocity
        wx, wy, wz = way
        for channel in self.channels:
            x, y, z = channel.dx, channel.dy, channel.dz
            channel.see(0.0, free_m, x * wx + y * wy + z * wz, x * vx + y * vy + z * vz, dt_s, 0.0, 0.0)
        self._moved_m = self.normal.way_m
        return True

    def _stand(self) -> None:
        """Stand where the proxy says, at rest and without force."""
        proxy = self.solid.proxy
        self.depth_m = depth_m = proxy.depth_m if proxy.touching else 0.0
        self.sides = 3 if self.solid.rough else 1
        self.grip = 0
        for channel in self.channels[: self.sides]:
            channel.in_contact = depth_m > 0.0
        self.normal.x_of_law_m = -depth_m
        self._moved_m = self._outside_s = 0.0
        self._away = False
        self._face()
        self.quiet = depth_m == 0.0 and self.ledger.stored_j == 0.0

    def _face(self) -> None:
        """Count turns of the normal from here, and lay the directions along the surface anew."""
        proxy = self.solid.proxy
        normal = self.normal
        nx, ny, nz = proxy.normal_x, proxy.normal_y, proxy.normal_z
        self._ux = normal.dx = nx
        self._uy = normal.dy = ny
        self._uz = normal.dz = nz
        self.to_x, self.to_y, self.to_z = self.depth_m * nx, self.depth_m * ny, self.depth_m * nz
        self.turned = False
        if len(self.channels) == 3:
            lay_along(self.channels)

    def _restore(self, limit_n: float, gain: float) -> None:
        """Book what a change of the solid does to its spring."""
        stretch_m = stretched_m(self.solid.proxy) if self.depth_m > 0.0 else 0.0
        stored_j = gain * self.solid.stored_j(stretch_m, limit_n)
        self.friction_stored_j = stored_j * share_along(self.solid.proxy, stretch_m)
        self.moved_j += stored_j - self.ledger.stored_j
        self.ledger.stored_j = stored_j
