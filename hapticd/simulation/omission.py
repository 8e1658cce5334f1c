"""What can be left out of a device model, and the model without it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hapticd.simulation.options import Change, SimulationOptions


@dataclass(frozen=True, slots=True)
class Omission:
    """A term of the model that need not be there.

    Attributes:
        name: of the term, for people.
        key: in [device.options]; the value 0 takes the term out.
        usual: a value that it often has.
        declared: whether the device declares it (its force limit, its resolution), so that controllers rely on it.
    """

    name: str
    key: str
    usual: float
    declared: bool = False

    @property
    def change_key(self) -> str:
        """The same quantity in an entry of `changes`."""
        return self.key.replace("hand.", "hand_")

    def present(self, options: SimulationOptions) -> bool:
        """Whether a device has the term, at the start or from some change on."""
        return bool(_value(options, self.key)) or any(
            change.values().get(self.change_key) for change in options.changes
        )

    def apply(self, options: SimulationOptions) -> SimulationOptions:
        """The device without the term, for all time."""
        changes = _changes_without(options.changes, self.change_key)
        return self._put(options, 0.0).model_copy(update={"changes": changes})

    def add(self, options: SimulationOptions) -> SimulationOptions:
        """The device with the term, at its usual value from the start."""
        return self._put(options, self.usual)

    def _put(self, options: SimulationOptions, value: float) -> SimulationOptions:
        if not self.key.startswith("hand."):
            return options.model_copy(update={self.key: type(_value(options, self.key))(value)})
        hand = options.hand.model_copy(update={self.key.removeprefix("hand."): value})
        return options.model_copy(update={"hand": hand})


OMISSIONS = (
    Omission("viscous friction", "viscous_n_s_per_m", 4.0),
    Omission("Coulomb friction", "coulomb_n", 0.1),
    Omission("sensor steps", "resolution_m", 1e-5, declared=True),
    Omission("sensor noise", "noise_m", 1e-6),
    Omission("force limit", "max_force_n", 12.0, declared=True),
    Omission("actuator lag", "bandwidth_hz", 500.0),
    Omission("force delay", "force_delay_samples", 1.0),
    Omission("hand mass", "hand.mass_kg", 0.2),
    Omission("hand damping", "hand.damping_n_s_per_m", 5.0),
    Omission("hand spring", "hand.stiffness_n_per_m", 100.0),
)
"""Every term that a device may have."""


def omissions(options: SimulationOptions) -> list[Omission]:
    """The terms that a device has and that can be taken out."""
    return [one for one in OMISSIONS if one.present(options)]


def without(options: SimulationOptions, terms: Sequence[Omission]) -> SimulationOptions:
    """A device without some terms."""
    for term in terms:
        options = term.apply(options)
    return options


def _value(options: SimulationOptions, key: str) -> Any:
    holder: Any = options
    for name in key.split("."):
        holder = getattr(holder, name)
    return holder


def _changes_without(changes: Sequence[Change], key: str) -> tuple[Change, ...]:
    if not any(key in change.values() for change in changes):
        return tuple(changes)
    kept = [change.model_copy(update={key: None}) for change in changes]
    return tuple(change for change in kept if change.values())
