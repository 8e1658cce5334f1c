"""An object that a client moves: the port, and the contact that sees the device from the object."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from copy import copy
from math import inf

from hapticd.config.remote import PortLimits
from hapticd.shapes.pose import Pose, Vector
from hapticd.shapes.solid import Proxy
from hapticd.tick.contact import RunningLaw
from hapticd.tick.remote.asked_spring import AskedSpring
from hapticd.tick.remote.follower import Follower
from hapticd.tick.remote.port import Port, PortState
from hapticd.tick.remote.said_motion import SaidMotion
from hapticd.tick.remote.turning import Turning, unit
from hapticd.tick.remote.update import DAMPING, ORIENTATION, POSITION, STIFFNESS, TURNING, VELOCITY, Update
from hapticd.tick.space.channel import Channel
from hapticd.tick.space.solid import Solid
from hapticd.tick.space.solid_contact import SolidContact

ENDLESS_M = 0.1
"""Distance from its origin at which a plane turns no faster than its client may move it [m]."""


class RemoteObject(Port):
    """What a client says of an object, followed without a jump. One that is silent stops: it keeps its place.

    Args:
        limits: what it may do.
        solid: the object, as compiled.
        period_s: nominal time between ticks [s].

    Attributes:
        contact: the object's contact, from when that is in a scene.
        follower: of its origin.
        turning: of its orientation.
    """

    __slots__ = (
        "_asked",
        "_damping",
        "_ramp_begins",
        "_said_motion",
        "_said_turning",
        "_stiffness",
        "contact",
        "follower",
        "turning",
    )

    contact: RemoteContact

    def __init__(self, limits: PortLimits, solid: Solid, period_s: float) -> None:
        super().__init__(limits, 3, period_s)
        self._stiffness = self._damping = 0.0
        self._ramp_begins = False
        first = solid.configs[0]
        self.follower = Follower(3, limits.max_speed_m_per_s, limits.hold_s)
        self.turning = Turning(first.orientation, _max_turning(limits, solid), limits.hold_s)
        self.target_m = self.follower.at_m
        self._asked = AskedSpring()
        self._said_motion = SaidMotion()
        self._said_turning = SaidMotion()
        self.take_surface(solid)
        self.stop(first.position_m)

    @property
    def object_index(self) -> int:
        """Which object of the scene it is."""
        return self.contact.solid.index

    @property
    def work_j(self) -> float:
        """What the client's motion and changes have put in, less what they took [J]."""
        return self.contact.moved_j

    @property
    def rests(self) -> bool:
        """Whether the object is where it is to be, and stays."""
        return self.follower.rests and self.turning.follower.rests

    def law_values(self) -> tuple[float, float, float]:
        """Stiffness in force [N/m], damping of the law [N s/m] and the mass that it has felt [kg], for a record."""
        normal = self.contact.normal
        return self.contact.solid.stiffness_n_per_m, normal.damping_n_s_per_m, normal.felt_mass_kg

    def change(self, limits: PortLimits) -> None:
        """Go on under other limits, or the same."""
        self.limits = limits
        self.follower.max_speed_m_per_s = limits.max_speed_m_per_s
        self.turning.follower.max_speed_m_per_s = _max_turning(limits, self.contact.solid)
        self.follower.hold_s = self.turning.follower.hold_s = limits.hold_s

    def take_surface(self, solid: Solid) -> None:
        """Begin with a solid, and the surface that its file says, as far as no client in force has asked for less."""
        if self.state is not PortState.HELD:
            self._asked.forget()
        self._aim(solid)
        solid.stiffness_n_per_m, solid.damping_n_s_per_m = self._stiffness, self._damping

    def forget(self) -> None:
        """Know nothing of a client until it says something anew."""
        super().forget()
        self._said_motion.forget()
        self._said_turning.forget()

    def stand(self) -> None:
        """Stay where it is, without a client; an event tells of one that was in force."""
        self.lose_client()
        self.stop()

    def stop(self, position_m: Vector | None = None) -> None:
        """Stay where it is, or at a place."""
        at_m = tuple(self.follower.at_m) if position_m is None else position_m
        self.follower.begin(at_m, (0.0, 0.0, 0.0))
        self.follower.aim(at_m)
        self.turning.stop()

    def move(self, dt_s: float) -> Pose:
        """Where it is after a tick [s]."""
        self.follower.move(dt_s)
        self.turning.move(dt_s)
        return Pose.of(self.follower.at_m, self.turning.now)

    def towards(self, passed_s: float, ramp_s: float) -> tuple[float, float]:
        """Stiffness and damping of its surface after a step of their ramps.

        Args:
            passed_s: time since the last one; what passed of it before they began counts a period at most [s].
            ramp_s: duration of the whole [s].
        """
        if self._ramp_begins:
            passed_s = min(passed_s, self._period_s)
            self._ramp_begins = False
        step = min(1.0, passed_s / ramp_s)
        solid = self.contact.solid
        first = solid.configs[0]
        most = (first.stiffness_n_per_m * step, abs(first.damping_n_s_per_m) * step)
        return (
            _towards(solid.stiffness_n_per_m, self._stiffness, most[0]),
            _towards(solid.damping_n_s_per_m, self._damping, most[1]),
        )

    def _become(self, state: PortState) -> None:
        super()._become(state)
        if state is PortState.RELEASED:  # and it stops
            self.follower.aim(None)
            self.turning.aim(None, None)

    def _grow_old(self, passed_s: float) -> None:
        super()._grow_old(passed_s)
        self.follower.wait(passed_s)
        self.turning.follower.wait(passed_s)

    def _hear(self, update: Update, age_s: float) -> bool:
        said = update.said
        self._asked.hear(update)
        self._aim(self.contact.solid)
        speed_ns = update.velocity_ns if said & VELOCITY else None
        placed, sped = self._said_motion.hear(update.position_ns if said & POSITION else None, speed_ns)
        if placed or sped:
            position_m = update.position_m if placed else None
            velocity_m_per_s, said_s = None, 0.0
            if speed_ns is not None:
                velocity_m_per_s, said_s = update.velocity_m_per_s, update.said_s(speed_ns)
            self.follower.aim(position_m, velocity_m_per_s, age_s, said_s)
        speed_ns = update.turning_ns if said & TURNING else None
        placed, sped = self._said_turning.hear(update.orientation_ns if said & ORIENTATION else None, speed_ns)
        if placed or sped:
            orientation = update.orientation if placed else None
            turning_rad_per_s, said_s = None, 0.0
            if speed_ns is not None:
                turning_rad_per_s, said_s = update.angular_velocity_rad_per_s, update.said_s(speed_ns)
            self.turning.aim(orientation, turning_rad_per_s, age_s, said_s)
        return bool(said & (POSITION | VELOCITY | ORIENTATION | TURNING | STIFFNESS | DAMPING))

    def _aim(self, solid: Solid) -> None:
        """Have the surface go to what the client has asked for, within what the file says."""
        first = solid.configs[0]
        goals = self._asked.within(first.stiffness_n_per_m, first.damping_n_s_per_m)
        if goals != (self._stiffness, self._damping):
            self._stiffness, self._damping = goals
            self._ramp_begins = True


