"""An object that a client may move and does not is one that stays, and one that moves is one too, seen from it."""

from __future__ import annotations

import math
import random

import pytest

from hapticd.device import DeviceInfo
from tests.tick.remote.rig import update
from tests.tick.space.course import ACTS, REAL, Act, Moment, go_through, of_objects, switched
from tests.tick.space.rig import INFO, Point, Rig, ball, table

ROUGH = "static_friction = 0.5\ndynamic_friction = 0.4\n"
REMOTE = "remote = true\n"
BOX = table("box", "box", 3000.0, size_m=(0.02, 0.02, 0.02), position_m=(0.0, 0.0, -0.01), damping_n_s_per_m=2.0)


def felt(rig: Rig) -> Moment:
    """Without the flags of a record, and with the work that changes did."""
    return (*of_objects(rig), rig.totals.moved_j, rig.totals.friction_j, rig.totals.ledger.generated_j)


@pytest.mark.parametrize(("law", "info", "keys"), [("tdpa", INFO, ""), ("energy-cycle", REAL, ROUGH)])
def test_one_that_no_client_moves_is_felt_as_one_that_stays(law: str, info: DeviceInfo, keys: str) -> None:
    runs = []
    for more in ("", REMOTE):
        rig = Rig(BOX + keys + more, law, "max_force_n = 9.0\n", info)
        softer = BOX.replace("3000.0", "2000.0") + keys + more
        changes: dict[int, Act] = {220: switched(softer)}
        changes[650] = lambda rig: rig.switch("")
        changes[690] = switched(BOX + keys + more)
        runs.append(go_through(rig, felt, ACTS | changes, seed=5))
    stays, rests = runs
    for number, (one, other) in enumerate(zip(stays, rests, strict=True)):
        assert other == pytest.approx(one, rel=1e-9, abs=1e-12), number
    assert len([moment for moment in stays if any(moment[:3])]) > 100


def said(n: int) -> tuple[Point, Point]:
    """Where a client has it go about, and how fast."""
    return (
        (2e-3 * math.sin(0.02 * n), 1e-3 * math.cos(0.03 * n), 1e-3 * math.sin(0.05 * n)),
        (0.04 * math.cos(0.02 * n), -0.03 * math.sin(0.03 * n), 0.05 * math.cos(0.05 * n)),
    )


@pytest.mark.parametrize("keys", ["", ROUGH], ids=["smooth", "rough"])
def test_one_that_moves_is_felt_as_one_that_stays_under_a_device_that_moves_the_other_way(keys: str) -> None:
    draw = random.Random(4)
    scene = ball("ball", 4000.0, damping_n_s_per_m=2.0) + keys
    moving, still = Rig(scene + REMOTE, "none"), Rig(scene, "none")
    at: Point = (0.0, 0.0, 0.0315)
    moving.start(at)
    still.start(at)
    (port,) = moving.tick.ports
    touched = 0
    for n in range(800):
        if n % 7 == 0:
            position_m, velocity_m_per_s = said(n)
            port.take(update(n, position_m=list(position_m), velocity_m_per_s=list(velocity_m_per_s)))
        x, y, z = (0.002 * math.sin(0.011 * n), 0.001 * math.sin(0.02 * n), 0.03 + 0.0012 * math.cos(0.01 * n))
        x += 1e-5 * draw.random()
        moving.go((x, y, z))
        ox, oy, oz = port.target_m
        still.go((x - ox, y - oy, z - oz))
        assert moving.force == pytest.approx(still.force, abs=2e-4)
        one, other = moving.tick.solids[0], still.tick.solids[0]
        assert one.normal.tick.moved_m == pytest.approx(other.normal.tick.moved_m, abs=1e-7) or not one.depth_m
        assert one.friction_j == pytest.approx(other.friction_j, abs=1e-6)
        assert one.ledger.generated_j == pytest.approx(other.ledger.generated_j, abs=1e-7)
        touched += one.in_contact
    assert touched > 300
    assert moving.tick.solids[0].carried_j != 0.0


@pytest.mark.parametrize("from_m", [(0.4, 0.3, -0.2), (-0.5, 0.0, 0.1)])
def test_one_from_afar_comes_to_a_device_that_rests(from_m: Point) -> None:
    rig = Rig(ball("ball", position_m=from_m, max_speed_m_per_s=2.0) + REMOTE).start((0.0, 0.0, 0.0295))
    (port,) = rig.tick.ports
    for n in range(500):
        port.take(update(n, position_m=[0.0, 0.0, 0.0]))
        rig.go((0.0, 0.0, 0.0295))
    assert list(port.target_m) == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    assert math.hypot(*rig.force) > 2.0
    assert rig.unbalanced_j() < 1e-9
