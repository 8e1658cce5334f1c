"""A coupling pulls the device to where a client says, gently at each end, and lets go of whom it does not hear."""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise

import pytest

from hapticd.offline.operations import count_operations, operations_by_code
from hapticd.tick.remote.follower import HASTE_PER_S
from hapticd.tick.remote.port import PortState
from tests.tick.remote.rig import COUPLING, MOST_N, PERIOD_S, PROMPT, RAMP_S, WALL, Rig, apart, length, update

K, B, FASTEST = 2000.0, 5.0, 1.0
RAMP_TICKS = round(RAMP_S / PERIOD_S)
STEP_N = MOST_N / RAMP_TICKS
"""What a ramp changes a force by in a tick, at most [N]."""
FOLLOW_N = (K + HASTE_PER_S * B) * FASTEST * PERIOD_S
"""What the target's motion changes it by, at most [N]."""


def told(rig: Rig, name: str = "tool") -> PortState | None:
    """What the loop would tell of a port now."""
    news, rig[name].news = rig[name].news, None
    assert news is None or isinstance(news, PortState)
    return news


def held_at(rig: Rig, target_m: list[float], ticks: int) -> list[float]:
    for _ in range(ticks):
        rig.say("tool", position_m=target_m)
        rig.go()
    return rig.force


def test_without_a_client_there_is_no_force_and_nothing_to_do() -> None:
    rig = Rig()
    for n in range(100):
        assert rig.go([0.01 * math.sin(0.1 * n)]) == [0.0]
    assert rig["tool"].state is PortState.IDLE
    assert rig["tool"].seq == -1
    assert rig.tick.totals().ledger.energy_j == 0.0


@pytest.mark.parametrize("axes", ["x", "xy", "xyz"])
def test_a_client_that_moves_the_target_moves_the_spring(axes: str) -> None:
    rig = Rig(axes=axes)
    target_m = [1e-3, -5e-4, 2e-4][: len(axes)]
    force = held_at(rig, target_m, 300)
    assert force == pytest.approx([K * m for m in target_m], abs=1e-6)
    port = rig["tool"]
    assert port.state is PortState.HELD
    assert port.seq == rig.seq
    assert port.force_n == force
    assert port.target_m == pytest.approx(target_m)


@pytest.mark.parametrize(("law", "ticks"), [("late-cycle", 300), ("none", 80)])
def test_it_begins_at_the_device_and_goes_to_the_target_no_faster_than_told(law: str, ticks: int) -> None:
    rig = Rig(law=law)
    rig.go([0.02])
    rig.say("tool", position_m=[-0.98])
    assert rig.go() == pytest.approx([0.0], abs=1e-12)
    assert rig["tool"].target_m == [0.02]
    was_m, was_n = 0.02, 0.0
    for _ in range(ticks):
        rig.say("tool", position_m=[-0.98])
        (now_n,) = rig.go()
        (now_m,) = rig["tool"].target_m
        assert 0.0 <= was_m - now_m <= FASTEST * PERIOD_S * (1.0 + 1e-9)
        assert abs(now_n - was_n) <= FOLLOW_N + STEP_N
        assert abs(now_n) <= MOST_N
        was_m, was_n = now_m, now_n
    assert rig["tool"].force_n == pytest.approx([-MOST_N])


def test_a_target_with_a_velocity_is_followed_without_lag_and_no_further_than_hold_s() -> None:
    rig = Rig()
    for n in range(600):
        if n % 20 == 0:
            rig.say("tool", position_m=[0.2 * n * PERIOD_S], velocity_m_per_s=[0.2])
        rig.go()
    assert rig["tool"].target_m[0] == pytest.approx(0.2 * 0.6, abs=1e-6)
    held_m = rig["tool"].target_m[0]
    rig.go(ticks=500)
    assert rig["tool"].target_m[0] - held_m == pytest.approx(0.2 * (0.1 - 0.02), abs=1e-3)


