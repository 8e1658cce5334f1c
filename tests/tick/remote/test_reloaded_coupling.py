"""A coupling goes on through a reload, and goes over to what is new by a ramp."""

from __future__ import annotations

from itertools import pairwise

import pytest

from hapticd.tick.remote.follower import HASTE_PER_S
from tests.tick.remote.rig import COUPLING, MOST_N, PERIOD_S, PROMPT, RAMP_S, WALL, Rig, apart, length, update
from tests.tick.remote.test_coupling import RAMP_TICKS, STEP_N, B, held_at


def test_it_goes_on_under_its_name_through_a_reload_and_fades_out_with_the_scene() -> None:
    rig = Rig()
    held_at(rig, [2e-3], 300)
    port = rig["tool"]
    rig.switch(COUPLING.replace("2000.0", "1000.0").replace(f"max_force_n = {MOST_N}", "max_force_n = 3.0") + WALL)
    assert rig["tool"] is port
    (was_n,) = rig.force
    for _ in range(100):
        (now_n,) = held_at(rig, [2e-3], 1)
        assert abs(now_n - was_n) <= STEP_N
        was_n = now_n
    assert was_n == pytest.approx(2.0)
    rig.switch(WALL)
    assert rig.ports == []
    forces = [rig.go()[0] for _ in range(RAMP_TICKS)]
    assert max(abs(a - b) for a, b in zip([2.0, *forces], forces, strict=False)) <= 2.0 / RAMP_TICKS + 1e-9
    assert rig.go(ticks=5) == [0.0]
    rig.switch(COUPLING)
    assert rig["tool"] is not port
    assert rig.unbalanced_j() < 1e-9


@pytest.mark.parametrize("most_n", [MOST_N + 0.8, MOST_N - 0.8])
def test_another_limit_stays_where_it_is_in_ticks_in_which_no_time_passes(most_n: float) -> None:
    """A real device, on a computer whose clock stood still, or went back."""
    rig = Rig(COUPLING + PROMPT, simulated=False)
    for _ in range(200):
        rig.say("tool", position_m=[0.05])
        rig.go()
    rig.switch(COUPLING.replace(f"max_force_n = {MOST_N}", f"max_force_n = {most_n}") + PROMPT)
    rig.go()
    before = rig.force
    for passed_s in (0.0, -1.0):
        assert list(rig.tick.advance(rig.sample, passed_s)) == pytest.approx(before, abs=0.8 / 50 + 1e-9)
    assert before != pytest.approx([most_n], abs=0.1)


@pytest.mark.parametrize("most_n", [MOST_N + 0.8, MOST_N - 0.8])
def test_another_limit_is_gone_over_to_by_the_ramp_however_near_it_is(most_n: float) -> None:
    rig = Rig()
    assert held_at(rig, [0.02], 200) == [pytest.approx(MOST_N)]
    rig.switch(COUPLING.replace(f"max_force_n = {MOST_N}", f"max_force_n = {most_n}"))
    forces = [rig.force[0]]
    for _ in range(100):
        forces += held_at(rig, [0.02], 1)
    steps = [after - before for before, after in pairwise(forces)]
    assert max(map(abs, steps)) <= 0.8 * PERIOD_S / RAMP_S * (1.0 + 1e-6)
    assert forces[-1] == pytest.approx(most_n)


@pytest.mark.parametrize("most_n", [0.5, 2.0 * MOST_N])
@pytest.mark.parametrize(
    ("before", "after"),
    [(200, 0), (200, 5000), (20, 100), (RAMP_TICKS - 2, 0), (RAMP_TICKS - 2, 2), (RAMP_TICKS + 2, 0)],
    ids=["asleep", "long before", "as it goes", "at its last", "at its last and in between", "just gone"],
)
def test_who_comes_after_another_limit_was_loaded_comes_under_that_one(before: int, after: int, most_n: float) -> None:
    """Ticks from where the client before let go until the reload, and from there until the next client."""
    other = (COUPLING + PROMPT).replace(f"max_force_n = {MOST_N}", f"max_force_n = {most_n}")
    rig, fresh = Rig(COUPLING + PROMPT), Rig(other)
    held_at(rig, [2e-3], 100)
    rig["tool"].take(update(rig.seq, released=True))
    rig.go(ticks=before)
    rig.switch(other)
    rig.go(ticks=after)
    while rig["tool"].weight:  # what is left of the force of before has a ramp
        rig.go()
    forces = comes_in(rig)
    assert max(map(abs, forces)) <= most_n
    assert forces == pytest.approx(comes_in(fresh), abs=1e-9)
    assert forces[-1] == pytest.approx(most_n)


