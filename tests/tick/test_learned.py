"""What a law has learnt of a wall, and what of it the next one finds."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest

from hapticd.errors import PluginError
from hapticd.law import check_law
from hapticd.tick.event import EventCode
from hapticd_controllers import energy_cycle, none, tdpa
from tests.tick.rig import law, running, wall
from tests.tick.transitions import pressed


def learner(learned: tuple[str, ...] = ()) -> tuple[ModuleType, list[float]]:
    """A law that publishes 30 N s/m and 0.4 kg, and what it found when it started."""
    found: list[float] = []

    def start(state: Any, _params: Any, snapshot: Any) -> None:
        found.append(snapshot.damping_n_s_per_m)
        state.damping_n_s_per_m, state.felt_mass_kg = 30.0, 0.4

    fields: dict[str, type] = {"damping_n_s_per_m": float, "felt_mass_kg": float}
    module = law(lambda _state, _params, tick: tick.contact_n, start, fields)
    module.__dict__["LEARNED"] = learned
    return module, found


def test_what_a_law_declares_as_learned_is_found_by_the_next_one_and_nothing_else_is() -> None:
    for learned, expected in (((), 0.0), (("damping_n_s_per_m",), 30.0)):
        first, found = learner(learned)
        rig = pressed(module=first)
        second, found_next = learner()
        rig.switch(make_law=running(second))
        assert found[0] == 0.0
        assert found_next == [expected]


def test_what_one_law_published_is_not_said_of_the_next() -> None:
    """A law without damping publishes none, so nothing would ever overwrite what the one before has left."""
    first, _ = learner()
    rig = pressed(module=first)
    contact = rig.tick.contacts[0]
    assert (contact.damping_n_s_per_m, contact.felt_mass_kg) == (30.0, 0.4)
    rig.switch(make_law=running(none))
    rig.force(-2e-3)
    assert (contact.damping_n_s_per_m, contact.felt_mass_kg) == (0.0, 0.0)


def test_what_was_learnt_goes_on_through_two_laws_between_two_samples() -> None:
    """As of a device that is armed twice, or of two reloads between its samples: 7 N s/m became 0."""
    first, _ = learner(("damping_n_s_per_m",))
    rig = pressed(module=first)
    found = []
    for _ in range(3):
        module, found_by_it = learner(("damping_n_s_per_m",))
        rig.switch(make_law=running(module))
        assert rig.tick.contacts[0].damping_n_s_per_m == 30.0
        found += found_by_it
    assert found == [30.0] * 3


def test_after_the_fallback_a_law_starts_without_the_fallbacks_damping() -> None:
    """C4: it started with 50 N s/m, and a damping that never decreases stayed there."""
    rig = pressed(module=energy_cycle, safe_damping_n_s_per_m=50.0)
    rig.tick.fail_law(EventCode.LAW_OVER_BUDGET, "slow")
    rig.force(-2e-3, ticks=60)
    assert rig.tick.contacts[0].damping_n_s_per_m == 50.0
    rig.tick.guard.clear()
    assert rig.tick.arm()
    rig.force(0.01, ticks=1000)
    assert rig.tick.contacts[0].damping_n_s_per_m == 0.0


def test_the_damping_of_one_sample_is_not_learned() -> None:
    """C4: nor is TDPA's, which is for one sample."""
    rig = pressed(wall(12e3), module=tdpa)
    depth_m = 2e-4
    while rig.tick.contacts[0].damping_n_s_per_m == 0.0:  # a debt, by jumps that the hold pays for
        depth_m = 3e-4 if depth_m == 2e-4 else 2e-4
        rig.force(-depth_m)
    told, found = learner()
    rig.switch(make_law=running(told))
    assert found == [0.0]


def test_what_the_cycles_have_called_for_goes_on_when_the_device_is_armed_again() -> None:
    rig = pressed(module=energy_cycle)
    rig.tick.contacts[0].law.state.damping_n_s_per_m = 7.0
    rig.force(-2e-3)
    rig.tick.release()
    rig.force(-2e-3, ticks=60)
    assert rig.tick.arm()
    rig.force(-2e-3)
    assert rig.tick.contacts[0].damping_n_s_per_m == 7.0


@pytest.mark.parametrize(
    ("learned", "problem"),
    [
        (("felt_mass_kg",), "handed on is damping_n_s_per_m"),
        ("damping_n_s_per_m", "must be a tuple of names"),
        ((3,), "handed on is"),
    ],
)
def test_a_law_that_declares_what_cannot_be_handed_on_is_none(learned: Any, problem: str) -> None:
    module, _ = learner(learned)
    with pytest.raises(PluginError, match=problem):
        check_law(module)


def test_a_law_that_declares_what_its_state_has_not_is_none() -> None:
    module = law(lambda _state, _params, _tick: 0.0)
    module.__dict__["LEARNED"] = ("damping_n_s_per_m",)
    with pytest.raises(PluginError, match="which State has not"):
        check_law(module)
