"""A clock that goes by a simulated shaft: how fast the computer is means nothing to a movement that goes by it."""

from __future__ import annotations

import pytest

from hapticd_drivers.motors import mover
from tests.drivers.motors.shaft import Shaft


class ShaftClock:
    """Instead of the module `time`.

    Args:
        shaft: whose time it is.
    """

    def __init__(self, shaft: Shaft) -> None:
        self._now_s = 0.0
        self._advance = shaft.advance
        shaft.advance = self._pass_time  # type: ignore[method-assign]

    def monotonic(self) -> float:
        """How long the shaft has been moving, or at rest [s]."""
        return self._now_s

    def sleep(self, duration_s: float) -> None:
        """Return at once: the shaft's time passes with the frames that come to its controller."""

    def _pass_time(self, torque_n_m: float, duration_s: float) -> None:
        self._advance(torque_n_m, duration_s)
        self._now_s += duration_s


def move_by_the_shaft(shaft: Shaft, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have calibrations go by the time of this shaft."""
    monkeypatch.setattr(mover, "time", ShaftClock(shaft))
