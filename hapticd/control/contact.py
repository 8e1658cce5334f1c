"""One wall under one law: the contact's force, its share of what was applied, its books."""

from __future__ import annotations

from types import ModuleType
from typing import Any

from hapticd.contracts.law import LawParams, LawSnapshot, LawTick, fresh_state, plain_object, scalar_params
from hapticd.energy import EnergyLedger
from hapticd.scene import Wall


class RunningLaw:
    """A law with its state and parameters as plain objects, ready for the tick.

    Args:
        module: the law.
        params: its validated parameters.
    """

    __slots__ = ("module", "params", "publishes_damping", "publishes_mass", "state", "step")

    def __init__(self, module: ModuleType, params: LawParams) -> None:
        self.module = module
        self.params = plain_object(f"{module.__name__}.Params", scalar_params(params))
        self.state: Any = fresh_state(module)
        self.step = module.step
        self.publishes_damping = hasattr(self.state, "damping_n_s_per_m")
        self.publishes_mass = hasattr(self.state, "felt_mass_kg")

    @property
    def damping_n_s_per_m(self) -> float:
        """Damping that the law has reached [N s/m]; 0 when it has none."""
        return self.state.damping_n_s_per_m if self.publishes_damping else 0.0

    @property
    def felt_mass_kg(self) -> float:
        """Mass that the law has identified [kg]; 0 while unknown."""
        return self.state.felt_mass_kg if self.publishes_mass else 0.0


class Contact:
    """One wall, the law that stabilises it and the ledger that watches both.

    Args:
        wall: the compiled wall.
        law: the law on this wall.
        resolution_m: smallest step of the device's position [m].

    Attributes:
        requested_n: what the law asked for in this tick, outward [N].
        force_n: the same after the blend of a transition, before the guard's share [N].
    """

    __slots__ = ("_applied_spring_n", "_blend_n", "_blend_pending", "_blend_step_n", "_ramp_ticks", "force_n", "law", "ledger", "requested_n", "tick", "wall")

    def __init__(self, wall: Wall, law: RunningLaw, resolution_m: float) -> None:
        self.wall = wall
        self.law = law
        self.ledger = EnergyLedger()
        self.tick = LawTick(resolution_m)
        self.requested_n = 0.0
        self.force_n = 0.0
        self._applied_spring_n = 0.0
        self._blend_n = 0.0
        self._blend_step_n = 0.0
        self._blend_pending = False
        self._ramp_ticks = 1

    def start(self, position_m: float) -> None:
        """Begin at a position, at rest and without force."""
        self.tick.x_m = self.wall.outward * (position_m - self.wall.position_m)
        self.law.module.start(self.law.state, self.law.params, LawSnapshot(x_m=self.tick.x_m))

    def lose_sight(self) -> None:
        """Forget what was applied: the position was unknown for a while, and the force has been let out."""
        self.tick.applied_n = self.tick.applied_contact_n = self._applied_spring_n = 0.0
        self.force_n = self.requested_n = 0.0

    def switch_law(self, law: RunningLaw, ramp_ticks: int) -> None:
        """Hand over to another law, without a step in force: the difference is ramped out over `ramp_ticks`."""
        tick = self.tick
        snapshot = LawSnapshot(
            tick.x_m, tick.velocity_m_per_s, tick.applied_n, self.ledger.debt_j, self.law.damping_n_s_per_m
        )
        law.module.start(law.state, law.params, snapshot)
        self.law = law
        self.blend(ramp_ticks)

    def switch_wall(self, wall: Wall, ramp_ticks: int) -> None:
        """Become another wall in the same place, without a step in force."""
        self.wall = wall
        self.blend(ramp_ticks)

    def blend(self, ramp_ticks: int) -> None:
        """Start the next force where the applied one is now, and let the difference fade over `ramp_ticks`."""
        self._blend_pending = True
        self._ramp_ticks = ramp_ticks

    def observe(self, position_m: float, velocity_m_per_s: float, dt_s: float) -> None:
        """See a new sample.

        Args:
            position_m: position of the wall's axis [m].
            velocity_m_per_s: velocity of the axis [m/s].
            dt_s: time since the last sample [s].
        """
        wall = self.wall
        tick = self.tick
        if wall.changes_left:
            wall.count_tick()
        x_m = wall.outward * (position_m - wall.position_m)
        tick.moved_m = x_m - tick.x_m
        tick.x_m = x_m
        tick.velocity_m_per_s = velocity_m_per_s = wall.outward * velocity_m_per_s
        tick.dt_s = dt_s
        if x_m < 0.0:
            tick.in_contact = True
            tick.contact_n = wall.force(x_m, velocity_m_per_s)
        else:
            tick.in_contact = False
            tick.contact_n = wall.spring_n = 0.0

    def act(self) -> float:
        """What this contact asks for, outward [N]."""
        tick = self.tick
        law = self.law
        force_n: float = law.step(law.state, law.params, tick)
        if not tick.in_contact:
            # Nothing is sent outside, whatever the law says; it still sees the tick, to know that contact is lost.
            self._blend_pending = False
            self._blend_n = self.requested_n = self.force_n = 0.0
            return 0.0
        self.requested_n = force_n
        if self._blend_pending:
            self._blend_pending = False
            self._blend_n = tick.applied_n - force_n
            self._blend_step_n = self._blend_n / self._ramp_ticks
        elif self._blend_n != 0.0:
            left_n = self._blend_n - self._blend_step_n
            # Past zero the sign turns: the blend is over.
            self._blend_n = left_n if left_n * self._blend_step_n > 0.0 else 0.0
        self.force_n = force_n = force_n + self._blend_n
        return force_n

    def settle(self, share: float, limit_n: float) -> None:
        """Enter the tick into the books and remember what is applied from now on.

        Args:
            share: how much of the force the guard let through, 0 to 1.
            limit_n: the guard's force limit [N].
        """
        tick = self.tick
        wall = self.wall
        law = self.law
        self.ledger.update(
            tick.moved_m,
            tick.applied_n,
            self._applied_spring_n,
            wall.stored_j(tick.x_m, limit_n) if share > 0.0 else 0.0,
            tick.in_contact,
            law.state.damping_n_s_per_m if law.publishes_damping else 0.0,
            tick.dt_s,
        )
        tick.applied_n = share * self.force_n
        tick.applied_contact_n = share * tick.contact_n
        self._applied_spring_n = share * wall.spring_n
