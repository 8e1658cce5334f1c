"""What an object owes goes to laws that take over once, each direction's own part of it."""

from __future__ import annotations

from typing import Any

import pytest

from hapticd.law import LawSnapshot
from hapticd.tick.contact import RunningLaw
from hapticd.tick.energy import EnergyLedger
from hapticd.tick.space.channel import Channel, share_debt
from hapticd_controllers import none
from tests.tick.space.rig import Point, Rig, table

ROUGH: dict[str, Any] = {"static_friction": 1.0, "dynamic_friction": 0.8}


def floor(**keys: Any) -> str:
    return table("floor", "plane", **ROUGH, **keys)


def taken_over(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """What the laws that take over now are told that they owe [J]."""
    owed_j = []

    def start(law: RunningLaw, snapshot: LawSnapshot) -> None:
        owed_j.append(snapshot.debt_j)

    with monkeypatch.context() as patch:
        patch.setattr(RunningLaw, "start", start)
        rig.switch(floor(), "none")
    return owed_j


def swung(way: Point) -> Rig:
    """Pressed, and then thrown forth and back without any damping, in which the held spring makes energy."""
    rig = Rig(floor(), "none").start((0.0, 0.0, 0.005)).to((0.0, 0.0, -0.001), 20)
    x, y, z = way
    for _ in range(10):
        rig.go((x, y, -0.001 + z), (0.0, 0.0, -0.001))
    return rig


@pytest.mark.parametrize(
    ("way", "owing"), [((0.0, 0.0, -0.0005), [0]), ((0.0005, 0.0, -0.0005), [0, 2]), ((0.0005, 0.0, 0.0), [2])]
)
def test_what_a_rough_object_owes_is_owed_once_and_where_it_was_given(
    way: Point, owing: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = swung(way)
    debt_j = rig.tick.solids[0].ledger.debt_j
    assert debt_j > 1e-3
    owed_j = taken_over(rig, monkeypatch)
    assert len(owed_j) == 3
    assert sum(owed_j) == pytest.approx(debt_j, rel=1e-9)
    assert [at for at, one_j in enumerate(owed_j) if one_j > 1e-6] == owing


def test_a_new_touch_owes_nothing_of_the_one_before(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = swung((0.0005, 0.0005, 0.0))
    rig.to((0.0, 0.0, 0.005), 20).to((0.0, 0.0, -0.001), 20)
    for _ in range(10):
        rig.go((0.0, 0.0, -0.0015), (0.0, 0.0, -0.001))
    assert rig.tick.solids[0].ledger.debt_j > 1e-3
    assert taken_over(rig, monkeypatch)[1:] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_a_direction_that_took_more_than_it_gave_owes_nothing() -> None:
    """And lessens the parts of the others alike."""
    channels = [Channel(RunningLaw(none, none.Params()), 0.0, EnergyLedger()) for _ in range(3)]
    channels[1].taken_j = -3.0
    channels[2].taken_j = 2.0
    share_debt(channels, 4.0)  # so that the first one's is -3 J as well
    assert [channel.snapshot().debt_j for channel in channels] == [2.0, 2.0, 0.0]
    share_debt(channels, 0.0)
    assert [channel.snapshot().debt_j for channel in channels] == [0.0, 0.0, 0.0]