def test_one_that_stands_still_between_its_words_is_made_up_for_within_twenty_ticks_and_never_passed() -> None:
    rig = Rig()
    held_at(rig, [0.0], 100)
    rig.say("tool", position_m=[1e-3])
    way = []
    for _ in range(20):
        rig.go()
        way += rig["tool"].target_m
    assert way == sorted(way)
    assert way[-1] == pytest.approx(1e-3, abs=1e-5)
    assert max(way) <= 1e-3


def test_a_client_that_is_silent_is_let_go_by_a_ramp_and_told_of_once() -> None:
    rig = Rig()
    held_at(rig, [2e-3], 300)
    assert rig.force == pytest.approx([4.0])
    assert told(rig) is None
    forces = [rig.go()[0] for _ in range(200)]
    assert forces[97] == pytest.approx(4.0)
    assert forces[99] < 4.0
    assert told(rig) is PortState.STALE
    assert forces[99 + RAMP_TICKS :] == [0.0] * (101 - RAMP_TICKS)
    falls = [before - after for before, after in pairwise(forces)]
    assert min(falls) >= -1e-9
    assert max(falls) <= 4.0 / RAMP_TICKS + 1e-9
    assert told(rig) is None
    assert rig["tool"].state is PortState.STALE
    assert rig["tool"].seq == -1


@pytest.mark.parametrize("law", ["late-cycle", "none"])
@pytest.mark.parametrize("silence", [110, 130, 149, 151, 400])
def test_it_comes_back_by_a_ramp_wherever_the_silence_ended(silence: int, law: str) -> None:
    rig = Rig(law=law)
    held_at(rig, [2e-3], 300)
    rig.go(ticks=silence)
    assert told(rig) is PortState.STALE
    (was_n,) = rig.force
    for _ in range(300):
        rig.say("tool", position_m=[2e-3])
        (now_n,) = rig.go()
        assert abs(now_n - was_n) <= STEP_N + FOLLOW_N
        was_n = now_n
    assert was_n == pytest.approx(4.0)
    assert told(rig) is PortState.HELD
    assert rig["tool"].state is PortState.HELD


def test_one_that_flaps_is_told_of_once_a_second() -> None:
    rig = Rig()
    events = []
    for n in range(6000):
        if n % 150 == 0:
            rig.say("tool", position_m=[0.0])
        rig.go()
        events.append(told(rig))
    assert 4 <= events.count(PortState.STALE) <= 6
    assert events.count(PortState.HELD) <= events.count(PortState.STALE)


STALE_AND_BACK = [PortState.STALE, PortState.HELD]


def events(rig: Rig, ticks: int, apart_ticks: int = 1) -> list[tuple[int, PortState]]:
    """What is told in these ticks, and in which of them, on a device whose samples are so far apart."""
    found = []
    for n in range(ticks):
        rig.repeat() if n % apart_ticks else rig.go(dt_s=apart_ticks * PERIOD_S)
        if (news := told(rig)) is not None:
            found.append((n, news))
    return found


@pytest.mark.parametrize("apart_ticks", [1, 10])
def test_a_silence_that_came_too_soon_to_be_told_is_told_a_second_after_the_last_one(apart_ticks: int) -> None:
    """The last that was heard of a client that had died for good was that it is in force again."""
    rig = Rig(nominal_rate_hz=1000.0 / apart_ticks)
    found = []
    for ticks in (300, 5000):
        rig.say("tool", position_m=[1e-3])
        found.append(events(rig, ticks, apart_ticks))
    first, then = found
    assert [state for _, state in first] == [PortState.STALE]
    assert [state for _, state in then] == [PortState.HELD, PortState.STALE]
    assert 300 + then[1][0] - first[0][0] == pytest.approx(1000, abs=2)
    assert rig["tool"].state is PortState.STALE
    assert not any(channel.awake for channel in rig["tool"].channels), "and then it costs nothing"


