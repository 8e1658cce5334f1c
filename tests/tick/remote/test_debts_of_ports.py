"""What a port owes goes to laws that take over once, each axis's own part of it."""

from __future__ import annotations

import pytest

from hapticd.law import LawSnapshot
from hapticd.tick.contact import RunningLaw
from tests.tick.remote.rig import COUPLING, PROMPT, Rig

UNDAMPED = COUPLING.replace("damping_n_s_per_m = 5.0", PROMPT)


@pytest.mark.parametrize("repeats", [0, 2])
def test_what_a_coupling_owes_is_owed_once_and_along_the_axes_that_gave_it(
    repeats: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where ticks without news come between two samples."""
    rig = Rig(UNDAMPED, axes="xyz")
    rig.say("tool", position_m=[0.0, 0.0, 0.0])
    rig.go([0.0, 0.0, 0.0], ticks=5)
    for n in range(400):
        rig.say("tool", position_m=[0.0, 0.0, 0.0])
        rig.go([0.0, 1e-3 * (-1) ** n, 0.5e-3 * (-1) ** n])
        rig.repeat(repeats)
    debt_j = rig["tool"].books.ledger.debt_j
    assert debt_j > 1e-3
    owed_j = []

    def start(law: RunningLaw, snapshot: LawSnapshot) -> None:
        owed_j.append(snapshot.debt_j)

    monkeypatch.setattr(RunningLaw, "start", start)
    rig.tick.release()
    assert rig.tick.arm()
    assert sum(owed_j) == pytest.approx(debt_j, rel=1e-9)
    assert owed_j == pytest.approx([0.0, 0.8 * debt_j, 0.2 * debt_j], rel=0.02, abs=1e-6)


def test_a_coupling_that_comes_into_force_anew_owes_nothing_of_the_time_before() -> None:
    rig = Rig(UNDAMPED, axes="xyz")
    for n in range(100):
        rig.say("tool", position_m=[0.0, 0.0, 0.0])
        rig.go([0.0, 1e-3 * (-1) ** n, 0.0])
    assert rig["tool"].channels[1].taken_j < -1e-3
    rig.say("tool", released=True)
    rig.go([0.0, 0.0, 0.0], ticks=100)
    rig.say("tool", position_m=[0.0, 0.0, 0.0])
    rig.go([0.0, 0.0, 0.0])
    assert rig["tool"].channels[1].taken_j == 0.0


def test_what_each_axis_gave_counts_the_mean_of_what_was_applied_between_two_samples() -> None:
    """As the ledger does: while a coupling comes in its force is another in each tick."""
    rig = Rig(UNDAMPED, axes="xyz")
    rig.say("tool", position_m=[0.0, 0.0, 0.0])
    rig.go([0.0, 0.0, 0.0])
    for n in range(10):
        rig.go([0.0, 1e-3 * (-1) ** n, 0.0])
        rig.repeat(3)
    assert rig["tool"].channels[1].taken_j == pytest.approx(rig.energy_j, rel=1e-6)
