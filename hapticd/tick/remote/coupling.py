"""A coupling: a spring and a damper between the device and a target that a client moves."""

from __future__ import annotations

from math import sqrt

from hapticd.config.remote import PortLimits
from hapticd.tick.remote.asked_spring import AskedSpring
from hapticd.tick.remote.follower import Follower
from hapticd.tick.remote.one_port import OnePort, PortAxis
from hapticd.tick.remote.port_site import PortSite
from hapticd.tick.remote.port_state import PortState
from hapticd.tick.remote.ramped import Ramped
from hapticd.tick.remote.said_motion import SaidMotion
from hapticd.tick.remote.update import POSITION, VELOCITY, Update
from hapticd.tick.space.channel import LEAST_M


class Coupling(OnePort):
    """A coupling, ready for the tick.

        f = -k (p - q) - b (v - dq/dt)      p the device, q the followed target; each term within the limit

    It pulls as well as it pushes, so that its laws see a contact that is not lost while it is held. A law sees the
    device's own motion: what the client gives back beyond what it got, since it is late, is energy that the law damps.
    Its damping acts against the ground. Where `driven` a law sees the motion of the device against the target instead,
    and its damping acts between the two: what moves the target is none of its business.

    Args:
        limits: what it may do.
        site: where it is.

    Attributes:
        follower: the followed target.
        damping: of its damper, without the law's [N s/m].
    """

    __slots__ = (
        "_asked",
        "_gone_m",
        "_left_s",
        "_said_motion",
        "_speed_m_per_s",
        "_stretch_m",
        "_unsaid_s",
        "damping",
        "follower",
    )

    def __init__(self, limits: PortLimits, site: PortSite) -> None:
        super().__init__(limits, site)
        self.follower = Follower(len(self.channels), limits.max_speed_m_per_s, limits.hold_s)
        self.target_m = self.follower.at_m
        self.damping = Ramped(limits.damping_n_s_per_m)
        self._asked = AskedSpring()
        self._said_motion = SaidMotion()
        self._stretch_m = self._speed_m_per_s = 0.0
        self._gone_m = [0.0] * len(self.channels)  # of the followed target, since the last sample
        self._left_s = 0.0  # until spring and damper have come in
        self._unsaid_s = site.come_in_s

    def change(self, limits: PortLimits) -> None:
        """Go on under other limits, and with what they say of the spring as far as no client in force has said less."""
        super().change(limits)
        self.follower.max_speed_m_per_s = limits.max_speed_m_per_s
        self.follower.hold_s = limits.hold_s
        if self.state is not PortState.HELD:
            self._asked.forget()
        self._aim()

    def forget(self) -> None:
        """Know nothing of a client until it says something anew."""
        super().forget()
        self._said_motion.forget()

    def _hear(self, update: Update, age_s: float) -> bool:
        said = update.said
        if not said & POSITION:
            return False
        speed_ns = update.velocity_ns if said & VELOCITY else None
        placed, sped = self._said_motion.hear(update.position_ns, speed_ns)
        if placed or sped:
            position_m = update.position_m if placed else None
            velocity_m_per_s, said_s = None, 0.0
            if speed_ns is not None:
                velocity_m_per_s, said_s = update.velocity_m_per_s, update.said_s(speed_ns)
            self.follower.aim(position_m, velocity_m_per_s, age_s + self._period_s, said_s)
        self._asked.hear(update)
        self._aim()
        return True

    def _aim(self) -> None:
        """Have stiffness and damping go to what the client has asked for, within the limits, by a ramp."""
        limits = self.limits
        stiffness_n_per_m, damping_n_s_per_m = self._asked.within(limits.stiffness_n_per_m, limits.damping_n_s_per_m)
        if stiffness_n_per_m != self.stiffness.goal:
            self.stiffness.aim(stiffness_n_per_m, self._stretch_m, self.limit_n)
        if damping_n_s_per_m != self.damping.goal:
            self.damping.aim(damping_n_s_per_m, self._speed_m_per_s, self.limit_n)

    def _begin(self) -> None:
        motion = self.motion
        self.follower.begin(motion.position_m, motion.velocity_m_per_s)
        self._gone_m[:] = [0.0] * len(self._gone_m)
        self._left_s = come_in_s = self._come_in_s()
        # Not from nothing: without a spring a law would not see that one begins.
        share = self._period_s / come_in_s if self._period_s < come_in_s else 1.0
        self.stiffness.begin(share)
        self.damping.begin(share)

    def _see(self, dt_s: float, moved_s: float) -> None:
        follower = self.follower
        gone_m = self._gone_m
        if moved_s > 0.0:
            follower.move(moved_s)
        motion = self.motion
        driven = self.limits.driven
        for axis, (channel, x, speed, spring_n, contact_n) in enumerate(self._pull()):
            way_m = motion.position_m[axis] - self._from_m[axis]
            against_m = way_m - follower.moved_m[axis]
            if driven:
                channel.see(1.0, x, against_m - gone_m[axis], speed, dt_s, spring_n, contact_n)
            else:
                channel.see(1.0, x, way_m, motion.velocity_m_per_s[axis], dt_s, spring_n, contact_n)
            channel.way_m = against_m  # by which the books go: they have the target's way of before
            gone_m[axis] = 0.0

    def _wait(self, passed_s: float) -> bool:
        """The target, stiffness and damping go on at every tick: what they change is the client's, not the device's."""
        follower = self.follower
        follower.move(passed_s)
        for axis, (channel, x, speed, spring_n, contact_n) in enumerate(self._pull()):
            self._gone_m[axis] += follower.moved_m[axis]
            channel.x_of_law_m = x
            if self.limits.driven:
                channel.velocity_m_per_s = speed
            channel.push(contact_n, spring_n)
        return True

    def _pull(self) -> list[tuple[PortAxis, float, float, float, float]]:
        """Each axis, how far and how fast the device is from the target along it, the spring's force and both."""
        follower = self.follower
        motion = self.motion
        x_m, speeds = [], []
        x_squared = speed_squared = 0.0
        for axis in range(len(self.channels)):
            x = motion.position_m[axis] - follower.at_m[axis]
            x_m.append(x)
            x_squared += x * x
            speed = motion.velocity_m_per_s[axis] - follower.speed_m_per_s[axis]
            speeds.append(speed)
            speed_squared += speed * speed
        self._stretch_m = stretch_m = sqrt(x_squared)
        self._speed_m_per_s = speed_m_per_s = sqrt(speed_squared)
        limit_n = self.limit_n
        k = self.stiffness.force(stretch_m, limit_n) / stretch_m if stretch_m > LEAST_M else self.stiffness.now
        b = self.damping.force(speed_m_per_s, limit_n) / speed_m_per_s if speed_m_per_s > 0.0 else 0.0
        pulls = []
        for channel, x, speed in zip(self.channels, x_m, speeds, strict=True):
            off_m = -LEAST_M if -LEAST_M < x < LEAST_M else x
            spring_n = -k * off_m
            pulls.append((channel, off_m, speed, spring_n, spring_n - b * speed))
        return pulls

    def _enter(self, gain: float, limit_n: float, dt_s: float) -> None:
        moved_m = self.follower.moved_m
        self.books.carry(sum([channel.applied_n * moved_m[axis] for axis, channel in enumerate(self.channels)]))
        super()._enter(gain, limit_n, dt_s)

    def _enter_wait(self, gain: float, limit_n: float) -> None:
        carried_j = spring_j = 0.0
        for channel, moved_m in zip(self.channels, self.follower.moved_m, strict=True):
            carried_j += channel.applied_n * moved_m
            spring_j += channel.held_n * moved_m
        self.books.wait(carried_j, spring_j, self._stretch_m, self.stiffness, gain, self.weight, limit_n)

    def _go_on(self, passed_s: float) -> None:
        super()._go_on(passed_s)
        ramp_s = self.ramp_s
        if self._left_s > 0.0:
            self._left_s -= passed_s
            ramp_s = max(ramp_s, self._come_in_s())
        step, first = self._steps(passed_s, ramp_s)
        self.stiffness.go_on(step, first)
        self.damping.go_on(step, first)

    def _come_in_s(self) -> float:
        said = self.limits.come_in_s
        return self._unsaid_s if said is None else said