class RemoteContact(SolidContact):
    """A solid that a client moves. Laws and books see the device from it; its own motion is the client's work.

    Args:
        solid: the compiled solid, of one object.
        make_law: a fresh law, one a direction.
        resolution_m: smallest step of the device's position [m].
        limits: what the client may do.
        ramp_s: duration of the ramps of stiffness and damping [s].
        period_s: nominal time between ticks [s].

    Attributes:
        port: what the client says.
        carried_j: work of its force along the way of the touched point [J].
        ramp_s: duration of the ramps of stiffness and damping [s].
    """

    moves = True

    __slots__ = ("_before_n_per_m", "_held_along", "_waited_s", "_way", "carried_j", "port", "ramp_s")

    def __init__(
        self,
        solid: Solid,
        make_law: Callable[[], RunningLaw],
        resolution_m: float,
        limits: PortLimits,
        ramp_s: float,
        period_s: float,
    ) -> None:
        super().__init__(solid, make_law, resolution_m)
        self.carried_j = 0.0
        self.ramp_s = ramp_s
        self._before_n_per_m = solid.stiffness_n_per_m
        self._held_along: Sequence[Vector] = ()  # where ticks had no sample: along what was held until this one
        self._way: Vector = (0.0, 0.0, 0.0)  # of the touched point, since the last sample
        self._waited_s = 0.0  # since then, in ticks without one
        self.port = RemoteObject(limits, solid, period_s)

    def join(self) -> None:
        """Be in a scene. Only there it and its port know each other: in the loop no collector looks for circles."""
        self.port.contact = self

    def reach(self) -> Proxy:
        """Everywhere: it may come to a device that rests."""
        everywhere = copy(self.solid.proxy)
        everywhere.reach_x = everywhere.reach_y = everywhere.reach_z = everywhere.reach_w = 0.0
        everywhere.reach_limit = inf
        return everywhere

    def start(self, x: float, y: float, z: float) -> None:
        """Have the device at a point of the world, at rest and without force; the object stops where it is."""
        super().start(x, y, z)
        self.port.stand()
        self.port.force_n[:] = (0.0, 0.0, 0.0)
        self._waited_s = 0.0

    def change(
        self, solid: Solid, along: list[Channel], held: Iterable[Proxy], limit_n: float, gain: float, at: Vector
    ) -> None:
        """Go on with another solid in the place of this one, and without force: its shade keeps that."""
        port = self.port
        was = Pose.of(port.follower.at_m, port.turning.now)
        port.take_surface(solid)
        super().change(solid, along, held, limit_n, gain, at)
        self._before_n_per_m = solid.stiffness_n_per_m
        if solid.proxy.pose != was:
            port.turning.now = unit(solid.configs[0].orientation) or port.turning.now
            port.stop(solid.placed[0].pose.position_m)

    def let_go(self, limit_n: float, gain: float) -> None:
        """Be gone: what is left of the force fades out."""
        super().let_go(limit_n, gain)
        self._before_n_per_m = 0.0
        self.port.forget()

    def wait(self, passed_s: float) -> None:
        """Have its client grow older at a tick without a new sample, touched or not [s]."""
        self._waited_s += passed_s
        self.port.pass_time(passed_s)

    def observe(self, at: Vector, velocity: Vector, way: Vector, dt_s: float) -> bool:
        """See a new sample from the object, which has moved since."""
        port = self.port
        self._way = (0.0, 0.0, 0.0)
        self._held_along = ()
        if self.normal.waited > 0.0 and not self.quiet:
            self._held_along = [(channel.dx, channel.dy, channel.dz) for channel in self.channels]
        for axis, newton in enumerate(port.force_n):
            port.impulse_n_s[axis] += newton * dt_s
        port.pass_time(max(0.0, dt_s - self._waited_s))
        self._waited_s = 0.0
        if self.leaving:
            return super().observe(at, velocity, way, dt_s)
        solid = self.solid
        self._before_n_per_m = solid.stiffness_n_per_m
        solid.stiffness_n_per_m, solid.damping_n_s_per_m = port.towards(dt_s, self.ramp_s)
        if port.rests:
            return super().observe(at, velocity, way, dt_s)
        proxy = solid.proxy
        before = proxy.pose
        pose = port.move(dt_s)
        qx, qy, qz = proxy.move(pose)
        if not proxy.touching:
            qx, qy, qz = (to - of for to, of in zip(pose.point(before.own(at)), at, strict=True))
        elif not self.quiet:
            self._way = (qx, qy, qz)
            self._carry(self.force)
        seen = (way[0] - qx, way[1] - qy, way[2] - qz)
        speed = (velocity[0] - qx / dt_s, velocity[1] - qy / dt_s, velocity[2] - qz / dt_s)
        return super().observe(at, speed, seen, dt_s)

    def settle(self, share: float, gain: float, limit_n: float, dt_s: float) -> None:
        """Enter the tick into the books and remember what is applied from now on.

        First the motion with the spring as it was, then what has become of the spring: that is the client's work.
        """
        if self._held_along:
            self._spread(dt_s)
        solid = self.solid
        now_n_per_m = solid.stiffness_n_per_m
        changed = now_n_per_m != self._before_n_per_m
        solid.stiffness_n_per_m = self._before_n_per_m
        super().settle(share, gain, limit_n, dt_s)
        if changed:
            solid.stiffness_n_per_m = self._before_n_per_m = now_n_per_m
            if self.sides == 1:
                self.normal.held_n = gain * min(now_n_per_m * self.depth_m, limit_n)
            self._restore(limit_n, gain)
        self.port.force_n[:] = self.force

    def _carry(self, force_n: Vector) -> None:
        """Enter the work of a force along the way of the touched point."""
        fx, fy, fz = force_n
        qx, qy, qz = self._way
        work_j = fx * qx + fy * qy + fz * qz
        self.carried_j += work_j
        self.moved_j += work_j

    def _spread(self, dt_s: float) -> None:
        """Enter what the mean of what was applied since the last sample brings beyond the last tick's force.

        Args:
            dt_s: time since the last sample [s].
        """
        x = y = z = 0.0
        for channel, (dx, dy, dz) in zip(self.channels, self._held_along, strict=True):
            more_n = channel.mean_n - channel.applied_n
            x += dx * more_n
            y += dy * more_n
            z += dz * more_n
        self._held_along = ()
        self._carry((x, y, z))
        for axis, newton in enumerate((x, y, z)):
            self.port.impulse_n_s[axis] += newton * dt_s


def _max_turning(limits: PortLimits, solid: Solid) -> float:
    outer_m = solid.placed[0].outer_m()
    return limits.max_speed_m_per_s / (outer_m if outer_m < inf else ENDLESS_M)


def _towards(now: float, goal: float, most: float) -> float:
    return min(goal, now + most) if now < goal else max(goal, now - most)
