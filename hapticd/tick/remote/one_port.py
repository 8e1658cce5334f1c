"""A port that pulls on the device by itself, a coupling or a force, and its axes, each under a law of its own.

Both stand in one module, since each calls the other: the tick of walls finds the axes among its contacts, the first of
them hands its calls to the port, and the port asks the laws of all.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

from hapticd.config.remote import PortLimits
from hapticd.law import LawSnapshot
from hapticd.tick.contact import Contact, RunningLaw, spread
from hapticd.tick.guard import start_blend
from hapticd.tick.motion import LEAST_S
from hapticd.tick.remote.books import PortBooks
from hapticd.tick.remote.line import Line
from hapticd.tick.remote.port import Port, PortState
from hapticd.tick.remote.port_site import PortSite
from hapticd.tick.remote.ramped import Ramped
from hapticd.tick.remote.update import Update
from hapticd.tick.space.channel import LEAST_M, Channel, share_debt

OUTSIDE_S = 0.5
"""How long a law that keeps time outside is asked after its port was let go [s]."""

STRICTLY = 1.0 - 1e-15
"""So that no rounding puts a force above its limit."""

_HELD = PortState.HELD


class OnePort(Port):
    """A coupling or a force under one law an axis.

        F = w min(1, most / |f|) f      f what the laws ask for, w the ramp by which it is let go and taken up

    The books of all axes are one ledger; energy counts as seen from the followed target, and `work_j` is the rest.

    Args:
        limits: what it may do.
        site: where it is.

    Attributes:
        channels: one an axis; the first one leads.
        books: of all axes together.
        weight: how much of its force is let through, 0 let go to 1.
        scale: of what the laws asked for in this tick, how much is left by ramp and limit.
        most_n: largest force now; it moves to that of `limits` by a ramp [N].
        limit_n: the same, or the guard's where that is less [N].
        stiffness: of its spring [N/m].
        asleep: no client drives it, and nothing of it is left.
        leaving: the scene has it no more.
    """

    __slots__ = (
        "_begun",
        "_comes_in",
        "_from_m",
        "_limit_begins",
        "_most_change_n",
        "_outside_s",
        "_sample_s",
        "_waits",
        "asleep",
        "books",
        "channels",
        "leaving",
        "limit_n",
        "most_n",
        "motion",
        "ramp_s",
        "scale",
        "stiffness",
        "weight",
    )

    def __init__(self, limits: PortLimits, site: PortSite) -> None:
        self.motion = site.motion
        axes = len(site.motion.position_m)
        super().__init__(limits, axes, site.period_s)
        self.books = PortBooks()
        self.channels = [PortAxis(self.books, axis, site.make_law, site.resolution_m) for axis in range(axes)]
        self.ramp_s = site.ramp_s
        self.most_n = self.limit_n = limits.max_force_n
        self.stiffness = Ramped(limits.stiffness_n_per_m)
        self.weight = self.scale = 0.0
        self.asleep = True
        self.leaving = False
        self._begun = False  # since its weight was 0
        self._comes_in = False  # in this tick, for the first time
        self._limit_begins = False  # to move, with the next tick
        self._waits = False  # it has gone on since the last sample
        self._sample_s = 0.0  # of a sample that no law has been shown yet
        self._outside_s = self._most_change_n = 0.0
        self._from_m = [0.0] * axes  # where the device was

    def join(self) -> None:
        """Be in a scene. Only there it and its axes know each other: in the loop no collector looks for circles."""
        for channel in self.channels:
            channel.port = self

    def part(self) -> None:
        """Be in none any more; it must be asleep."""
        self.channels = []

    def take(self, update: Update, age_s: float = 0.0) -> None:
        """Take what the client has said, some time ago [s]; called between ticks."""
        if self.leaving:
            return
        super().take(update, age_s)
        if self.asleep and self.state is _HELD:
            self.asleep = False
            for channel in self.channels:
                channel.wake(True)

    def stand(self) -> None:
        """Be without force and without a client, where the device is now; an event tells of one that was in force."""
        self.lose_client()
        self._sleep()

    def leave(self) -> None:
        """Be gone: what is left of the force fades out."""
        self.leaving = True
        if self.state is _HELD:
            self._become(PortState.RELEASED)

    def set_ramp(self, ramp_s: float) -> None:
        """Let go and come in within this time from now on [s]."""
        self.ramp_s = ramp_s

    def change(self, limits: PortLimits) -> None:
        """Go on under other limits; that of force moves there by a ramp, and at once where nothing is in force."""
        self.limits = limits
        self._most_change_n = limits.max_force_n - self.most_n
        self._limit_begins = True
        if not self._begun:
            self._take_limit()

    def observe(self, dt_s: float) -> None:
        """Know of a new sample.

        Args:
            dt_s: time since the last one, more than 0 [s].
        """
        self._sample_s = dt_s

    def act(self, periods: float) -> None:
        """Ask the laws for their forces.

        Args:
            periods: time since the last tick, in periods of the loop.

        Raises:
            BaseException: whatever a law raises.
        """
        if self.asleep:
            self._doze(periods)
            return
        if self._sample_s > 0.0:  # once a tick, also where a law fails and all are asked again
            passed_s = periods * self._period_s
            if self.channels[0].waited > 0.0:
                self._spread(periods)
            self._look(self._sample_s, passed_s)
            self._sample_s = 0.0
            self._go_on(passed_s)
        for channel in self.channels:
            channel.ask(periods)
        self._limit()

    def hold(self, periods: float) -> None:
        """Stay with what the laws added last, at a tick without a new sample; what is the port's own goes on.

        Args:
            periods: time since the last tick, in periods of the loop.
        """
        if self.asleep:
            self._doze(periods)
            return
        passed_s = periods * self._period_s
        self._waits = self._begun and self._wait(max(passed_s, LEAST_S))
        self._go_on(passed_s)
        for channel in self.channels:
            channel.ask_again(periods)
        self._limit()

    def settle(self, share: float, gain: float, limit_n: float, dt_s: float) -> None:
        """Enter the tick into the books and remember what is applied from now on.

        Args:
            share: how much of the force the guard let through, 0 to 1.
            gain: how much of that a release has left, 0 to 1.
            limit_n: the guard's limit for one contact [N].
            dt_s: time since the last sample; 0: this is the same once more, and the books wait for the next [s].
        """
        if self.asleep:
            return
        channels = self.channels
        self.limit_n = limit_n = min(limit_n, self.most_n)
        if dt_s > 0.0:
            self._enter(gain, limit_n, dt_s)
        elif self._waits:
            self._enter_wait(gain, limit_n)
        spring_squared = 0.0
        for channel in channels:
            spring_squared += channel.wall.spring_n * channel.wall.spring_n
        held = gain * self.weight
        if spring_squared > limit_n * limit_n:
            held *= limit_n / sqrt(spring_squared)
        for axis, channel in enumerate(channels):
            channel.apply_scaled(share, self.scale)
            channel.held_n = held * channel.wall.spring_n
            self.force_n[axis] = channel.applied_n
        if self.weight == 0.0 and self.state is not _HELD and self._is_quiet():
            self._sleep()

    def share_debt(self) -> None:
        """Have the axes know what each of them owes, for laws that start now."""
        share_debt(self.channels, self.books.ledger.debt_j)

    @property
    def work_j(self) -> float:
        """What the client's motion, changes and forces have put in, less what they took [J]."""
        return self.books.moved_j

    def law_values(self) -> tuple[float, float, float]:
        """Stiffness in force [N/m], damping of the law [N s/m] and the mass that it has felt [kg], for a record."""
        damping = mass = 0.0
        for channel in self.channels:
            damping = max(damping, channel.damping_n_s_per_m)
            mass = max(mass, channel.felt_mass_kg)
        return self.stiffness.now, damping, mass

    def _begin(self) -> None:
        """Come into force where the device is."""
        raise NotImplementedError

    def _see(self, dt_s: float, moved_s: float) -> None:
        """Show the laws a new sample.

        Args:
            dt_s: time since the last one, more than 0 [s].
            moved_s: for how long what the client moves has yet to go on; 0: it has just begun [s].
        """
        raise NotImplementedError

    def _wait(self, passed_s: float) -> bool:
        """Go on at a tick without a new sample, with the device where it was; False: there is nothing to move [s]."""
        del passed_s
        return False

    def _enter_wait(self, gain: float, limit_n: float) -> None:
        """Keep for the books what became of it in such a tick."""
        raise NotImplementedError

    def _enter_spread(self, taken_j: float, spring_j: float, own_j: float) -> None:
        """Keep for the books what the device took beyond what it would have under the last tick's force [J].

        Args:
            taken_j: from all of what was applied.
            spring_j: from the spring's part.
            own_j: from the part that is not the law's.
        """
        del own_j
        self.books.spread(taken_j, spring_j)

    def _enter(self, gain: float, limit_n: float, dt_s: float) -> None:
        """Enter a tick into the books: first the motion, then what has become of the port."""
        x_squared = taken_j = spring_j = 0.0
        for channel in self.channels:
            given_j = channel.applied_n * channel.way_m
            channel.taken_j -= given_j
            taken_j -= given_j
            spring_j -= channel.held_n * channel.way_m
            x_squared += channel.x_of_law_m * channel.x_of_law_m
        stretch_m = sqrt(x_squared)
        damping = max([channel.damping_n_s_per_m for channel in self.channels])
        self.books.enter(taken_j, spring_j, stretch_m, self.channels[0].in_contact, damping, dt_s)
        self.books.change(self.stiffness, stretch_m, gain, self.weight, limit_n)

    def _go_on(self, passed_s: float) -> None:
        """Count time: of the client's silence, of the ramps, of the force that was held."""
        driven = self.limits.driven
        for axis, channel in enumerate(self.channels):
            self.impulse_n_s[axis] += (channel.applied_n if driven else channel.own_n) * passed_s
        self.pass_time(passed_s)
        step, first = self._steps(passed_s, self.ramp_s)
        if self.state is _HELD:
            if self._begun:  # a ramp begins with the first sample that there is a force for
                self.weight = min(1.0, self.weight + (first if self._comes_in else step))
                self._comes_in = False
        elif self.weight > step:
            self.weight -= step
        else:
            self.weight = 0.0
            self._begun = False  # who speaks from now on begins where the device is, with the next sample
            self._take_limit()
        goal_n = self.limits.max_force_n
        if self.most_n != goal_n:
            most_n = self.most_n + self._most_change_n * (first if self._limit_begins else step)
            self.most_n = min(goal_n, most_n) if self._most_change_n > 0.0 else max(goal_n, most_n)
        self._limit_begins = False

    def _steps(self, passed_s: float, ramp_s: float) -> tuple[float, float]:
        """How far a ramp comes in this tick, as a share: one that is under way, and one that begins with it."""
        first_s = min(passed_s, self._period_s)
        return min(1.0, passed_s / ramp_s), min(1.0, first_s / ramp_s)

    def _take_limit(self) -> None:
        """Have the limit of force where it goes: nothing is in force that could step."""
        self.most_n = self.limit_n = self.limits.max_force_n

    def _limit(self) -> None:
        """Bring what the laws ask for under ramp and limit."""
        channels = self.channels
        squared = 0.0
        for channel in channels:
            squared += channel.force_n * channel.force_n
        scale = self.weight
        if squared > self.most_n * self.most_n:
            scale *= STRICTLY * self.most_n / sqrt(squared)
        self.scale = scale
        for channel in channels:
            channel.force_n *= scale

    def _look(self, dt_s: float, passed_s: float) -> None:
        """See a new sample, with what the client moves where it is then.

        Both clocks tell the time since the last sample where that was seen in the last tick. Where ticks went by in
        between, only this computer's tells what is left of it.
        """
        if self.state is not _HELD and self.weight == 0.0:
            self._see_outside(dt_s)
            return
        position_m = self.motion.position_m
        moved_s = max(passed_s, LEAST_S) if self._waits else dt_s
        if not self._begun:
            self._begun = self._comes_in = True
            moved_s = 0.0
            for channel in self.channels:
                channel.taken_j = 0.0
            self._begin()
            self._from_m[:] = position_m
        self._waits = False
        self._see(dt_s, moved_s)
        self._from_m[:] = position_m

    def _spread(self, periods: float) -> None:
        """Have books and laws reckon with the mean of what was applied since the last sample.

        Args:
            periods: time since the last tick, in periods of the loop.
        """
        taken_j = spring_j = own_j = 0.0
        for axis, channel in enumerate(self.channels):
            way_m = self.motion.position_m[axis] - self._from_m[axis]
            more_n, more_spring_n, more_own_n = channel.spread(periods)
            channel.taken_j -= more_n * way_m
            taken_j -= more_n * way_m
            spring_j -= more_spring_n * way_m
            own_j -= more_own_n * way_m
        self._enter_spread(taken_j, spring_j, own_j)

    def _see_outside(self, dt_s: float) -> None:
        """See a sample while nothing is in force; laws that keep time are asked on for a while."""
        self._outside_s = self._outside_s + dt_s if not self.channels[0].in_contact else 0.0
        for channel in self.channels:
            channel.see(0.0, LEAST_M, 0.0, 0.0, dt_s, 0.0, 0.0)

    def _is_quiet(self) -> bool:
        first = self.channels[0]
        return not first.in_contact and (first.law.rests or self._outside_s > OUTSIDE_S)

    def _sleep(self) -> None:
        """Do nothing until a client speaks, but count the time that an event has to wait for."""
        self.asleep = True
        self.weight = self.scale = self._outside_s = 0.0
        self._begun = self._waits = False
        self._sample_s = 0.0
        self._take_limit()
        self.books.let_go()
        for axis, channel in enumerate(self.channels):
            channel.rest()
            channel.wake(False)
            self.force_n[axis] = 0.0
        self.channels[0].wake(self._waits_to_tell)

    def _doze(self, periods: float) -> None:
        """Count time in a sleep, for as long as an event waits for it."""
        if self.channels[0].awake:
            self._keep_quiet(periods * self._period_s)
            self.channels[0].wake(self._waits_to_tell)


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

    __slots__ = ("_leads", "asked_n", "make_law", "own_n", "port")

    port: OnePort

    def __init__(self, books: PortBooks, axis: int, make_law: Callable[[], RunningLaw], resolution_m: float) -> None:
        super().__init__(make_law(), resolution_m, books.ledger)
        self.make_law = make_law
        self.wall = Line(axis)  # type: ignore[assignment]  # stands for a wall, see there
        self.awake = False
        self.asked_n = self.own_n = 0.0
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

    def spread(self, periods: float) -> tuple[float, float, float]:
        """Show the law the mean of what was applied since the last sample.

        Args:
            periods: time since the last tick, in periods of the loop.

        Returns:
            By how much the mean is more than what was applied last: of all, of the spring's part, and of the part that
            is not the law's [N].
        """
        spread(self, periods)
        own_n = self.tick.applied_contact_n
        return self.mean_n - self.applied_n, self.mean_spring_n - self.held_n, own_n - self.own_n

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
        tick.applied_n = self.mean_n = self.applied_n = share * self.force_n
        tick.applied_contact_n = self._applied_contact_n = self.own_n = share * scale * contact_n

    def snapshot(self, velocity_m_per_s: float = 0.0) -> LawSnapshot:
        """What a law that takes over now starts from: where and how fast it is as seen from the target."""
        del velocity_m_per_s
        return super().snapshot()