def test_a_silence_that_is_still_to_be_told_is_told_of_a_device_that_was_found_again_too() -> None:
    rig = Rig()
    for ticks in (300, 150):
        rig.say("tool", position_m=[1e-3])
        states = [state for _, state in events(rig, ticks)]
    assert states == [PortState.HELD]
    rig.tick.start(rig.sample)
    assert rig["tool"].state is PortState.IDLE
    assert [state for _, state in events(rig, 1500)] == [PortState.STALE]


@pytest.mark.parametrize("apart_ticks", [1, 10])
def test_of_a_client_that_speaks_seldom_each_silence_is_told_at_once(apart_ticks: int) -> None:
    """A second is one of the loop's, whether anything is in force or not."""
    rig = Rig(nominal_rate_hz=1000.0 / apart_ticks)
    rig.say("tool", position_m=[1e-3])
    events(rig, 1300, apart_ticks)
    for _ in range(3):
        rig.say("tool", position_m=[1e-3])
        back, stale = events(rig, 1300, apart_ticks)
        assert [back[1], stale[1]] == [PortState.HELD, PortState.STALE]
        assert back[0] == 0
        assert stale[0] == pytest.approx(100, abs=2)


def test_the_end_of_a_silence_too_is_told_once_a_second_and_only_of_one_who_is_in_force_then() -> None:
    """Silences of 50 ms, from one that was told 1.05 s before the next is."""
    for released in (False, True):
        rig = Rig()
        found = []
        at = 0
        for talks, ticks in ((True, 10), (False, 1050), (True, 10), (False, 150)):
            for _ in range(ticks):
                if talks:
                    rig.say("tool", position_m=[1e-3])
                found += [(at + n, state) for n, state in events(rig, 1)]
                at += 1
        assert [state for _, state in found] == [PortState.STALE, PortState.HELD, PortState.STALE]
        for n in range(1500):
            if n < 700 or not released:
                rig.say("tool", position_m=[1e-3])
            elif n == 700:
                rig.say("tool", released=True)
            found += [(at + n, state) for n, state in events(rig, 1)]
            at += 1
        assert len(found) == (3 if released else 4)
        if not released:
            assert found[3][0] - found[1][0] == pytest.approx(1000, abs=2)


def test_time_goes_on_for_the_end_of_a_silence_after_its_client_has_let_go() -> None:
    rig = Rig()
    rig.say("tool", position_m=[1e-3])
    events(rig, 900)
    rig.say("tool", position_m=[1e-3])
    rig.go()
    assert told(rig) is PortState.HELD
    rig.say("tool", released=True)
    rig.go(ticks=5000)
    found = []
    for ticks in (150, 50):
        rig.say("tool", position_m=[1e-3])
        found += events(rig, ticks)
    assert found == [(pytest.approx(100, abs=2), PortState.STALE), (0, PortState.HELD)]


def test_a_client_of_a_device_that_has_had_nothing_new_since_is_told_of_all_the_same() -> None:
    rig = Rig(nominal_rate_hz=1.0)
    rig.say("tool", position_m=[1e-3])
    rig.repeat(150)
    assert rig["tool"].asleep
    assert told(rig) is PortState.STALE


def test_a_port_whose_event_is_not_due_yet_asks_no_law_and_pulls_at_nothing() -> None:
    rig = Rig(axes="xyz")
    held_at(rig, [1e-3, 0.0, 0.0], 20)
    rig.go(ticks=200)
    port = rig["tool"]
    assert port.asleep
    for channel in port.channels:
        channel.law.step = None
    for n in range(300):
        assert rig.go([0.01 * math.sin(0.1 * n), 0.0, 0.0]) == [0.0] * 3
    assert rig.tick.fault == 0
    assert rig.tick.totals().ledger.stored_j == 0.0


def test_who_is_back_before_the_loop_has_told_of_a_silence_is_told_of_after_it() -> None:
    rig = Rig()
    held_at(rig, [1e-3], 10)
    rig.go(ticks=101)
    found = []
    for _ in range(3):
        rig.say("tool", position_m=[1e-3])
        found.append(told(rig))
        rig.go()
    assert found == [*STALE_AND_BACK, None]