def test_who_comes_to_a_device_that_was_found_again_comes_under_the_limit_that_was_loaded_just_before() -> None:
    other = (COUPLING + PROMPT).replace(f"max_force_n = {MOST_N}", "max_force_n = 0.5")
    rig = Rig(COUPLING + PROMPT)
    held_at(rig, [2e-3], 100)
    rig.switch(other)
    rig.go(ticks=3)
    rig.tick.start(rig.sample)
    rig.force = [0.0]
    assert comes_in(rig) == pytest.approx(comes_in(Rig(other)), abs=1e-9)


def comes_in(rig: Rig) -> list[float]:
    """The force of a client that comes while the device passes by, faster than its target may be."""
    forces = []
    for n in range(200):
        if n >= 10:
            rig.say("tool", position_m=[0.08])
        forces += rig.go([min(4e-3 * n, 0.06)])
    return forces


@pytest.mark.parametrize("axes", ["x", "xyz"])
def test_a_target_that_is_to_be_slower_after_a_reload_slows_down_without_a_step_of_force(axes: str) -> None:
    soft = COUPLING.replace("2000.0", "100.0") + PROMPT  # so that no limit hides the damper
    rig = Rig(soft, axes=axes)
    away = [0.1] * len(axes)
    held_at(rig, [0.0] * len(axes), 100)
    held_at(rig, away, 4)
    assert length(rig["tool"].follower.speed_m_per_s) > 0.9
    slow_m_per_s = 0.2
    rig.switch(soft + f"max_speed_m_per_s = {slow_m_per_s}\n")
    for _ in range(60):
        before, target_m = rig.force, list(rig["tool"].target_m)
        held_at(rig, away, 1)
        way_m = apart(rig["tool"].target_m, target_m)
        assert apart(rig.force, before) <= 100.0 * way_m + B * HASTE_PER_S * slow_m_per_s * PERIOD_S * (1.0 + 1e-9)
    assert way_m == pytest.approx(slow_m_per_s * PERIOD_S)


def test_another_law_for_walls_is_none_for_a_coupling() -> None:
    rig = Rig(COUPLING + WALL)
    held_at(rig, [2e-3], 300)
    (was_n,) = rig.force
    law = rig["tool"].channels[0].law
    rig.switch(law="ring-damping")
    for _ in range(100):
        (now_n,) = held_at(rig, [2e-3], 1)
        assert now_n == pytest.approx(was_n)
    assert rig["tool"].channels[0].law is law
    assert rig.tick.contacts[0].law.module.__name__.endswith("ring_damping")


@pytest.mark.parametrize("driven", [False, True])
def test_a_reload_that_turns_the_law_to_another_motion_comes_in_by_the_ramp(driven: bool) -> None:
    """Against the ground a device at rest is not damped, against a target that passes by with 5 N."""
    scene = COUPLING.replace("damping_n_s_per_m = 5.0", "driven = {}").replace("2000.0", "10.0")
    rig = Rig(scene.format(str(not driven).lower()), law="damper")
    forces = []
    for n in range(400):
        if n == 200:
            rig.switch(scene.format(str(driven).lower()))
        rig.say("tool", position_m=[0.1e-3 * n], velocity_m_per_s=[0.1])
        forces.append(rig.go()[0])
    assert abs(forces[398] - forces[198]) > 4.0
    steps = [abs(b - a) for a, b in pairwise(forces[199:])]
    assert max(steps) <= 2.0 * MOST_N * PERIOD_S / RAMP_S
