"""Everything that changes the force of a hand at rest, for tests that put it in any order."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hypothesis import strategies as st

from hapticd.config.safety import SafetyConfig
from hapticd.tick.event import EventCode
from hapticd.tick.guard import BLIND_RAMP_S
from tests.tick.rig import LIMIT_N, PERIOD_S, RAMP_TICKS, Rig, pushes, running, scene, wall

RAMP_STEP_N = LIMIT_N / RAMP_TICKS
BLIND_TICKS = round(BLIND_RAMP_S / PERIOD_S)
FASTER_TICKS = 20


def pressed(*walls: dict[str, Any], depth_m: float = 2e-3, **keys: Any) -> Rig:
    """A hand 2 mm inside a wall of 2 kN/m, at rest: 4 N."""
    rig = Rig(*(walls or (wall(2000.0),)), at_m=0.0, **keys)
    rig.force(-depth_m, ticks=2)
    return rig


def arm_again(rig: Rig) -> None:
    assert rig.tick.arm()


TRANSITIONS: dict[str, tuple[Callable[[Rig], Any], float]] = {
    "another law": (lambda rig: rig.switch(make_law=running(pushes(11.0))), 11.0),
    "a law that pulls": (lambda rig: rig.switch(make_law=running(pushes(-12.0))), -12.0),
    "a law beyond the limit": (lambda rig: rig.switch(make_law=running(pushes(1e6))), 12.0),
    "a softer wall": (lambda rig: rig.switch(scene(wall(500.0))), 1.0),
    "a stiffer wall": (lambda rig: rig.switch(scene(wall(1e6))), 12.0),
    "no wall": (lambda rig: rig.switch(scene()), 0.0),
    "a wall elsewhere": (lambda rig: rig.switch(scene(wall(1000.0, position_m=3e-3))), 5.0),
    "a second wall": (lambda rig: rig.switch(scene(wall(2000.0), wall(1e5, position_m=1.0))), 12.0),
    "a release": (lambda rig: rig.tick.release(), 0.0),
    "a fault": (lambda rig: rig.tick.fail(EventCode.DEVICE_FAULT, "hot"), 0.0),
    "the fallback": (lambda rig: rig.tick.fail_law(EventCode.LAW_OVER_BUDGET, "slow"), 0.0),
    "a smaller limit": (lambda rig: rig.switch(safety=SafetyConfig(max_force_n=1.0)), 1.0),
    "everything": (
        lambda rig: rig.switch(scene(wall(9000.0)), SafetyConfig(max_force_n=6.0), running(pushes(1e9))),
        6.0,
    ),
}


MOVES = st.one_of(st.floats(-2e-5, 2e-5), st.floats(-1e-3, 1e-3))
"""Motion of a tick [m]: mostly so little that it explains less force than a ramp does."""
FACES_M = (0.0, 3e-3)
"""Where the walls above begin; the one at 1 m is never left."""
DEEDS = st.sampled_from(
    [*TRANSITIONS, "arm", "clear", "nan", "dark", "faster", "nothing", "nothing", "nothing", "nothing", "nothing"]
)
