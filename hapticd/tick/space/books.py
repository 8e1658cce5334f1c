"""The books of all objects together: those that rest, those that are gone, and those that the device may touch."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from hapticd.tick.energy import EnergyLedger


class HasBooks(Protocol):
    """One contact, or sums over several."""

    ledger: EnergyLedger
    carried_j: float
    friction_j: float
    friction_stored_j: float
    moved_j: float


class Totals:
    """Sums over contacts.

        energy = stored + dissipated - generated - moved

    The ledger of what moves counts energy as seen from there; here it counts as the device gives it.

    Attributes:
        ledger: energy, stored, dissipated, generated [J].
        moved_j: work that motion and changes of the scene did [J].
        carried_j: nothing is left to take off here [J].
        friction_j: energy that slipping took, a part of what is dissipated [J].
        friction_stored_j: energy in the springs along surfaces, a part of what is stored [J].
    """

    carried_j = 0.0

    __slots__ = ("friction_j", "friction_stored_j", "ledger", "moved_j")

    def __init__(self) -> None:
        self.ledger = EnergyLedger()
        self.moved_j = 0.0
        self.friction_j = 0.0
        self.friction_stored_j = 0.0

    def add(self, contact: HasBooks) -> None:
        """Add one contact, or sums over several."""
        self.ledger.absorb(contact.ledger)
        self.moved_j += contact.moved_j
        self.friction_j += contact.friction_j
        self.friction_stored_j += contact.friction_stored_j

    def add_moving(self, contact: HasBooks) -> None:
        """Add one that may have moved by itself."""
        self.add(contact)
        self.ledger.energy_j -= contact.carried_j


class SpaceBooks:
    """The sums over what is not looked at in a tick."""

    __slots__ = ("_gone", "_resting")

    def __init__(self) -> None:
        self._gone = Totals()
        self._resting = Totals()

    def rest(self, contacts: Iterable[HasBooks]) -> None:
        """These are out of reach from now on, and no others."""
        self._resting = Totals()
        for contact in contacts:
            self._resting.add(contact)

    def close(self, contact: HasBooks) -> None:
        """This one is gone."""
        self._gone.add_moving(contact)

    def totals(self, awake: Iterable[HasBooks]) -> Totals:
        """Sums over all there ever were.

        Args:
            awake: those that rest not.
        """
        totals = Totals()
        totals.add(self._gone)
        totals.add(self._resting)
        for contact in awake:
            totals.add_moving(contact)
        return totals
