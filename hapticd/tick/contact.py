"""One wall under one law: the contact's force, its share of what was applied, its books."""

from __future__ import annotations

from copy import copy
from types import ModuleType
from typing import Any

from hapticd.errors import PluginError, in_words
from hapticd.law import (
    LawParams,
    LawSnapshot,
    LawTick,
    fresh_state,
    learned_fields,
    plain_object,
    rests_outside,
    scalar_params,
)
from hapticd.tick.energy import EnergyLedger
from hapticd.tick.guard import blended, blended_again, start_blend
from hapticd.tick.scene import Wall

MOST = 1e18
"""A law that asks for more [N], or publishes more, is broken, whatever the limits are."""

LONGEST_TICK = 1e9
"""For longer no tick counts in a mean, whatever a clock says: no sum of such times is infinite [periods]."""


class RunningLaw:
    """A law with its state and parameters as plain objects, ready for the tick.

    Args:
        module: the law.
        params: its validated parameters.
    """

    __slots__ = (
        "learns_damping",
        "module",
        "params",
        "publishes",
        "publishes_damping",
        "publishes_mass",
        "rests",
        "state",
        "step",
    )

    def __init__(self, module: ModuleType, params: LawParams) -> None:
        self.module = module
        self.params = plain_object(f"{module.__name__}.Params", scalar_params(params))
        self.state: Any = fresh_state(module)
        self.step = module.step
        self.publishes_damping = hasattr(self.state, "damping_n_s_per_m")
        self.publishes_mass = hasattr(self.state, "felt_mass_kg")
        self.learns_damping = "damping_n_s_per_m" in learned_fields(module)
        self.publishes = self.publishes_damping or self.publishes_mass
        self.rests = rests_outside(module)

    def another(self) -> RunningLaw:
        """The same law once more; sooner made than the first one, which takes its parameters apart."""
        twin = copy(self)
        twin.params = copy(self.params)
        twin.state = copy(self.state)
        return twin

    def start(self, snapshot: LawSnapshot) -> None:
        """Activate the law.

        Raises:
            PluginError: the law raised.
        """
        try:
            self.module.start(self.state, self.params, snapshot)
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            name = self.module.__name__
            raise PluginError(f"law {name} cannot start: {in_words(error, name)}") from error


