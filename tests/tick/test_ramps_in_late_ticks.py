"""A ramp that begins within a tick begins with it: how late that tick comes is no part of the ramp."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from tests.tick.rig import RAMP_TICKS, Rig, law, wall

LATE_S = pytest.mark.parametrize("late_s", [1e-3, 0.01, 0.03, 0.045])


@LATE_S
def test_a_wall_that_changes_in_a_late_tick_comes_in_from_then_on(late_s: float) -> None:
    """It made 6.4 N of 11 in its first tick, when that came 30 ms late."""
    stiffer = {"at_s": 0.099 + late_s, "stiffness_n_per_m": 6000.0}
    rig = Rig(wall(500.0, changes=[stiffer]), at_m=0.0)
    rig.forces(-2e-3, 99)
    assert rig.force(-2e-3) == pytest.approx(1.0)
    assert rig.force(-2e-3, dt_s=late_s) == pytest.approx(1.0)
    assert rig.tick.contacts[0].wall.stiffness_n_per_m == 6000.0
    assert rig.forces(-2e-3, 2) == pytest.approx([1.0 + 11.0 / RAMP_TICKS, 1.0 + 22.0 / RAMP_TICKS])


@LATE_S
def test_the_fallback_of_a_law_that_fails_in_a_late_tick_adds_nothing_at_once(late_s: float) -> None:
    """The law held 1 N where the wall has 12. Lateness counts for the release, which only lets go."""
    fails = SimpleNamespace(now=False)

    def step(_state: Any, _params: Any, tick: Any) -> float:
        if fails.now:
            raise ValueError("no more")
        return 1.0 if tick.in_contact else 0.0

    rig = Rig(wall(10_000.0), module=law(step))
    assert rig.force(-2e-3, ticks=2 * RAMP_TICKS) == pytest.approx(1.0)
    fails.now = True
    assert rig.force(-2e-3, dt_s=late_s) <= 1.0


@LATE_S
def test_what_is_seen_again_in_a_late_tick_comes_in_from_then_on(late_s: float) -> None:
    rig = Rig(wall(2000.0), at_m=0.0)
    rig.forces(-2e-3, 60)
    assert rig.forces(math.nan, 40)[-1] == 0.0
    rig.tick.fault = 0
    rig.tick.guard.clear()
    assert rig.tick.arm()
    assert rig.force(-2e-3, dt_s=late_s) == 0.0
    assert rig.force(-2e-3) == pytest.approx(4.0 / RAMP_TICKS)
