"""An object that is not touched changes nothing about walls: the tick in space does by them what the other one does."""

from __future__ import annotations

import pytest

from hapticd.device import DeviceInfo
from tests.tick.space.course import ACTS, REAL, Act, go_through, of_walls, switched
from tests.tick.space.rig import INFO, Rig, ball

WALL = '[[scene.walls]]\naxis = "{}"\nposition_m = {}\nstiffness_n_per_m = {}\n'
LATER = "changes = [{at_s = 0.1, stiffness_n_per_m = 1100.0}, {at_s = 0.25, damping_n_s_per_m = 1.0}]\n"
WALLS = WALL.format("x", 0.002, 900.0) + LATER + WALL.format("z", -0.001, 1500.0) + 'free_side = "negative"\n'
OTHERS = WALL.format("x", 0.002, 1200.0) + WALL.format("y", 0.0, 700.0)
SAFETY = "max_force_n = 9.0\nmax_axis_force_n = 7.0\nmax_speed_m_per_s = 0.8\n"
FAR = ball("far", position_m=(0.4, 0.4, 0.4))


@pytest.mark.parametrize(("law", "info"), [("tdpa", INFO), ("energy-cycle", REAL)])
def test_with_an_object_out_of_reach_walls_are_as_without_any(law: str, info: DeviceInfo) -> None:
    runs = []
    for object_ in ("", FAR):
        rig = Rig(WALLS + object_, law, SAFETY, info)
        changes: dict[int, Act] = {220: switched(OTHERS + object_)}
        changes[650] = switched(WALLS + object_, "damper")
        runs.append(go_through(rig, of_walls, ACTS | changes, seed=5))  # of few others a wall that is pressed has debts
        assert (rig.tick.advance == rig.tick.step) is not bool(object_)
    without, beside = runs
    assert beside == without
    assert len({moment[-1] for moment in without}) > 5
    flags = {moment[10] for moment in without}
    assert len(flags) > 4