class Contact:
    """One wall, the law that stabilises it and the ledger that watches both.

    What the law is shown is a copy: nothing that it writes there reaches the force, the books or the next tick.

    Args:
        wall: the compiled wall.
        law: the law on this wall.
        resolution_m: smallest step of the device's position [m].

    Attributes:
        x_m: position relative to the wall, < 0 inside [m].
        in_contact: whether it is inside.
        requested_n: what the law asked for in this tick, outward [N].
        force_n: the same after the blend of a transition, before the guard's share [N].
        applied_n: what was applied in the end [N].
        mean_n, mean_spring_n: what the books reckon with, all of it and the spring's part: the mean since the last
            sample, where ticks without one have gone by; else what was applied last [N].
        waited: how long ticks have gone by without a sample, in periods of the loop; 0: the last one had one.
        applied_sum, spring_sum, own_sum: over that time what was applied, the spring's part of it and the contact's
            own, each times how long it was held [N periods].
        damping_n_s_per_m, felt_mass_kg: as published by the law; 0 when it has none.
        awake: whether a tick outside the wall has anything to do here; else it need only keep `x_m`.
    """

    __slots__ = (
        "_applied_contact_n",
        "_applied_spring_n",
        "_contact_n",
        "_moved_m",
        "_resolution_m",
        "_touched",
        "applied_n",
        "applied_sum",
        "awake",
        "blend_from_n",
        "blend_from_x_m",
        "blend_limit_n",
        "blend_tick",
        "blend_ticks",
        "blending",
        "damping_n_s_per_m",
        "felt_mass_kg",
        "force_n",
        "in_contact",
        "law",
        "ledger",
        "mean_n",
        "mean_spring_n",
        "own_sum",
        "requested_n",
        "spring_sum",
        "tick",
        "waited",
        "wall",
        "x_m",
    )

    def __init__(self, wall: Wall, law: RunningLaw, resolution_m: float) -> None:
        self.wall = wall
        self.law = law
        self.ledger = EnergyLedger()
        self.tick = LawTick(resolution_m)
        self.x_m = 0.0
        self.in_contact = False
        self.requested_n = 0.0
        self.force_n = 0.0
        self.applied_n = self.mean_n = self.mean_spring_n = 0.0
        self.waited = self.applied_sum = self.spring_sum = self.own_sum = 0.0
        self.damping_n_s_per_m = 0.0
        self.felt_mass_kg = 0.0
        self.blending = False
        self.awake = True
        self._touched = True
        self._moved_m = 0.0
        self._contact_n = 0.0
        self._applied_contact_n = 0.0
        self._applied_spring_n = 0.0
        self._resolution_m = resolution_m

    def start(self, position_m: float) -> None:
        """Be at a position, at rest and without force."""
        self.x_m = self.wall.outward * (position_m - self.wall.position_m)
        self.in_contact = self.x_m < 0.0
        self.blending = False
        self.awake = self._touched = True
        self.force_n = self.requested_n = 0.0
        self.applied_n = self._applied_contact_n = self._applied_spring_n = 0.0
        self.mean_n = self.mean_spring_n = 0.0
        self.waited = self.applied_sum = self.spring_sum = self.own_sum = 0.0
        self.tick.applied_n = self.tick.applied_contact_n = 0.0

    def snapshot(self, velocity_m_per_s: float) -> LawSnapshot:
        """What a law that takes over now starts from.

        Args:
            velocity_m_per_s: velocity of the wall's axis [m/s].
        """
        velocity_m_per_s = self.wall.outward * velocity_m_per_s
        learned_n_s_per_m = self.damping_n_s_per_m if self.law.learns_damping else 0.0
        return LawSnapshot(self.x_m, velocity_m_per_s, self.applied_n, self.ledger.debt_j, learned_n_s_per_m)

    def take_law(self, law: RunningLaw, velocity_m_per_s: float, dt_s: float) -> None:
        """Go on with another law, already started; the caller blends.

        Args:
            law: the law.
            velocity_m_per_s: velocity of the wall's axis [m/s].
            dt_s: time between the last two samples [s].
        """
        if not (self.law.learns_damping and law.learns_damping):  # else another one may come before this one is asked
            self.damping_n_s_per_m = 0.0
        self.felt_mass_kg = 0.0
        self.law = law
        self.awake = self._touched = True  # it is shown that it is outside
        # The law before may have left anything in its tick.
        self.tick = tick = LawTick(self._resolution_m)
        tick.x_m = self.x_m
        tick.moved_m = self._moved_m
        tick.velocity_m_per_s = self.wall.outward * velocity_m_per_s
        tick.dt_s = dt_s
        tick.in_contact = self.in_contact
        tick.contact_n = self._contact_n
        tick.spring_n = self.wall.spring_n
        tick.applied_n = self.applied_n
        tick.applied_contact_n = self._applied_contact_n

    def blend(self, ticks: int, gain: float, limit_n: float) -> None:
        """Start the next force where the applied one is now, and go over to what the law asks for.

        Outside the wall there is nothing to blend: what comes then comes from the device's own motion.

        Args:
            ticks: how many periods it takes.
            gain: the guard's gain that the next force will be multiplied by.
            limit_n: the guard's limit for one contact [N].
        """
        self.blending = False
        if self.in_contact:
            start_blend(self, self.applied_n / gain if gain > 0.0 else 0.0, self.x_m, limit_n, ticks)

    def observe(self, x_m: float, velocity_m_per_s: float, dt_s: float) -> None:
        """See a new sample.

        Args:
            x_m: position relative to the wall, < 0 inside [m].
            velocity_m_per_s: velocity of the wall's axis [m/s].
            dt_s: time since the last sample [s].
        """
        wall = self.wall
        tick = self.tick
        tick.moved_m = self._moved_m = x_m - self.x_m
        tick.x_m = self.x_m = x_m
        tick.velocity_m_per_s = velocity_m_per_s = wall.outward * velocity_m_per_s
        tick.dt_s = dt_s
        if x_m < 0.0:
            tick.in_contact = self.in_contact = True
            tick.contact_n = self._contact_n = wall.force(x_m, velocity_m_per_s)
            tick.spring_n = wall.spring_n
        else:
            tick.in_contact = self.in_contact = False
            tick.contact_n = self._contact_n = tick.spring_n = wall.spring_n = 0.0

    def act(self, periods: float) -> None:
        """Ask the law for its force.

        Args:
            periods: time since the last tick, in periods of the loop.

        Raises:
            BaseException: whatever the law raises.
            ArithmeticError: it returned or publishes something beyond all bounds.
            TypeError: it returned or publishes something that is not a number.
        """
        if self.waited > 0.0:
            spread(self, periods)
        law = self.law
        force_n = law.step(law.state, law.params, self.tick)
        if law.publishes:
            state = law.state
            if law.publishes_damping:
                value = state.damping_n_s_per_m
                self.damping_n_s_per_m = value if value.__class__ is float and -MOST < value < MOST else _number(value)
            if law.publishes_mass:
                value = state.felt_mass_kg
                self.felt_mass_kg = value if value.__class__ is float and -MOST < value < MOST else _number(value)
        if not self.in_contact:
            # Nothing is sent outside, whatever the law says; it still sees the tick, to know that contact is lost.
            self.blending = False
            self.requested_n = self.force_n = 0.0
            return
        if force_n.__class__ is not float or not -MOST < force_n < MOST:  # NaN fails every comparison
            force_n = _number(force_n)
        self.requested_n = force_n
        self.force_n = blended(self, self.x_m, force_n, periods) if self.blending else force_n

    def hold(self, periods: float) -> None:
        """Stay with what the law asked for last, at a tick without a new sample; a blend goes on.

        Args:
            periods: time since the last tick, in periods of the loop.
        """
        held = periods if periods < LONGEST_TICK else LONGEST_TICK
        self.waited += held
        self.applied_sum += self.applied_n * held
        self.spring_sum += self._applied_spring_n * held
        self.own_sum += self._applied_contact_n * held
        if self.blending:
            self.force_n = blended_again(self, self.x_m, self.requested_n, periods)

    def settle(self, share: float, gain: float, limit_n: float, dt_s: float) -> None:
        """Enter the tick into the books and remember what is applied from now on.

        The books take the spring for what it is, flat from the limit on and fading with a release; what walls that
        share a limit, dampers and blends make of it counts as dissipated.

        Args:
            share: how much of the force the guard let through, 0 to 1.
            gain: how much of that a release has left, 0 to 1.
            limit_n: the guard's limit for one contact [N].
            dt_s: time since the last sample; 0: this is the same once more, and the books wait for the next [s].
        """
        wall = self.wall
        in_contact = self.in_contact
        touched = in_contact or self.applied_n != 0.0
        if dt_s > 0.0 and (touched or self._touched):  # once more after the touch; then nothing changes any more
            self._touched = touched
            self.awake = touched or not self.law.rests
            self.ledger.update(
                self._moved_m,
                self.mean_n,
                self.mean_spring_n,
                gain * wall.stored_j(self.x_m, limit_n),
                in_contact,
                self.damping_n_s_per_m,
                dt_s,
            )
        contact_n = self._contact_n
        if self.blending:
            contact_n += self.force_n - self.requested_n  # so that what is left is the law's own part
        tick = self.tick
        tick.applied_n = self.mean_n = self.applied_n = share * self.force_n
        tick.applied_contact_n = self._applied_contact_n = share * contact_n
        spring_n = wall.spring_n
        self._applied_spring_n = gain * (spring_n if spring_n <= limit_n else limit_n)
        self.mean_spring_n = self._applied_spring_n


def spread(contact: Any, periods: float) -> None:
    """Have the law and the books reckon with the mean of what was applied since the last sample.

    The device has moved for all that time, as far as is known evenly, and not with the last tick's force alone.

    Args:
        contact: one that has waited.
        periods: time since the last tick, in periods of the loop.
    """
    held = periods if periods < LONGEST_TICK else LONGEST_TICK
    waited = contact.waited + held
    tick = contact.tick
    tick.applied_n = contact.mean_n = (contact.applied_sum + contact.applied_n * held) / waited
    tick.applied_contact_n = (contact.own_sum + tick.applied_contact_n * held) / waited
    contact.mean_spring_n = (contact.spring_sum + contact.mean_spring_n * held) / waited
    contact.waited = contact.applied_sum = contact.spring_sum = contact.own_sum = 0.0


def _number(value: Any) -> float:
    """A law's number as a plain float within bounds.

    Raises:
        ArithmeticError: NaN, infinite or beyond all bounds.
        TypeError: not a number.
    """
    if not isinstance(value, (int, float)):
        raise TypeError(f"{value!r} is not a number")
    number = float(value)
    if not -MOST < number < MOST:
        raise ArithmeticError(f"{number} is not a possible number")
    return number
