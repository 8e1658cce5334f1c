"""Transitions of a hand that stands still: nothing but the ramp may change the force."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.config.safety import SafetyConfig
from hapticd.errors import ConfigError
from hapticd.tick.event import EventCode
from hapticd.tick.guard import Mode
from hapticd_controllers import energy_cycle
from tests.examples import examples
from tests.tick.rig import LIMIT_N, PERIOD_S, RAMP_TICKS, Rig, largest_step, pushes, running, scene, wall
from tests.tick.transitions import (
    BLIND_TICKS,
    DEEDS,
    FACES_M,
    FASTER_TICKS,
    MOVES,
    RAMP_STEP_N,
    TRANSITIONS,
    arm_again,
    pressed,
)


@pytest.mark.parametrize("name", TRANSITIONS)
def test_a_transition_under_a_resting_hand_is_a_ramp_to_where_it_leads(name: str) -> None:
    """No tick changes the force by more than 2 limit / N, the first one least of all."""
    rig = pressed()
    change, expected_n = TRANSITIONS[name]
    forces = rig.forces(-2e-3, 3)
    change(rig)
    forces += rig.forces(-2e-3, 2 * RAMP_TICKS + 2)
    assert forces[0] == 4.0
    assert forces[-1] == pytest.approx(expected_n, abs=1e-9)
    assert largest_step(forces) <= 2.0 * RAMP_STEP_N + 1e-9
    assert abs(forces[3] - 4.0) <= RAMP_STEP_N + 1e-9


@pytest.mark.parametrize(
    ("first", "second", "after"), [(a, b, c) for a, b in itertools.permutations(TRANSITIONS, 2) for c in (1, 20)]
)
def test_a_transition_in_the_middle_of_another_is_no_step_either(first: str, second: str, after: int) -> None:
    rig = pressed()
    forces = rig.forces(-2e-3, 2)
    TRANSITIONS[first][0](rig)
    forces += rig.forces(-2e-3, after)
    TRANSITIONS[second][0](rig)
    forces += rig.forces(-2e-3, 3 * RAMP_TICKS)
    # Two contacts at most blend at once, while the gain falls and the limit moves.
    assert largest_step(forces) <= 6.0 * RAMP_STEP_N + 1e-9
    assert all(abs(force_n) <= LIMIT_N * (1.0 + 1e-9) for force_n in forces)


def test_arming_a_pressed_device_comes_in_by_a_ramp_however_deep_it_is() -> None:
    """The wall asks for 120 N where 12 are allowed: it must not come in ten times as fast for that."""
    rig = Rig(wall(12000.0), at_m=-0.01, arm=False)
    assert rig.forces(-0.01, 5) == [0.0] * 5
    arm_again(rig)
    forces = rig.forces(-0.01, RAMP_TICKS + 1)
    assert forces == pytest.approx([RAMP_STEP_N * step for step in range(RAMP_TICKS + 1)])


def test_arming_in_the_middle_of_a_release_goes_on_from_the_force_that_is_left() -> None:
    rig = pressed()
    rig.tick.release()
    forces = rig.forces(-2e-3, 30)
    arm_again(rig)
    forces += rig.forces(-2e-3, RAMP_TICKS + 1)
    assert forces[29] == pytest.approx(4.0 * 0.4)
    assert forces[30] == pytest.approx(forces[29])
    assert forces[-1] == pytest.approx(4.0)
    assert largest_step(forces) <= 2.0 * RAMP_STEP_N


def test_a_law_switch_during_a_release_neither_steps_nor_stops_it() -> None:
    """The blend must start from the force before the release's gain, or the gain would count twice."""
    rig = pressed(wall(5000.0))
    rig.tick.release()
    forces = rig.forces(-2e-3, 25)
    rig.switch(make_law=running(pushes(12.0)))
    forces += rig.forces(-2e-3, 30)
    assert forces[24] - forces[25] == pytest.approx(10.0 / RAMP_TICKS)
    assert largest_step(forces) <= 2.0 * RAMP_STEP_N
    assert forces[-1] == 0.0
    assert rig.tick.guard.mode is Mode.DISARMED


def test_a_stop_in_the_middle_of_a_blend_is_over_in_its_own_time() -> None:
    rig = pressed()
    rig.switch(scene(wall(6000.0)))
    forces = rig.forces(-2e-3, 20)
    rig.tick.release(0.02)
    forces += rig.forces(-2e-3, 21)
    assert forces[-1] == 0.0
    assert largest_step(forces) <= LIMIT_N / 20.0 + 2.0 * RAMP_STEP_N


