"""The books of one port: of its spring, and of what its client's motion and changes put in."""

from __future__ import annotations

from hapticd.tick.energy import EnergyLedger
from hapticd.tick.remote.ramped import Ramped


class PortBooks:
    """What became of the energy at a port.

        energy - carried = stored + dissipated - generated - moved

    Attributes:
        ledger: its energy counts as seen from the followed target.
        moved_j: what the client's motion, changes and forces put in, less what they took [J].
        carried_j: the part of it that is the force's work along the target's way [J].
        friction_j, friction_stored_j: 0: a port has no friction [J].
    """

    friction_j = 0.0
    friction_stored_j = 0.0

    __slots__ = (
        "_carried_j",
        "_changed_j",
        "_gain",
        "_limit_n",
        "_lost_j",
        "_spread_j",
        "_spread_spring_j",
        "_spring_j",
        "_stiffness",
        "_waits",
        "_weight",
        "carried_j",
        "ledger",
        "moved_j",
    )

    def __init__(self) -> None:
        self.ledger = EnergyLedger()
        self.moved_j = 0.0
        self.carried_j = 0.0
        self._stiffness = Ramped(0.0)
        self._gain = self._weight = self._limit_n = 0.0
        self._spread_j = self._spread_spring_j = 0.0
        self._forget_wait()

    def carry(self, work_j: float) -> None:
        """Enter the work of the force that was held along the target's way [J]."""
        self.carried_j += work_j
        self.moved_j += work_j

    def give(self, work_j: float) -> None:
        """Take for the client's own what the ledger has entered as a gain of the device's [J]."""
        self.moved_j += work_j
        self.ledger.dissipated_j += work_j

    def spread(self, taken_j: float, spring_j: float) -> None:
        """Keep for the next entry what the device took beyond what it would have under the last tick's force [J].

        Args:
            taken_j: from all of what was applied.
            spring_j: from the spring's part.
        """
        self._spread_j = taken_j
        self._spread_spring_j = spring_j

    def enter(
        self, taken_j: float, spring_j: float, stretch_m: float, in_contact: bool, damping_n_s_per_m: float, dt_s: float
    ) -> None:
        """Enter what the device's motion did, with the spring as it was.

        Args:
            taken_j: energy that the force that was applied took, as seen from the target [J].
            spring_j: the part of it that the spring's own force took [J].
            stretch_m: length of the spring now [m].
            in_contact: whether the port is in force.
            damping_n_s_per_m: damping of the law now, entered with a completed cycle [N s/m].
            dt_s: time since the last sample [s].
        """
        if self._waits:
            self.carry(self._carried_j)
            self.moved_j += self._changed_j
            self.ledger.stored_j += self._changed_j - self._lost_j
            self.ledger.dissipated_j += self._lost_j
            taken_j += self._carried_j
            spring_j += self._spring_j
            self._forget_wait()
        taken_j += self._spread_j
        spring_j += self._spread_spring_j
        self._spread_j = self._spread_spring_j = 0.0
        stored_j = self._gain * self._weight * self._stiffness.stored(stretch_m, self._limit_n)
        self.ledger.update(-1.0, taken_j, spring_j, stored_j, in_contact, damping_n_s_per_m, dt_s)

    def change(self, stiffness: Ramped, stretch_m: float, gain: float, weight: float, limit_n: float) -> None:
        """Enter what has become of the spring: that is the client's work, but what a release lets go is lost.

        Args:
            stiffness: now [N/m].
            stretch_m: its length now [m].
            gain: how much of the force a release has left, 0 to 1.
            weight: how much of it the port's own ramp lets through, 0 to 1.
            limit_n: largest force of the spring [N].
        """
        ledger = self.ledger
        stored_j = gain * weight * stiffness.stored(stretch_m, limit_n)
        held_j = ledger.stored_j
        if gain < self._gain:
            lost_j = held_j * (1.0 - gain / self._gain)
            ledger.dissipated_j += lost_j
            held_j -= lost_j
        self.moved_j += stored_j - held_j
        ledger.stored_j = stored_j
        self._remember(stiffness, gain, weight, limit_n)

    def wait(
        self,
        carried_j: float,
        spring_j: float,
        stretch_m: float,
        stiffness: Ramped,
        gain: float,
        weight: float,
        limit_n: float,
    ) -> None:
        """Keep what a tick without a sample has brought: it is entered with the next sample, all at once.

        Args:
            carried_j: work of the force that was applied along the target's way [J].
            spring_j: the part of it that is the spring's own force's [J].
            stretch_m: length of the spring after it [m].
            stiffness: after it, as in `change` [N/m].
            gain: after it, how much of the force a release has left, 0 to 1.
            weight: after it, how much of it the port's own ramp lets through, 0 to 1.
            limit_n: after it, largest force of the spring [N].
        """
        self._waits = True
        self._carried_j += carried_j
        self._spring_j += spring_j
        held_j = self._gain * self._weight * self._stiffness.stored(stretch_m, self._limit_n)
        if gain < self._gain:
            lost_j = held_j * (1.0 - gain / self._gain)
            self._lost_j += lost_j
            held_j -= lost_j
        self._changed_j += gain * weight * stiffness.stored(stretch_m, limit_n) - held_j
        self._remember(stiffness, gain, weight, limit_n)

    def let_go(self) -> None:
        """Have nothing stored any more; what was is lost. A port comes into force where the device is: slack."""
        self._forget_wait()
        self.ledger.dissipated_j += self.ledger.stored_j
        self.ledger.stored_j = 0.0

    def _remember(self, stiffness: Ramped, gain: float, weight: float, limit_n: float) -> None:
        stiffness.copy_to(self._stiffness)
        self._limit_n = limit_n
        self._gain = gain
        self._weight = weight

    def _forget_wait(self) -> None:
        self._waits = False
        self._carried_j = self._spring_j = self._changed_j = self._lost_j = 0.0
