"""A line of the fault table of a driver's page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hapticd.errors import DriverError


@dataclass(frozen=True)
class Trouble:
    """Something that goes wrong with a device, and what the driver makes of it.

    Attributes:
        name: what goes wrong.
        happen: brings it about on the device's double.
        kind, text: the error, and what is in its text.
        most_ticks: the fault is reported within this many ticks.
        peak_n: largest force from then on [N].
        tick_s: what a tick waits for a state, where the driver waits [s]; long, so that a busy computer is none of it.
    """

    name: str
    happen: Callable[[Any], object]
    kind: type[DriverError]
    text: str
    most_ticks: int
    peak_n: float
    tick_s: float = 1.0

    def row(self) -> str:
        """How the page begins the line."""
        return f"| {self.name} | {self.most_ticks} | {self.peak_n:.2f} |"
