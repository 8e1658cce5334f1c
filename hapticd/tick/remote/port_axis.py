"""One axis of a port, under a law of its own: a contact of the tick of walls that has no wall."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from hapticd.law import LawSnapshot
from hapticd.tick.contact import Contact, RunningLaw
from hapticd.tick.guard import start_blend
from hapticd.tick.remote.books import PortBooks
from hapticd.tick.remote.line import Line
from hapticd.tick.space.channel import Channel

if TYPE_CHECKING:  # a port makes its axes
    from hapticd.tick.remote.one_port import OnePort


class PortAxis(Channel):
    """One axis of a port. The first one leads: its calls go to the port, and those of the others do nothing.

    Args:
        books: of all axes.
        axis: of the device.
        make_law: a fresh law for it.
        resolution_m: smallest step of the device's position [m].

    Attributes:
        make_law: the same.
        port: whose axis it is, from when that is in a scene.
        asked_n: what its law asks for, blended, before the port's own ramp and limit [N].
        own_n: the part of what is applied that is not the law's [N].
    """

    __slots__ = ("_applied_n_s", "_held_n_s", "_leads", "_own_n_s", "asked_n", "make_law", "own_n", "port")

    port: OnePort

    def __init__(self, books: PortBooks, axis: int, make_law: Callable[[], RunningLaw], resolution_m: float) -> None:
        super().__init__(make_law(), resolution_m, books.ledger)
        self.make_law = make_law
        self.wall = Line(axis)  # type: ignore[assignment]  # stands for a wall, see there
        self.awake = False
        self.asked_n = self.own_n = 0.0
        self._applied_n_s = self._held_n_s = self._own_n_s = 0.0  # since the last sample, up to the last tick
        self._leads = axis == 0

    def start(self, position_m: float) -> None:
        """Be at a position, at rest and without force; what a client has said before does not count."""
        del position_m
        if self._leads:
            self.port.stand()

    def wake(self, awake: bool) -> None:
        """Take part in the ticks, or not."""
        self.awake = awake
        self.wall.outward = 1.0 if awake else 0.0

    def observe(self, x_m: float, velocity_m_per_s: float, dt_s: float) -> None:
        """See a new sample; the port looks for itself where the device is."""
        del x_m, velocity_m_per_s
        if self._leads:
            self.port.observe(dt_s)

    def act(self, periods: float) -> None:
        """Ask the laws for their forces.

        Raises:
            BaseException: whatever a law raises.
        """
        if self._leads:
            self.port.act(periods)

    def hold(self, periods: float) -> None:
        """Stay with what the laws asked for last; ramps go on."""
        if self._leads:
            self.port.hold(periods)

    def settle(self, share: float, gain: float, limit_n: float, dt_s: float) -> None:
        """Enter the tick into the books and remember what is applied from now on."""
        if self._leads:
            self.port.settle(share, gain, limit_n, dt_s)

    def blend(self, ticks: int, gain: float, limit_n: float) -> None:
        """Start the next force where the applied one is now, and go over to what the law asks for."""
        if self.in_contact:
            gain *= self.port.weight
            limit_n = min(limit_n, self.port.most_n)
            from_n = self.applied_n / gain if gain > 0.0 else 0.0
            start_blend(self, min(max(from_n, -limit_n), limit_n), -1.0, limit_n, ticks)

    def take_law(self, law: RunningLaw, velocity_m_per_s: float, dt_s: float) -> None:
        """Go on with another law, already started; the caller blends. A port that sleeps does so on."""
        awake = self.awake
        super().take_law(law, velocity_m_per_s, dt_s)
        self.awake = awake

    def ask(self, periods: float) -> None:
        """Ask the law of this axis.

        Raises:
            BaseException: whatever it raises.
        """
        Contact.act(self, periods)
        self.asked_n = self.force_n

    def ask_again(self, periods: float) -> None:
        """Have what it asked for last once more; a blend goes on."""
        self.force_n = self.requested_n
        Contact.hold(self, periods)
        self.asked_n = self.force_n

    def push(self, contact_n: float, spring_n: float = 0.0) -> None:
        """Have the port's own force be another one from this tick on; what its law asked for goes along.

        Args:
            contact_n: the force [N].
            spring_n: the part of it that is a spring's [N].
        """
        self.requested_n += contact_n - self._contact_n
        self.tick.contact_n = self._contact_n = contact_n
        self.wall.spring_n = spring_n

    def rest(self) -> None:
        """Be out of touch, at rest and without force."""
        super().rest()
        self._applied_n_s = self._held_n_s = self._own_n_s = 0.0

    def wait(self, passed_s: float) -> None:
        """Keep what was applied until this tick, which has no new sample [s]."""
        self._applied_n_s += self.applied_n * passed_s
        self._held_n_s += self.held_n * passed_s
        self._own_n_s += self.own_n * passed_s

    def spread(self, passed_s: float, waited_s: float) -> tuple[float, float, float]:
        """Show the law the mean of what was applied since the last sample.

        Args:
            passed_s: time since the last tick [s].
            waited_s: since the last sample, more than 0 [s].

        Returns:
            By how much the mean is more than what was applied last: of all, of the spring's part, and of the part that
            is not the law's [N].
        """
        mean_n = (self._applied_n_s + self.applied_n * passed_s) / waited_s
        mean_held_n = (self._held_n_s + self.held_n * passed_s) / waited_s
        mean_own_n = (self._own_n_s + self.own_n * passed_s) / waited_s
        self._applied_n_s = self._held_n_s = self._own_n_s = 0.0
        self.tick.applied_n = mean_n
        self.tick.applied_contact_n = mean_own_n
        return mean_n - self.applied_n, mean_held_n - self.held_n, mean_own_n - self.own_n

    def apply_scaled(self, share: float, scale: float) -> None:
        """Remember what is applied from now on.

        Args:
            share: how much of the force the guard let through, 0 to 1.
            scale: how much of what was asked for the port let through, 0 to 1.
        """
        contact_n = self._contact_n
        if self.blending:
            contact_n += self.asked_n - self.requested_n  # so that what is left is the law's own part
        tick = self.tick
        tick.applied_n = self.applied_n = share * self.force_n
        tick.applied_contact_n = self._applied_contact_n = self.own_n = share * scale * contact_n

    def snapshot(self, velocity_m_per_s: float = 0.0) -> LawSnapshot:
        """What a law that takes over now starts from: where and how fast it is as seen from the target."""
        del velocity_m_per_s
        return super().snapshot()
