"""A law that fails on an object is named and replaced, and the force is let out by a ramp."""

from __future__ import annotations

from types import ModuleType

import pytest

from hapticd.tick import fallback
from hapticd.tick.contact import RunningLaw
from tests.tick.space import failing_law
from tests.tick.space.rig import INFO, ball, config
from tests.tick.space.test_changes import pressed


def test_a_law_that_fails_on_an_object_is_replaced_and_the_force_let_out() -> None:
    rig = pressed()
    loaded = config(ball())
    contact = rig.tick.solids[0]
    contact.normal.law = RunningLaw(failing_law, failing_law.Params())
    rig.go((0.0, 0.0, 0.0291))
    assert rig.tick.fallback
    assert "failing_law" in rig.tick.fault_text
    assert rig.force[2] > 3.0
    rig.to((0.0, 0.0, 0.0291), 60)
    assert rig.force == (0.0, 0.0, 0.0)
    assert loaded.law is not contact.normal.law.module


@pytest.mark.parametrize("at", [0, 1], ids=["a wall's", "an object's"])
def test_the_law_that_failed_is_named_and_no_other(at: int) -> None:
    """The first contact's was, whichever had failed: the way back is to mend it."""
    wall = '[[scene.walls]]\naxis = "z"\nstiffness_n_per_m = 100.0\nposition_m = 0.03\n'
    rig = pressed(wall + ball(), "damper")
    failing = (rig.tick.contacts[0], rig.tick.solids[0].normal)[at]
    failing.law = RunningLaw(failing_law, failing_law.Params(raises=False))
    rig.go((0.0, 0.0, 0.0291))
    assert rig.tick.fault_text == "law tests.tick.space.failing_law: ArithmeticError: nan is not a possible number"


@pytest.mark.parametrize("channel", [0, 1, 2], ids=["across", "along", "along as well"])
def test_it_is_named_in_each_direction_of_an_object(channel: int) -> None:
    rig = pressed(ball(static_friction=0.5, dynamic_friction=0.4), "damper")
    rig.tick.solids[0].channels[channel].law = RunningLaw(failing_law, failing_law.Params(raises=False))
    for each in rig.tick.solids[0].channels[:channel]:
        each.law = rig.tick.solids[0].channels[channel].law.another()
    rig.go((0.0001, 0.0, 0.0291))
    assert rig.tick.fault_text == "law tests.tick.space.failing_law: ArithmeticError: nan is not a possible number"


def test_a_law_that_builds_on_the_one_of_a_wall_is_named_where_it_fails_on_an_object() -> None:
    """The wall's was, since it was in the middle of it."""
    builds = ModuleType("lab.builds")
    builds.__dict__.update(failing_law.__dict__, __name__="lab.builds")
    wall = '[[scene.walls]]\naxis = "z"\nstiffness_n_per_m = 100.0\nposition_m = -0.5\n'
    rig = pressed(wall + ball(), "damper")
    rig.tick.contacts[0].law = RunningLaw(failing_law, failing_law.Params())
    rig.tick.solids[0].normal.law = RunningLaw(builds, builds.Params())
    rig.go((0.0, 0.0, 0.0291))
    assert rig.tick.fault_text.startswith("law lab.builds: ZeroDivisionError: as it happens")


def test_what_comes_while_the_fallback_is_in_force_has_it_too_until_the_device_is_armed() -> None:
    """An object that is new, and the directions of one that has become rough."""
    rig = pressed()
    rig.tick.solids[0].normal.law = RunningLaw(failing_law, failing_law.Params())
    rig.go((0.0, 0.0, 0.0291))
    rig.switch(ball(static_friction=0.5, dynamic_friction=0.4) + ball("other", position_m=(0.2, 0.0, 0.0)))
    laws = [channel.law for contact in rig.tick.solids for channel in contact.channels]
    assert len(laws) == 4
    assert {law.module for law in laws} == {fallback}
    assert {law.params.damping_n_s_per_m for law in laws} == {INFO.safe_damping_n_s_per_m}
    rig.to((0.0, 0.0, 0.0291), 60)
    rig.tick.guard.clear()
    rig.tick.arm()
    names = {channel.law.module.__name__ for contact in rig.tick.solids for channel in contact.channels}
    assert names == {"hapticd_controllers.energy_cycle"}
