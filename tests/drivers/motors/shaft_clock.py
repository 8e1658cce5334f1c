"""A clock that goes by a simulated shaft: how fast the computer is means nothing to a movement that goes by it."""

from __future__ import annotations

import pytest

from hapticd_drivers.motors import mover
from tests.drivers.motors.shaft import Shaft


class ShaftClock:
    """Instead of the module `time`."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def monotonic(self) -> float:
        """How long the shaft has been moving, or at rest [s]."""
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        """Return at once: the shaft's time passes with the frames that come to its controller."""


def move_by_the_shaft(shaft: Shaft, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have calibrations go by the time of this shaft."""
    clock = ShaftClock()
    advance = shaft.advance

    def pass_time(torque_n_m: float, duration_s: float) -> None:
        advance(torque_n_m, duration_s)
        clock.now_s += duration_s

    monkeypatch.setattr(shaft, "advance", pass_time)
    monkeypatch.setattr(mover, "time", clock)
