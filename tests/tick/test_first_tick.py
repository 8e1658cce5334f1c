"""What a tick begins with: nothing that it was not given is in its first force, its first fault, its first count."""

from __future__ import annotations

import math

import pytest

from hapticd.config.models import SceneConfig, VelocityConfig
from hapticd.errors import ConfigError
from hapticd.tick.event import EventCode
from hapticd.tick.tick import ControlTick
from tests.tick.rig import PERIOD_S, Rig, wall

BALL = {
    "name": "ball",
    "shape": "sphere",
    "radius_m": 0.01,
    "position_m": [0.0, 0.0, 0.0],
    "stiffness_n_per_m": 100.0,
}


def test_sight_that_goes_with_the_first_sample_leaves_no_force_to_be_let_out() -> None:
    rig = Rig(wall(2000.0), at_m=-1e-3)
    assert rig.forces(math.nan, 3) == [0.0] * 3
    assert rig.tick.requested_n == [0.0]


def test_a_blind_tick_asks_for_nothing() -> None:
    rig = Rig(wall(2000.0), at_m=0.0)
    rig.force(-1e-3)
    assert rig.tick.requested_n == [2.0]
    assert rig.force(math.nan) > 0.0
    assert rig.tick.requested_n == [0.0]


@pytest.mark.parametrize("code", [code for code in EventCode if 200 <= code < 300])
def test_a_tick_that_goes_on_latched_tells_its_first_fault(code: EventCode) -> None:
    """Which one the loop before has told it does not know."""
    rig = Rig(wall(2000.0), arm=False)
    rig.tick.guard.latched = True
    rig.tick.fail(code, "again")
    assert (rig.tick.fault, rig.tick.fault_text) == (code, "again")


@pytest.mark.parametrize(("loop_hz", "reads"), [(1000.0, 20), (100.0, 3)])
def test_a_device_that_has_nothing_new_from_the_start_is_frozen_as_soon_as_later(loop_hz: float, reads: int) -> None:
    rig = Rig(wall(2000.0), has_sequence=True)
    for number in range(reads):
        assert rig.tick.fault == 0, number
        rig.tick.step(rig.sample, 1.0 / loop_hz)
    assert rig.tick.fault == EventCode.DEVICE_FROZEN


def test_an_origin_is_moved_to_where_the_device_is_at_rest() -> None:
    rig = Rig(wall(2000.0), at_m=0.0, arm=False)
    rig.force(1e-3)
    assert rig.tick.motion.velocity_m_per_s == [pytest.approx(1.0)]
    assert rig.tick.tare()
    assert rig.tick.motion.velocity_m_per_s == [0.0]
    assert rig.tick.motion.position_m == [0.0]


def test_objects_on_a_device_that_is_not_in_space_are_refused_at_the_start_as_in_a_switch() -> None:
    with_ball = SceneConfig.model_validate({"objects": [BALL]})
    rig = Rig(wall(2000.0), at_m=0.0)
    with pytest.raises(ConfigError, match="objects need three axes"):
        rig.switch(with_ball)
    with pytest.raises(ConfigError, match="objects need three axes"):
        ControlTick(
            with_ball, VelocityConfig(), rig.tick.guard, rig.tick.info, rig.tick.make_law, PERIOD_S, rig.tick.ramp_s
        )
    assert rig.force(-1e-3) == 2.0


def test_a_tick_that_can_make_no_couplings_refuses_a_scene_that_has_one() -> None:
    rig = Rig(wall(2000.0), at_m=0.0)
    tool = {"name": "tool", "stiffness_n_per_m": 500.0, "max_force_n": 3.0}
    with pytest.raises(ConfigError, match='"tool": this tick has no couplings'):
        rig.switch(SceneConfig.model_validate({"couplings": [tool]}))
    assert rig.force(-1e-3) == 2.0
