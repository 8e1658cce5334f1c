"""A plane is a wall: the same force, the same books, and its law is shown the same, whichever way it leans.

A plane kept the debt of one touch for the next, and its law's damping was gone where the device was armed twice between
two touches.
"""

from __future__ import annotations

from typing import Any

import pytest

from hapticd.device import DeviceInfo
from hapticd.shapes.pose import Pose
from tests.tick.space.course import ACTS, REAL, Moment, go_through
from tests.tick.space.rig import INFO, Rig, table

WALL = '[[scene.walls]]\naxis = "z"\nposition_m = 0.0\nstiffness_n_per_m = 3000.0\ndamping_n_s_per_m = 2.0\n'
SAFETY = "max_force_n = 9.0\nmax_speed_m_per_s = 5.0\n"
LEANS = {"leaning": (0.3, -0.5, 0.7, 0.4), "upside down": (0.1, 0.9, 0.1, -0.2)}
WITHOUT_FAILURES = {at: act for at, act in ACTS.items() if at < 850}


def told(rig: Rig) -> Moment:
    """Of the only thing that is there: what is felt, what is booked, and what its law is shown while it is touched."""
    tick = rig.tick
    ledger = tick.totals().ledger
    one: Any = tick.contacts[0] if tick.contacts else tick.solids[0].normal
    shown = one.tick
    return (
        *(tick.flags, tick.fault, tick.guard.gain, one.in_contact),
        *(ledger.energy_j, ledger.stored_j, ledger.dissipated_j, ledger.generated_j),
        *(one.ledger.debt_j, one.ledger.cycle, one.ledger.cycle_duration_s, one.ledger.cycle_damping_n_s_per_m),
        *(one.applied_n, one.requested_n, one.force_n),
        *((shown.x_m, shown.moved_m, shown.velocity_m_per_s, shown.dt_s) if one.in_contact else ()),
        *((shown.contact_n, shown.spring_n, shown.applied_n, shown.applied_contact_n) if one.in_contact else ()),
    )


@pytest.mark.parametrize(
    ("law", "info", "lean"),
    [
        ("none", REAL, "leaning"),
        ("tdpa", REAL, "upside down"),
        ("energy-cycle", INFO, "leaning"),
    ],
)
def test_a_plane_is_felt_and_booked_as_a_wall_is(law: str, info: DeviceInfo, lean: str) -> None:
    pose = Pose.of((0.003, -0.002, 0.004), LEANS[lean])
    plane = table("plane", "plane", 3000.0, damping_n_s_per_m=2.0, position_m=pose.position_m, orientation=LEANS[lean])
    at_the_wall = go_through(Rig(WALL, law, SAFETY, info), told, WITHOUT_FAILURES)
    at_the_plane = go_through(Rig(plane, law, SAFETY, info), told, WITHOUT_FAILURES, placed=pose.point)
    for number, (wall, plane_) in enumerate(zip(at_the_wall, at_the_plane, strict=True)):
        assert plane_ == pytest.approx(wall, rel=1e-6, abs=1e-9), number
    assert len([moment for moment in at_the_wall if moment[0] and moment[3]]) > 200
