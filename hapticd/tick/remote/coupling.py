"""A coupling: a spring and a damper between the device and a target that a client moves."""

from __future__ import annotations

from collections.abc import Callable

from hapticd.config.remote import PortLimits
from hapticd.tick.contact import RunningLaw
from hapticd.tick.motion import Motion
from hapticd.tick.remote.follower import Follower
from hapticd.tick.remote.one_port import OnePort, towards
from hapticd.tick.remote.update import DAMPING, POSITION, STIFFNESS, VELOCITY, Update
from hapticd.tick.space.channel import LEAST_M


class Coupling(OnePort):
    """A coupling, ready for the tick.

        f = -k (p - q) - b (v - dq/dt)      p the device, q the followed target

    It pulls as well as it pushes, so that its laws see a contact that is not lost while it is held.

    Args:
        limits: what it may do.
        motion: where the device is.
        make_law: a fresh law, one an axis.
        resolution_m: smallest step of the device's position [m].
        period_s: nominal time between ticks [s].
        ramp_s: duration of its ramps [s].

    Attributes:
        follower: the followed target.
        damping_n_s_per_m: in force now, without the law's [N s/m].
    """

    __slots__ = (
        "_damping_change",
        "_goal_damping",
        "_goal_stiffness",
        "_stiffness_change",
        "damping_n_s_per_m",
        "follower",
    )

    def __init__(
        self,
        limits: PortLimits,
        motion: Motion,
        make_law: Callable[[], RunningLaw],
        resolution_m: float,
        period_s: float,
        ramp_s: float,
    ) -> None:
        super().__init__(limits, motion, make_law, resolution_m, period_s, ramp_s)
        self.follower = Follower(len(self.channels), limits.max_speed_m_per_s, limits.hold_s)
        self.target_m = self.follower.at_m
        self.damping_n_s_per_m = self._goal_damping = limits.damping_n_s_per_m
        self._goal_stiffness = limits.stiffness_n_per_m
        self._stiffness_change = self._damping_change = 0.0

    def change(self, limits: PortLimits) -> None:
        """Go on under other limits, and with what they say of the spring until the client says otherwise."""
        super().change(limits)
        self.follower.max_speed_m_per_s = limits.max_speed_m_per_s
        self.follower.hold_s = limits.hold_s
        self._aim(limits.stiffness_n_per_m, limits.damping_n_s_per_m)

    def _hear(self, update: Update) -> bool:
        if not update.said & POSITION:
            return False
        self.follower.aim(update.position_m, update.velocity_m_per_s if update.said & VELOCITY else None)
        limits = self.limits
        stiffness, damping = limits.stiffness_n_per_m, limits.damping_n_s_per_m
        if update.said & STIFFNESS:
            stiffness = min(max(update.stiffness_n_per_m, 0.0), stiffness)
        if update.said & DAMPING:
            damping = min(max(update.damping_n_s_per_m, 0.0), damping)
        if stiffness != self._goal_stiffness or damping != self._goal_damping:
            self._aim(stiffness, damping)
        return True

    def _aim(self, stiffness_n_per_m: float, damping_n_s_per_m: float) -> None:
        """Have stiffness and damping go to these by a ramp."""
        self._goal_stiffness = stiffness_n_per_m
        self._goal_damping = damping_n_s_per_m
        self._stiffness_change = stiffness_n_per_m - self.stiffness_n_per_m
        self._damping_change = damping_n_s_per_m - self.damping_n_s_per_m

    def _begin(self) -> None:
        motion = self.motion
        self.follower.begin(motion.position_m, motion.velocity_m_per_s)
        self.stiffness_n_per_m = self._goal_stiffness
        self.damping_n_s_per_m = self._goal_damping
        self._stiffness_change = self._damping_change = 0.0

    def _see(self, dt_s: float) -> None:
        follower = self.follower
        begins = not self.channels[0].in_contact
        if not begins:
            follower.move(dt_s)
        motion = self.motion
        stiffness = self.stiffness_n_per_m
        for axis, channel in enumerate(self.channels):
            position_m = motion.position_m[axis]
            x_m = position_m - follower.at_m[axis]
            if -LEAST_M < x_m < LEAST_M:
                x_m = -LEAST_M
            moved_m = position_m - self._from_m[axis] - follower.moved_m[axis]
            speed = motion.velocity_m_per_s[axis] - follower.speed_m_per_s[axis]
            spring_n = -stiffness * x_m
            channel.see(1.0, x_m, moved_m, speed, dt_s, spring_n, spring_n - self.damping_n_s_per_m * speed)

    def _enter(self, gain: float, limit_n: float, dt_s: float) -> None:
        moved_m = self.follower.moved_m
        self.books.carry(sum([channel.applied_n * moved_m[axis] for axis, channel in enumerate(self.channels)]))
        super()._enter(gain, limit_n, dt_s)

    def _go_on(self, passed_s: float) -> None:
        super()._go_on(passed_s)
        if self._stiffness_change != 0.0 or self._damping_change != 0.0:
            step = passed_s / self.ramp_s if passed_s < self.ramp_s else 1.0
            stiffness = towards(self.stiffness_n_per_m, self._goal_stiffness, self._stiffness_change * step)
            damping = towards(self.damping_n_s_per_m, self._goal_damping, self._damping_change * step)
            self.stiffness_n_per_m, self.damping_n_s_per_m = stiffness, damping
            if stiffness == self._goal_stiffness and damping == self._goal_damping:
                self._stiffness_change = self._damping_change = 0.0