def test_a_smaller_limit_in_the_middle_of_a_release_is_no_step() -> None:
    """A limit counts before the gain of a release: from the force that is left it would take the gain twice."""
    rig = pressed(wall(6000.0))
    rig.tick.release()
    forces = rig.forces(-2e-3, 25)
    rig.switch(safety=SafetyConfig(max_force_n=1.0))
    forces += rig.forces(-2e-3, 25)
    assert forces[24] == pytest.approx(6.0)
    assert largest_step(forces) <= 2.0 * RAMP_STEP_N
    assert forces[-1] == pytest.approx(0.0, abs=1e-12)


def test_a_fault_in_the_middle_of_a_release_latches_and_the_release_goes_on() -> None:
    rig = pressed()
    rig.tick.release()
    forces = rig.forces(-2e-3, 10)
    rig.tick.fail(EventCode.DEVICE_FAULT, "hot")
    forces += rig.forces(-2e-3, 45)
    assert forces[49] == pytest.approx(0.0, abs=1e-12)
    assert largest_step(forces) == pytest.approx(4.0 / RAMP_TICKS)
    assert not rig.tick.arm()


def test_at_the_tick_of_a_law_switch_the_force_moves_as_the_device_did_and_no_further() -> None:
    rig = pressed()
    rig.switch(make_law=running(pushes(11.0)))
    assert rig.force(-2e-3) == 4.0
    rig = pressed()
    rig.switch(make_law=running(pushes(11.0)))
    assert rig.force(-1.5e-3) == pytest.approx(3.0)


def test_a_blend_ends_with_the_contact_and_never_pulls_the_hand_in() -> None:
    """Armed deep inside, drawn back quickly: a ramp that subtracts what is still to come would pull."""
    rig = Rig(wall(2000.0), at_m=-5e-3, arm=False)
    rig.force(-5e-3, ticks=2)
    arm_again(rig)
    forces = []
    for count in range(12):
        forces.append(rig.force(-5e-3 + 0.5e-3 * count))
    assert min(forces) >= 0.0
    assert forces[-1] == 0.0
    assert rig.force(-1e-3) == 2.0


@examples(400)
@given(path=st.lists(st.tuples(DEEDS, st.integers(1, 15), MOVES), min_size=1, max_size=25))
def test_whatever_is_asked_in_whatever_order_the_force_goes_by_ramps(path: list[tuple[str, int, float]]) -> None:
    """Motion explains k dx for each wall, and a blind moment a tenth of the limit; the rest is ramps.

    Bound of a tick: 2 limit / N for every wall that blends, limit / N each for the gain of a release and for a
    moving limit; for the motion k |dx| of every wall, twice in a blend (the old force and the new one), and b |dv| of
    the damping that the fallback puts on every wall. A faster release has its own N, and so has a blind moment.
    """
    rig = pressed()
    position_m = -2e-3
    last_n = 4.0
    blind_ticks = faster_ticks = 0
    for deed, ticks, move_m in path:
        if deed in TRANSITIONS:
            TRANSITIONS[deed][0](rig)
        elif deed == "arm":
            rig.tick.arm()
        elif deed == "clear":
            rig.tick.guard.clear()
        elif deed == "faster":
            rig.tick.release(FASTER_TICKS * PERIOD_S)
            faster_ticks = FASTER_TICKS
        for count in range(ticks):
            before_m, before_m_per_s = position_m, rig.tick.motion.velocity_m_per_s[0]
            moving = deed == "nothing"
            position_m = min(0.01, max(-0.01, position_m + move_m)) if moving else position_m
            dark = deed == "dark" or (deed == "nan" and count < 4)
            blending = sum(contact.blending for contact in [*rig.tick.contacts, *rig.tick.leaving])
            force_n = rig.force(math.nan if dark else position_m)
            blind_ticks = BLIND_TICKS if dark else blind_ticks - 1
            contacts = [*rig.tick.contacts, *rig.tick.leaving]
            spring = sum(max(contact.wall.stiffness_n_per_m, 6000.0) for contact in contacts) + 6000.0
            ramps = (2.0 * blending + 2.0) * RAMP_STEP_N
            if faster_ticks > 0:
                ramps += LIMIT_N / FASTER_TICKS
            if blind_ticks > 0:
                ramps += LIMIT_N / BLIND_TICKS
            faster_ticks -= 1
            moved = 2.0 * spring * abs(position_m - before_m)
            moved += len(contacts) * 10.0 * abs(rig.tick.motion.velocity_m_per_s[0] - before_m_per_s)
            # A law that pushes alike at every depth starts and ends with the contact, by itself.
            edges = LIMIT_N * 2.0 if any((before_m < face_m) != (position_m < face_m) for face_m in FACES_M) else 0.0
            assert abs(force_n - last_n) <= ramps + moved + edges + 1e-9
            assert abs(force_n) <= LIMIT_N * (1.0 + 1e-9)
            last_n = force_n


# Scene switches