def test_a_client_that_lets_go_is_no_matter_of_an_event() -> None:
    rig = Rig()
    held_at(rig, [2e-3], 300)
    rig.say("tool", released=True)
    forces = [rig.go()[0] for _ in range(RAMP_TICKS)]
    assert forces[0] == pytest.approx(4.0 * (1.0 - 1.0 / RAMP_TICKS))
    assert forces[-1] == pytest.approx(0.0, abs=1e-9)
    rig.go(ticks=5)
    assert rig["tool"].state is PortState.RELEASED
    assert told(rig) is None
    assert rig.force == [0.0]


def test_stiffness_and_damping_go_over_by_a_ramp_and_no_further_than_the_file_allows() -> None:
    rig = Rig()
    held_at(rig, [2e-3], 300)
    (was_n,) = rig.force
    for _ in range(100):
        rig.say("tool", position_m=[2e-3], stiffness_n_per_m=500.0, damping_n_s_per_m=0.0)
        (now_n,) = rig.go()
        assert abs(now_n - was_n) <= 2e-3 * 1500.0 / RAMP_TICKS + 1e-9
        was_n = now_n
    assert rig.force == pytest.approx([1.0])
    for _ in range(100):
        rig.say("tool", position_m=[2e-3], stiffness_n_per_m=1e6, damping_n_s_per_m=1e6)
        rig.go()
    assert rig.force == pytest.approx([4.0])
    assert rig["tool"].damping.now == B


def test_a_disarmed_device_has_no_force_and_after_arming_it_comes_in_by_the_ramp() -> None:
    rig = Rig(arm=False)
    assert held_at(rig, [2e-3], 200) == [0.0]
    assert rig.tick.arm()
    (was_n,) = rig.force
    for _ in range(100):
        (now_n,) = held_at(rig, [2e-3], 1)
        assert abs(now_n - was_n) <= 2.0 * MOST_N / RAMP_TICKS
        was_n = now_n
    assert was_n == pytest.approx(4.0)
    rig.tick.release()
    forces = [held_at(rig, [2e-3], 1)[0] for _ in range(RAMP_TICKS)]
    assert forces == sorted(forces, reverse=True)
    assert forces[-1] == pytest.approx(0.0, abs=1e-9)
    assert held_at(rig, [2e-3], 10) == [0.0]


def test_a_device_that_knows_its_place_again_waits_for_the_clients_next_word() -> None:
    """What it was told before was told of another place, perhaps."""
    rig = Rig()
    held_at(rig, [2e-3], 300)
    rig.go([math.nan], ticks=20)
    assert rig.force == [0.0]
    rig.at = [0.0]
    rig.tick.guard.clear()
    rig.go(ticks=5)
    assert rig.tick.arm()
    assert rig.go(ticks=50) == [0.0]
    assert rig["tool"].state is PortState.IDLE
    assert held_at(rig, [2e-3], 300) == pytest.approx([4.0])


def test_where_the_device_has_nothing_new_its_client_grows_old_all_the_same() -> None:
    rig = Rig(nominal_rate_hz=100.0)
    held_at(rig, [2e-3], 300)
    forces = [rig.repeat()[0] for _ in range(90)]
    assert forces == pytest.approx([4.0] * 90)
    forces = [rig.repeat()[0] for _ in range(90)]
    assert forces[7] == pytest.approx(4.0)
    assert forces[9] < 4.0
    assert forces[-1] == pytest.approx(0.0, abs=1e-9)
    assert max(abs(a - b) for a, b in pairwise(forces)) <= 4.0 / RAMP_TICKS + 1e-9


def test_the_limit_holds_for_the_vector_and_for_what_the_law_adds() -> None:
    rig = Rig(law="damper", axes="xyz")
    for n in range(400):
        rig.say("tool", position_m=[0.01, -0.01, 0.01])
        rig.go([0.004 * math.sin(0.9 * n), 0.003 * math.cos(1.3 * n), 0.0])
        assert length(rig.force) <= MOST_N
    assert length(rig.force) > 0.9 * MOST_N


