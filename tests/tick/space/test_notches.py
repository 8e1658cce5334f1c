"""A device that is armed in a notch of two alike objects, or in which a reload puts it, is pushed out the near way."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from tests.tick.space.rig import INFO, Point, Rig, length, table

REAL = replace(INFO, simulated=False, workspace_m=((-0.2, 0.2),) * 3, resolution_m=1e-5)
PLACES = [(0.00134, 0.00274, -0.00437), (-0.0004, -0.00054, -0.00354), (0.0, 0.0, -0.002)]


def side(name: str, shape: str, opening_deg: float, sign: float) -> str:
    """One of two objects whose surfaces meet along the y axis and open upward by an angle."""
    lean = sign * math.radians(90.0 - 0.5 * opening_deg)
    turned = (math.cos(0.5 * lean), 0.0, math.sin(0.5 * lean), 0.0)
    if shape == "plane":
        return table(name, shape, 1000.0, orientation=turned)
    at = (-0.03 * math.sin(lean), 0.0, -0.03 * math.cos(lean))
    return table(name, shape, 1000.0, size_m=(0.2, 0.1, 0.06), orientation=turned, position_m=at)


@pytest.mark.parametrize("shape", ["plane", "box"])
@pytest.mark.parametrize("opening_deg", [85.0, 70.0, 60.0, 40.0, 20.0])
@pytest.mark.parametrize("at", PLACES)
def test_armed_in_a_notch_it_is_pushed_to_where_the_faces_meet(shape: str, opening_deg: float, at: Point) -> None:
    """All that the limit allows, down into the other one or up out of it; 3.9e11 J were in the spring."""
    scene = side("left", shape, opening_deg, 1.0) + side("right", shape, opening_deg, -1.0)
    rig = Rig(scene, "ring-damping", info=REAL).start(at).to(at, 100)
    assert rig.tick.fault == 0
    assert length(rig.force) <= 1000.0 * math.hypot(at[0], at[2]) * 1.001
    assert rig.force[2] > 0.9 * length(rig.force) * math.sin(math.radians(0.5 * opening_deg))
    assert rig.totals.ledger.stored_j < 0.02


@pytest.mark.parametrize("shape", ["plane", "box"])
@pytest.mark.parametrize("opening_deg", [85.0, 70.0, 40.0])
@pytest.mark.parametrize("at", PLACES)
def test_so_it_is_by_a_reload_that_adds_the_other_face(shape: str, opening_deg: float, at: Point) -> None:
    left, right = side("left", shape, opening_deg, 1.0), side("right", shape, opening_deg, -1.0)
    lean = math.radians(90.0 - 0.5 * opening_deg)
    outside = (at[0] + 0.02 * math.sin(lean), at[1], at[2] + 0.02 * math.cos(lean))
    rig = Rig(left, "ring-damping", info=REAL).start(outside).to(at, 100)
    rig.switch(right + left).to(at, 150)
    assert rig.tick.fault == 0
    assert length(rig.force) <= 1000.0 * math.hypot(at[0], at[2]) * 1.001


def test_where_there_is_no_way_out_a_device_has_no_force_until_it_has_left() -> None:
    """A reload closes a slot about it by a plane that faces the one it is in."""
    down = table("down", "plane", 1000.0, orientation=(0.0, 1.0, 0.0, 0.0), position_m=(0.0, 0.0, -0.01))
    up = table("up", "plane", 1000.0)
    rig = Rig(up + down, "ring-damping", info=REAL).start((0.0, 0.0, -0.003)).to((0.001, 0.0, -0.005), 100)
    assert rig.forces[-100:] == [(0.0, 0.0, 0.0)] * 100
    rig.switch(up).to((0.001, 0.0, -0.005), 100)
    assert rig.force == pytest.approx((0.0, 0.0, 5.0), rel=0.01)
    assert rig.tick.fault == 0
