"""A raw force from a client, under limits and under the law."""

from __future__ import annotations

from math import sqrt

from hapticd.config.remote import PortLimits
from hapticd.tick.remote.one_port import OnePort
from hapticd.tick.remote.port_site import PortSite
from hapticd.tick.remote.update import FORCE, RELEASED, Update
from hapticd.tick.space.channel import LEAST_M

BLEND_S = 0.005
"""In which a force goes from nothing to the largest one that the port allows, or back [s]."""

LET_GO_S = 0.05
"""In which a force whose client is silent is gone at the latest [s]: held, it would push the hand along."""


class StreamedForce(OnePort):
    """A force, ready for the tick. Its law sees a port without a spring, on which the client does all the work.

    Args:
        limits: what it may do.
        site: where it is.
    """

    __slots__ = ("_client", "_goal_is_new", "_goal_n", "_now_n", "_same_s")

    def __init__(self, limits: PortLimits, site: PortSite) -> None:
        super().__init__(limits, site)
        self.set_ramp(site.ramp_s)
        self._goal_n = [0.0] * len(self.channels)
        self._now_n = [0.0] * len(self.channels)
        self._same_s = 0.0
        self._client = 0
        self._goal_is_new = False

    def set_ramp(self, ramp_s: float) -> None:
        """Let go and come in within this time, and never more than `LET_GO_S`, from now on [s]."""
        super().set_ramp(min(ramp_s, LET_GO_S))

    def take(self, update: Update, age_s: float = 0.0) -> None:
        """Take what the client has said, some time ago [s]; called between ticks."""
        if update.said & RELEASED:  # what comes after it was chosen anew, the same or not
            self._same_s = 0.0
        super().take(update, age_s)

    def forget(self) -> None:
        """Know nothing of a client until it says something anew."""
        super().forget()
        self._same_s = 0.0

    def _hear(self, update: Update, age_s: float) -> bool:
        del age_s
        if not update.said & FORCE:
            return False
        most = self.limits.max_force_n
        goal_n = update.force_n[: len(self._goal_n)]
        largest_n = max(map(abs, goal_n))
        if largest_n > most:  # first, so that no square is too large
            goal_n = [newton / largest_n * most for newton in goal_n]
        length = sqrt(sum([newton * newton for newton in goal_n]))
        if length > most:
            goal_n = [newton * (most / length) for newton in goal_n]
        if goal_n != self._goal_n or not any(goal_n):
            self._same_s = 0.0
            self._goal_is_new = True
        if update.client != self._client:  # it has chosen that itself, the same or not
            self._client = update.client
            self._same_s = 0.0
        self._goal_n = goal_n
        return not self._stands_too_long()

    def _hangs(self, passed_s: float) -> bool:
        self._same_s += passed_s
        return self._stands_too_long()

    def _stands_too_long(self) -> bool:
        return 0.0 < self.limits.unchanged_s < self._same_s and any(self._goal_n)

    def _begin(self) -> None:
        self._now_n[:] = [0.0] * len(self._now_n)

    def _see(self, dt_s: float, moved_s: float) -> None:
        del moved_s
        motion = self.motion
        for axis, channel in enumerate(self.channels):
            moved_m = motion.position_m[axis] - self._from_m[axis]
            channel.see(1.0, -LEAST_M, moved_m, motion.velocity_m_per_s[axis], dt_s, 0.0, self._now_n[axis])

    def _go_on(self, passed_s: float) -> None:
        """The force goes on at every tick: a device may have samples that are further apart than `BLEND_S`."""
        super()._go_on(passed_s)
        if not self.channels[0].in_contact:
            return
        if self._goal_is_new:  # what passed of a late tick before it was said is no part of the way to it
            passed_s = min(passed_s, self._period_s)
            self._goal_is_new = False
        step_n = self.limits.max_force_n * passed_s / BLEND_S
        way_n = [goal - now for goal, now in zip(self._goal_n, self._now_n, strict=True)]
        length_n = sqrt(sum([newton * newton for newton in way_n]))
        share = step_n / length_n if length_n > step_n else 1.0
        for axis, channel in enumerate(self.channels):
            self._now_n[axis] += share * way_n[axis]
            channel.push(self._now_n[axis])

    def _enter_spread(self, taken_j: float, spring_j: float, own_j: float) -> None:
        super()._enter_spread(taken_j, spring_j, own_j)
        self.books.give(-own_j)

    def _enter(self, gain: float, limit_n: float, dt_s: float) -> None:
        """The client's own part of the force is its work, and the law's is lost."""
        super()._enter(gain, limit_n, dt_s)
        self.books.give(sum([channel.own_n * channel.way_m for channel in self.channels]))
