"""A silent client is let go by a ramp, with one event a second at most."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from hapticd.tick.remote.port import PortState
from tests.tick.remote.rig import PERIOD_S, Rig, update
from tests.tick.remote.test_coupling import FOLLOW_N, RAMP_TICKS, STEP_N, held_at


def told(rig: Rig, name: str = "tool") -> PortState | None:
    """What the loop would tell of a port now."""
    news, rig[name].news = rig[name].news, None
    assert news is None or isinstance(news, PortState)
    return news


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


def test_another_client_that_names_no_target_keeps_none_in_force() -> None:
    """The one before was killed, and its target held the hand for as long as the other asked for a softer spring."""
    rig = Rig()
    held_at(rig, [2e-3], 300)
    for _ in range(400):
        rig.say("tool", stiffness_n_per_m=1000.0)
        rig.go()
    assert rig.force == [0.0]
    assert rig["tool"].state is PortState.STALE


def test_what_has_waited_for_longer_than_it_holds_says_nothing() -> None:
    """Its client may be dead: 1.9 N for one that was, for two seconds."""
    rig = Rig()
    rig["tool"].take(update(1, position_m=[2e-3]), 0.101)
    assert rig.go(ticks=300) == [0.0]
    assert rig["tool"].state is PortState.IDLE


def test_what_has_waited_is_let_go_so_much_sooner() -> None:
    rig = Rig()
    rig["tool"].take(update(1, position_m=[2e-3]), 0.0605)
    states = []
    for _ in range(42):
        rig.go()
        states.append(rig["tool"].state)
    assert states == [PortState.HELD] * 39 + [PortState.STALE] * 3


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
    """The events of these ticks, each with its tick; the device has a sample every `apart_ticks`."""
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
