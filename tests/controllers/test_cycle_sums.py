"""An energy cycle: two falls before its lowest energy, two rises after it, counted from where it begins."""

from __future__ import annotations

from itertools import pairwise
from types import ModuleType
from typing import Any

import pytest

from hapticd.law import LawSnapshot, LawTick, fresh_state, plain_object, scalar_params
from hapticd_controllers import energy_cycle, late_cycle
from hapticd_controllers.cycle_sums import begin, end

PUSH_N = 3.0
STEP_M = PERIOD_S = 2.0**-10
"""A step of a millimetre in a millisecond, so that sums of them are exact."""
LAWS = pytest.mark.parametrize("law", [energy_cycle, late_cycle], ids=["energy_cycle", "late_cycle"])


class Contact:
    """A law that is shown a contact of 3 N, pressed and released by a step at each sample; a rise takes energy."""

    def __init__(self, law: ModuleType, **params: Any) -> None:
        self.law = law
        self.params = plain_object("Params", scalar_params(law.Params(**params)))
        self.state = fresh_state(law)
        law.start(self.state, self.params, LawSnapshot(x_m=-5.0 * STEP_M))
        self.tick = LawTick(STEP_M, x_m=-5.0 * STEP_M, dt_s=PERIOD_S, in_contact=True, contact_n=PUSH_N)

    def goes(self, *steps: int) -> list[float]:
        """The damping after each step in or out, under the force that is held since the last."""
        found = []
        for step in steps:
            tick = self.tick
            tick.applied_n = tick.applied_contact_n = PUSH_N
            tick.moved_m = -STEP_M * step
            tick.velocity_m_per_s = tick.moved_m / tick.dt_s
            tick.x_m += tick.moved_m
            self.law.step(self.state, self.params, tick)
            found.append(float(self.state.damping_n_s_per_m))
        return found


@LAWS
def test_one_fall_is_no_release_and_two_are_at_the_beginning_too(law: ModuleType) -> None:
    assert set(Contact(law).goes(-1, 1, 1, 1)) == {0.0}
    found = Contact(law).goes(-1, -1, 1, 1)
    assert found[:3] == [0.0] * 3
    assert found[3] == pytest.approx(PUSH_N), "6 mJ of generated energy in 2 ms at 1 m/s"


@LAWS
def test_a_rise_in_between_is_another_release(law: ModuleType) -> None:
    assert set(Contact(law).goes(-1, 1, -1, 1, -1, 1, 1)) == {0.0}


@LAWS
def test_each_cycle_counts_from_where_the_one_before_has_ended(law: ModuleType) -> None:
    """The second takes 6 mJ and gives back 3: it has generated nothing, and what it holds is not counted twice."""
    contact = Contact(law)
    contact.goes(-1, -1, 1, 1)
    after = contact.goes(1, 1, -1, -1, 1, 1)
    assert all(b <= a for a, b in pairwise(after))


def test_what_is_owed_from_before_is_where_the_first_fall_begins() -> None:
    state = fresh_state(energy_cycle)
    begin(state, -2.5)
    assert (state.energy_j, state.window_energy_j) == (-2.5, -2.5)
    assert (state.window_falls, state.window_rises) == (0, 0)


def test_at_the_end_energies_count_from_the_lowest_and_the_way_from_here() -> None:
    state = fresh_state(energy_cycle)
    begin(state, 0.0)
    state.energy_j, state.window_energy_j, state.window_minimum_j = -1.0, -1.0, -3.0
    state.candidate_stored_j = 0.25
    end(state, -2e-3)
    assert (state.energy_j, state.window_energy_j, state.stored_j) == (2.0, 2.0, 0.25)
    assert (state.lowest_m, state.highest_m) == (-2e-3, -2e-3)


@pytest.mark.parametrize(("future", "ends"), [(0, 2), (1, 1), (2, 2), (3, 3)])
def test_as_many_rises_end_a_cycle_as_are_asked_for_and_two_where_none_are(future: int, ends: int) -> None:
    found = Contact(energy_cycle, window_future=future).goes(-1, -1, 1, 1, 1, 1)
    assert [damping > 0.0 for damping in found] == [False] * (1 + ends) + [True] * (5 - ends)


@pytest.mark.parametrize(("rule", "expected"), [("signed", -9.0 / 7.0), ("non-negative", 0.0), ("non-decreasing", 0.0)])
def test_what_a_cycle_has_taken_makes_the_damping_negative_nothing_or_what_it_was(rule: str, expected: float) -> None:
    """15 mJ in, 6 out again: 9 mJ more than it generated, in 7 ms at 1 m/s."""
    contact = Contact(energy_cycle, rule=rule, cap="none")
    assert contact.goes(1, 1, 1, 1, 1, -1, -1, 1, 1)[-1] == pytest.approx(expected)


@pytest.mark.parametrize(("least", "counts"), [(0.0, True), (2.0, True), (2.001, False)])
def test_a_cycle_that_travels_less_than_the_least_changes_nothing(least: float, counts: bool) -> None:
    """Two counts out and two back."""
    assert (Contact(energy_cycle, min_travel_counts=least).goes(-1, -1, 1, 1)[-1] > 0.0) == counts


@pytest.mark.parametrize(("small", "leaks", "expected"), [(2.0, 0.5, 3.0), (2.001, 0.5, 1.5), (2.001, 0.0, 3.0)])
def test_a_cycle_that_travels_less_than_a_small_one_adds_no_more_than_its_leaks(
    small: float, leaks: float, expected: float
) -> None:
    contact = Contact(energy_cycle, small_travel_counts=small, small_leaks=leaks)
    assert contact.goes(-1, -1, 1, 1)[-1] == pytest.approx(expected)


@LAWS
@pytest.mark.parametrize(("samples", "felt_kg"), [(19.999, 0.0), (20.0, 0.5)])
def test_a_mass_is_believed_at_the_end_of_a_cycle_from_twenty_samples_on(
    law: ModuleType, samples: float, felt_kg: float
) -> None:
    """Evidence of 0.5 kg: speeds that change by 2 where the impulse is 1."""
    contact = Contact(law)
    contact.goes(-1, -1, 1)
    state = contact.state
    state.count, state.sum_uu, state.sum_uw = samples, 1.0, 2.0
    contact.goes(1)
    assert state.felt_mass_kg == pytest.approx(felt_kg)


@pytest.mark.parametrize("way", [[-1] * 12, [1] * 12 + [-1] * 13], ids=["out", "in and out"])
@pytest.mark.parametrize(
    ("law", "params"), [(energy_cycle, {"cap": "none"}), (late_cycle, {"most_unfelt_n_s_per_m": 1e3})]
)
def test_a_cycle_that_travels_by_ten_counts_adds_to_any_damping_and_a_shorter_one_does_not(
    law: ModuleType, params: dict[str, Any], way: list[int]
) -> None:
    """Whichever way it goes; a small one is as much noise as motion."""
    for steps, adds in ((way, True), ([-1] * 9, False)):
        contact = Contact(law, **params)
        contact.state.damping_n_s_per_m = 200.0
        assert (contact.goes(*steps, 1, 1)[-1] > 200.0) == adds
