"""A surface that cannot be where the proxy says it is lets the last force out, and the fault names the object."""

from __future__ import annotations

import itertools
import math
from typing import Any

import pytest

from hapticd.shapes.proxy import follow
from hapticd.tick import fallback
from hapticd.tick.event import EventCode
from tests.tick.space.rig import Rig, length, table
from tests.tick.space.test_notches import REAL

AT = (0.001, 0.0, -0.002)


def groove() -> Rig:
    """A device that is held in a notch of two planes, with more than 2 N."""
    turned = math.cos(math.pi / 12.0), math.sin(math.pi / 12.0)
    left = table("left", "plane", 1000.0, orientation=(turned[0], 0.0, turned[1], 0.0))
    right = table("right", "plane", 1000.0, orientation=(turned[0], 0.0, -turned[1], 0.0))
    rig = Rig(left + right, "ring-damping", info=REAL).start((0.0, 0.0, 0.01)).to(AT, 300).to(AT, 50)
    assert length(rig.force) > 2.0
    return rig


def send_away(monkeypatch: pytest.MonkeyPatch, away_m: float) -> None:
    """Have the proxy be nowhere, once."""

    def astray(proxy: Any, *at: Any) -> None:
        monkeypatch.undo()
        follow(proxy, *at)
        proxy.depth_m = away_m

    monkeypatch.setattr("hapticd.tick.space.solid_contact.follow", astray)


@pytest.mark.parametrize("away_m", [1e4, 1e25, math.inf, math.nan])
def test_a_proxy_that_is_nowhere_lets_the_last_force_out_by_a_ramp(
    away_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The law was blamed; from 1e18 N on the tick raised in the fallback as well, and the force ended in a step."""
    rig = groove()
    before = rig.force
    send_away(monkeypatch, away_m)
    forces = rig.to(AT, 60).forces[-60:]
    assert rig.tick.fault == EventCode.SAMPLE_IMPOSSIBLE
    assert rig.tick.fault_text.startswith('scene.objects[0] "left": its surface is ')
    assert rig.tick.fault_text.endswith(" m away, which is not possible")
    assert length(forces[0]) > 0.85 * length(before)
    for earlier, later in zip([before, *forces], forces, strict=False):
        assert length(later) <= length(earlier)
        shares = [new / old for new, old in zip(later, before, strict=True) if old != 0.0]
        assert shares == pytest.approx([shares[0]] * len(shares), abs=1e-9), "it is the same way to the end"
    assert forces[9:] == [(0.0, 0.0, 0.0)] * 51
    assert math.isfinite(rig.totals.ledger.generated_j)
    assert rig.totals.ledger.generated_j < 0.1


def test_it_goes_on_once_cleared_and_armed(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = groove()
    send_away(monkeypatch, 1e25)
    rig.to(AT, 60)
    assert rig.tick.fault == EventCode.SAMPLE_IMPOSSIBLE
    rig.tick.fault = 0
    rig.tick.guard.clear()
    assert rig.tick.arm()
    rig.to(AT, 100)
    assert rig.tick.fault == 0
    assert length(rig.force) > 2.0


def test_a_law_that_stands_in_and_fails_too_keeps_the_force_that_fades_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever raises there, it raises nothing out of the tick, which was taken for a failure of the driver."""
    rig = groove()
    before = rig.force

    def step(state: Any, params: Any, tick: Any) -> float:
        return math.inf

    monkeypatch.setattr(fallback, "step", step)
    rig.tick.fail_law(EventCode.LAW_FAILED, "as it happens")
    forces = rig.to(AT, 60).forces[-60:]
    assert rig.tick.fault_text == "as it happens"
    assert length(forces[0]) > 0.85 * length(before)
    assert all(length(later) <= length(earlier) + 1e-9 for earlier, later in itertools.pairwise(forces))
    assert forces[-1] == (0.0, 0.0, 0.0)