def test_an_unchanged_wall_keeps_its_clock_its_law_and_its_books_wherever_it_stands_in_the_list() -> None:
    changing = wall(2000.0, changes=[{"at_s": 0.03, "stiffness_n_per_m": 4000.0}])
    rig = pressed(wall(100.0, position_m=-1.0), changing, depth_m=1e-3, simulated=True)
    kept = rig.tick.contacts[1]
    rig.force(-1e-3, ticks=10)
    rig.switch(scene(changing, wall(300.0, position_m=-2.0)))
    assert rig.tick.contacts[0] is kept
    assert rig.forces(-1e-3, 18) == [2.0] * 18
    assert rig.forces(-1e-3, 1) == [4.0]


def test_a_wall_that_goes_while_the_force_is_limited_turns_it_by_a_ramp() -> None:
    """The one that stays asks for more than it had of the limit, and takes it over no faster than the other lets go."""
    both = [wall(10_000.0, "x"), wall(10_000.0, "y")]
    rig = Rig(*both, axes="xy", at_m=0.0)
    rig.at(-2e-3, -2e-3, ticks=2)
    rig.switch(scene(both[1]))
    forces = rig.at(-2e-3, -2e-3, ticks=RAMP_TICKS + 2)
    assert forces[0] == pytest.approx([LIMIT_N / math.sqrt(2.0)] * 2)
    assert forces[-1] == pytest.approx([0.0, LIMIT_N])
    for axis in (0, 1):
        assert largest_step([force_n[axis] for force_n in forces]) <= 2.0 * RAMP_STEP_N


def test_a_wall_that_had_not_faded_out_does_not_come_back_with_the_next_arming() -> None:
    rig = pressed()
    rig.switch(scene())
    rig.force(-2e-3, ticks=10)
    rig.tick.release(0.005)
    assert rig.force(-2e-3, ticks=6) == 0.0
    assert rig.tick.leaving
    arm_again(rig)
    assert rig.forces(-2e-3, RAMP_TICKS) == [0.0] * RAMP_TICKS


def test_a_wall_that_changed_in_place_keeps_law_and_books_and_starts_its_clock_anew() -> None:
    rig = pressed(module=energy_cycle)
    contact = rig.tick.contacts[0]
    law_before, energy_j = contact.law, contact.ledger.energy_j
    rig.switch(scene(wall(1000.0, changes=[{"at_s": 0.1, "stiffness_n_per_m": 3000.0}])))
    assert rig.tick.contacts == [contact]
    assert contact.law is law_before
    assert contact.ledger.energy_j == energy_j
    rig.force(-2e-3, ticks=100)
    assert contact.wall.stiffness_n_per_m == 1000.0
    rig.force(-2e-3)
    assert contact.wall.stiffness_n_per_m == 3000.0


def test_of_two_equal_walls_each_finds_itself() -> None:
    rig = Rig(wall(100.0), wall(100.0))
    before = list(rig.tick.contacts)
    rig.switch(scene(wall(100.0), wall(100.0)))
    assert rig.tick.contacts == before


def test_a_scene_that_does_not_fit_changes_nothing() -> None:
    rig = pressed()
    contacts = list(rig.tick.contacts)
    with pytest.raises(ConfigError, match=r"scene\.walls\[1\]"):
        rig.switch(scene(wall(9.0), wall(9.0, "x")))
    assert rig.tick.contacts == contacts
    assert rig.force(-2e-3) == 4.0


def test_a_limit_that_does_not_fit_changes_nothing() -> None:
    rig = pressed()
    with pytest.raises(ConfigError, match="max_force_n"):
        rig.switch(scene(wall(9.0)), SafetyConfig(max_force_n=500.0), running(pushes(1.0)))
    assert rig.force(-2e-3) == 4.0


def test_a_scene_that_comes_during_the_fallback_gets_the_fallback() -> None:
    rig = pressed()
    rig.tick.fail_law(EventCode.LAW_OVER_BUDGET, "slow")
    rig.switch(scene(wall(1000.0), wall(2000.0, position_m=-1.0)), None, running(pushes(-5.0)))
    assert {contact.law.module.__name__ for contact in rig.tick.contacts} == {"hapticd.tick.fallback"}
    rig.force(-2e-3, ticks=60)
    rig.tick.guard.clear()
    rig.tick.arm()
    assert {contact.law.module.__name__ for contact in rig.tick.contacts} == {"tests.some_law"}


def test_a_changed_ramp_reaches_later_ramps() -> None:
    """T4: of a release and of a switch alike: 0.2 s, after 0.05 s."""
    for change in ("release", "stiffer"):
        rig = pressed()
        rig.switch(safety=SafetyConfig(ramp_s=0.2, max_speed_m_per_s=100.0))
        rig.force(-2e-3, ticks=500)
        if change == "release":
            rig.tick.release()
        else:
            rig.switch(scene(wall(4000.0)))
        forces = rig.forces(-2e-3, 250)
        assert forces[198] != pytest.approx(forces[-1], rel=1e-6)
        assert forces[202:] == [forces[-1]] * 48