def test_beside_a_wall_both_pull_and_the_books_balance() -> None:
    rig = Rig(COUPLING + WALL, law="energy-cycle")
    for n in range(2000):
        rig.say("tool", position_m=[4e-3 * math.sin(0.02 * n)])
        rig.go([1e-3 * math.sin(0.05 * n)])
    assert rig.unbalanced_j() < 1e-9
    assert rig.tick.contacts[0].ledger.energy_j != 0.0
    assert rig["tool"].work_j != 0.0


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


def test_a_law_that_fails_leaves_the_fallback_and_the_force_goes() -> None:
    rig = Rig(law="tests.tick.remote.failing_law")
    held_at(rig, [2e-3], 100)
    assert rig.tick.fault
    assert "law tests.tick.remote.failing_law: " in rig.tick.fault_text
    held_at(rig, [2e-3], 100)
    assert rig.force == [0.0]


@pytest.mark.parametrize("axes", ["x", "xyz"])
def test_a_scene_without_ports_runs_no_line_of_theirs(axes: str) -> None:
    rig = Rig(WALL, axes=axes)
    at = [-1e-3] + [0.0] * (len(axes) - 1)
    rig.go(at, ticks=20)
    rig.sample.time_ns += 1_000_000
    run = operations_by_code(partial(rig.tick.advance, rig.sample, PERIOD_S))
    assert not [code.co_qualname for code in run if "remote" in code.co_filename]


def test_a_port_that_no_client_drives_costs_a_comparison_an_axis() -> None:
    def cost(scene: str) -> int:
        rig = Rig(scene, axes="xyz")
        rig.go([-1e-3, 0.0, 0.0], ticks=20)
        rig.sample.time_ns += 1_000_000
        return count_operations(partial(rig.tick.advance, rig.sample, PERIOD_S))

    without = cost(WALL)
    assert cost(WALL + COUPLING) - without <= 3 * 35


def test_one_that_was_let_go_costs_no_more_than_one_that_no_client_has_driven() -> None:
    rig = Rig(axes="xyz")
    assert not any(channel.awake for channel in rig["tool"].channels)
    held_at(rig, [1e-3, 0.0, 0.0], 20)
    assert all(channel.awake for channel in rig["tool"].channels)
    rig["tool"].take(update(rig.seq + 1, released=True))
    rig.go(ticks=RAMP_TICKS + 5)
    assert not any(channel.awake for channel in rig["tool"].channels)
    assert rig["tool"].asleep


def test_the_impulse_is_the_sum_of_the_forces_that_were_held() -> None:
    rig = Rig(axes="xyz")
    sums = [0.0] * 3
    for n in range(300):
        if n < 150:
            rig.say("tool", position_m=[1e-3, 2e-3, 0.0])
        sums = [have + newton * PERIOD_S for have, newton in zip(sums, rig.force, strict=True)]
        rig.go()
        if n % 7 == 0:
            assert apart(rig["tool"].impulse_n_s, sums) < 1e-12
    assert length(sums) > 0.1


@pytest.mark.parametrize("driven", [False, True])
def test_damping_against_the_ground_pulls_at_no_target(driven: bool) -> None:
    """A client moves its body by the impulse: a damper between the two is felt there, one against the ground is not."""
    rig = Rig(COUPLING.replace("damping_n_s_per_m = 5.0", f"driven = {str(driven).lower()}"), law="damper")
    held_at(rig, [0.0], 100)
    before, spring = rig["tool"].impulse_n_s[0], 0.0
    for n in range(1, 20):
        rig.say("tool", position_m=[0.0])
        rig.go([1e-5 * n])
        spring += -2000.0 * 1e-5 * n * PERIOD_S
    rig.go()
    pulled = rig["tool"].impulse_n_s[0] - before
    assert (pulled == pytest.approx(spring, rel=0.02)) is not driven


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
