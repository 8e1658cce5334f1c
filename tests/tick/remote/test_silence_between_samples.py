"""A device that has nothing new keeps no client of an object young: its silence is measured in time."""

from __future__ import annotations

import pytest

from hapticd.tick.remote.port import PortState
from tests.tick.remote.rig import PERIOD_S, Rig

FLOOR = '[[scene.objects]]\nname = "floor"\nshape = "plane"\nstiffness_n_per_m = 1000.0\nremote = true\n'
FAR = FLOOR + "position_m = [0.0, 0.0, -0.5]\n"
HOLD_TICKS = 100


def said(scene: str, arm: bool = False) -> Rig:
    rig = Rig(scene, axes="xyz", arm=arm, nominal_rate_hz=10.0)
    rig.say("floor", position_m=[0.0, 0.0, 1e-3 if scene == FLOOR else -0.5])
    return rig


@pytest.mark.parametrize("arm", [False, True], ids=["disarmed", "armed"])
@pytest.mark.parametrize("scene", [FLOOR, FAR], ids=["touched", "far away"])
@pytest.mark.parametrize("samples", [0, 1, 50], ids=lambda number: f"{number} samples")
def test_a_client_is_silent_after_the_same_time_whether_or_not_the_device_has_anything_new(
    samples: int, scene: str, arm: bool
) -> None:
    rig = said(scene, arm)
    port = rig["floor"]
    rig.go(ticks=samples)
    rig.repeat(HOLD_TICKS - 1 - samples)
    assert port.state is PortState.HELD
    assert port.age_s == pytest.approx((HOLD_TICKS - 1) * PERIOD_S)
    rig.repeat(2)
    assert (port.state, port.news, port.seq) == (PortState.STALE, PortState.STALE, -1)


@pytest.mark.parametrize("scene", [FLOOR, FAR], ids=["touched", "far away"])
@pytest.mark.parametrize("gap", [1, 3, 10])
def test_no_time_counts_twice(gap: int, scene: str) -> None:
    rig = said(scene)
    for _ in range(90 // gap):
        rig.repeat(gap - 1)
        rig.go(dt_s=gap * PERIOD_S)
    assert rig["floor"].age_s == pytest.approx(90 * PERIOD_S)


def test_a_device_whose_clock_is_slow_makes_no_client_younger() -> None:
    rig = said(FLOOR)
    rig.repeat(9)
    rig.go(dt_s=2.0 * PERIOD_S)
    assert rig["floor"].age_s == pytest.approx(9 * PERIOD_S)
