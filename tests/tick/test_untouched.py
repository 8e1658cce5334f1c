"""What is not touched is not computed, and that changes no force."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import pytest

from hapticd.errors import PluginError
from hapticd.law import check_law
from hapticd.offline.operations import count_operations
from hapticd.tick.event import EventCode
from tests.tick.rig import PERIOD_S, Rig, law, scene, wall


class Asked:
    """A law that keeps what it is shown, with a clock of its own."""

    def __init__(self, rests: bool | None) -> None:
        self.shown: list[tuple[float, float, float, bool, float]] = []

        def step(state: Any, _params: Any, tick: Any) -> float:
            state.time_s += tick.dt_s
            self.shown.append((tick.x_m, tick.moved_m, tick.dt_s, tick.in_contact, tick.applied_n))
            force_n: float = tick.contact_n
            return force_n

        self.module = law(step, fields={"time_s": float})
        if rests is not None:
            self.module.__dict__["RESTS_OUTSIDE"] = rests


def tapped(asked: Asked) -> Rig:
    """Pressed for three ticks, and away for a hundred."""
    rig = Rig(wall(2000.0), module=asked.module, at_m=0.0)
    rig.force(-1e-3, ticks=3)
    rig.force(0.02, ticks=100)
    return rig


def test_a_law_that_rests_is_asked_until_it_has_seen_its_last_force_end() -> None:
    asked = Asked(True)
    tapped(asked)
    assert len(asked.shown) == 5
    assert [shown[3] for shown in asked.shown[3:]] == [False, False]
    assert [shown[4] for shown in asked.shown[3:]] == [pytest.approx(2.0), 0.0]


def test_on_the_very_face_of_a_wall_it_is_not_touched() -> None:
    asked = Asked(True)
    rig = tapped(asked)
    rig.force(0.0, ticks=3)
    assert len(asked.shown) == 5
    rig.force(-5e-324)
    assert len(asked.shown) == 6


@pytest.mark.parametrize("rests", [None, False])
def test_a_law_that_keeps_time_outside_is_asked_at_every_sample(rests: bool | None) -> None:
    """Resting is for those that say so."""
    asked = Asked(rests)
    rig = tapped(asked)
    assert len(asked.shown) == 103
    assert rig.tick.contacts[0].law.state.time_s == pytest.approx(0.103)


def test_after_a_rest_a_touch_is_shown_as_it_is() -> None:
    """It moved from the sample before, wherever that was, and not from where it was last asked."""
    asked = Asked(True)
    rig = tapped(asked)
    rig.force(0.004)
    rig.force(-0.001)
    x_m, moved_m, dt_s, in_contact, applied_n = asked.shown[-1]
    assert (x_m, in_contact, applied_n) == (-0.001, True, 0.0)
    assert moved_m == pytest.approx(-0.005)
    assert dt_s == pytest.approx(PERIOD_S)
    assert rig.force(-0.001) == pytest.approx(2.0)


def test_a_new_law_is_shown_that_it_is_outside() -> None:
    rig = tapped(Asked(True))
    asked = Asked(True)
    rig.switch(make_law=lambda: type(rig.tick.contacts[0].law)(asked.module, asked.module.Params()))
    rig.force(0.03, ticks=10)
    assert [in_contact for _, _, _, in_contact, _ in asked.shown] == [False]
    assert asked.shown[0][0] == 0.03
    assert asked.shown[0][1] == pytest.approx(0.01)


def test_walls_that_rest_take_no_part_in_force_or_books() -> None:
    """Eight walls on three axes, one of them pressed: the same as that one alone."""
    others = [wall(2000.0, "x", position_m=-0.05 - 0.001 * number) for number in range(7)]
    alone, among = Rig(wall(2000.0, "z"), axes="xyz", at_m=0.0), Rig(wall(2000.0, "z"), *others, axes="xyz", at_m=0.0)
    for count in range(400):
        z_m = 2e-3 * math.sin(0.1 * count)
        assert among.at(0.0, 0.0, z_m) == alone.at(0.0, 0.0, z_m)
        assert among.books_j == alone.books_j
    assert [contact.awake for contact in among.tick.contacts[1:]] == [False] * 7


def test_books_are_kept_once_more_after_a_touch_and_then_wait_whatever_the_law_does() -> None:
    rig = Rig(wall(2000.0), module=Asked(False).module, at_m=0.0)
    rig.force(-1e-3)
    rig.force(0.02)
    costs = [count_operations(partial(rig.force, 0.02)) for _ in range(3)]
    assert costs[0] > costs[1] == costs[2]


def test_under_the_fallback_a_wall_rests_outside_as_well() -> None:
    rig = tapped(Asked(False))
    rig.tick.fail_law(EventCode.LAW_OVER_BUDGET, "slow")
    rig.force(0.02, ticks=3)
    assert not rig.tick.contacts[0].awake


def test_a_wall_that_has_gone_costs_nothing_any_more() -> None:
    never, gone = Rig(at_m=0.0), Rig(wall(2000.0), at_m=0.0)
    gone.force(-1e-3)
    gone.switch(scene())
    for rig in (never, gone):
        rig.force(-1e-3, ticks=100)
    assert count_operations(partial(gone.force, -1e-3)) == count_operations(partial(never.force, -1e-3))


def test_what_rests_is_woken_by_a_change_of_where_it_is() -> None:
    """A tare moves the wall over the device."""
    asked = Asked(True)
    rig = tapped(asked)
    rig.tick.release(0.001)
    rig.force(0.02, ticks=3)
    assert rig.tick.tare()
    assert rig.tick.contacts[0].awake
    assert rig.tick.contacts[0].x_m == 0.0
    asked.shown.clear()
    rig.force(0.02, ticks=10)
    assert len(asked.shown) == 1, "it is shown that, and rests again"


def test_a_law_says_so_with_true_or_false() -> None:
    asked = Asked(True)
    check_law(asked.module)
    asked.module.__dict__["RESTS_OUTSIDE"] = "yes"
    with pytest.raises(PluginError, match="RESTS_OUTSIDE must be True or False"):
        check_law(asked.module)


def test_eight_walls_of_which_one_is_touched_cost_less_than_two() -> None:
    """Counted in instructions of the interpreter: seven walls that are out of reach cost less than one that is not."""
    others = [wall(2000.0, "z", position_m=-0.05 - 0.001 * number) for number in range(7)]
    one, eight = Rig(wall(2000.0, "z"), at_m=0.0), Rig(wall(2000.0, "z"), *others, at_m=0.0)
    two = Rig(wall(2000.0, "z"), wall(2000.0, "z", position_m=1e-4), at_m=0.0)
    costs = []
    for rig in (one, two, eight):
        rig.force(-1e-3, ticks=5)
        costs.append(count_operations(partial(rig.force, -1e-3)))
    assert costs[0] < costs[2] < costs[1]


@pytest.mark.parametrize("field", ["", "damping_n_s_per_m", "felt_mass_kg"])
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_plain_number_of_a_law_is_taken_as_it_is_and_any_other_costs_more(field: str, sign: int) -> None:
    def costs(said: float) -> int:
        def step(state: Any, _params: Any, tick: Any) -> float:
            if field:
                setattr(state, field, said)
            return tick.contact_n if field else said

        rig = Rig(wall(2000.0), module=law(step, fields={field: float} if field else None), at_m=0.0)
        rig.force(-1e-3, ticks=5)
        assert rig.tick.fault == 0
        return count_operations(partial(rig.force, -1e-3))

    assert costs(sign * 2.0) < costs(sign * 2)
