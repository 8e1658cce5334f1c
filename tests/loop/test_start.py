"""What a loop begins with: where the device really is, and when it is told."""

from __future__ import annotations

import math
from typing import Any

import pytest

from hapticd import plugins
from hapticd.config.loading import parse
from hapticd.errors import DeviceFaultError
from hapticd.loop.memory import SUPERVISOR_BEAT
from hapticd.supervisor.reload import switch_request
from hapticd.tick.event import EventCode
from tests.loop.clock import Clock
from tests.loop.started import WALL, Started


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> Started:
    made = Started(Clock(monkeypatch))
    made.shared.words[SUPERVISOR_BEAT] = 1 << 62
    return made


def test_the_first_tick_finds_the_device_at_rest_where_it_is(started: Started) -> None:
    """T2: and not on the way there from the origin at 40 m/s."""
    seen: list[tuple[float, float, float]] = []
    started.driver.sample.position_m[0] = 0.04

    def each_tick(_number: int) -> None:
        motion = started.tick.motion
        seen.append((motion.position_m[0], motion.velocity_m_per_s[0], started.tick.contacts[0].x_m))

    started.run(each_tick, 3)
    assert seen == [(0.04, 0.0, 0.04)] * len(seen)
    assert len(seen) > 3
    assert [event.code for event in started.told][:2] == [EventCode.STARTED, EventCode.ARMED]


@pytest.mark.parametrize("at_m", [math.nan, 7.0])
def test_an_impossible_first_sample_is_a_fault_also_of_a_disarmed_device(
    monkeypatch: pytest.MonkeyPatch, at_m: float
) -> None:
    """T2."""
    started = Started(Clock(monkeypatch), auto_arm=False)
    started.shared.words[SUPERVISOR_BEAT] = 1 << 62
    started.driver.sample.position_m[0] = at_m
    started.run(lambda _number: None, 3)
    assert [event.code for event in started.told] == [EventCode.STARTED, EventCode.SAMPLE_IMPOSSIBLE]
    assert started.tick.guard.latched


def test_a_device_that_refuses_stays_disarmed_and_says_why(started: Started) -> None:
    """T3."""
    started.driver.refusal = DeviceFaultError("its button is pressed")
    started.run(lambda _number: None, 3)
    assert [event.code for event in started.told] == [EventCode.STARTED, EventCode.DISARMED]
    assert started.told[1].text == "stays disarmed: its button is pressed"


@pytest.mark.parametrize("auto_arm", [False, True])
@pytest.mark.parametrize("starts", [0, 1], ids=["where the device is", "when it is armed"])
def test_a_law_that_cannot_start_is_a_refusal_and_no_end_of_the_loop(
    monkeypatch: pytest.MonkeyPatch, starts: int, auto_arm: bool
) -> None:
    """It had started elsewhere, as loops warm up; the daemon ended, also one that had just found its device again."""
    law = plugins.law("none")
    left = iter(range(starts))

    def start(*_: object) -> None:
        if next(left, None) is None:
            raise ValueError("not here")

    started = Started(Clock(monkeypatch), auto_arm, WALL + '[controller]\nlaw = "none"\n')
    started.shared.words[SUPERVISOR_BEAT] = 1 << 62
    monkeypatch.setattr(law, "start", start)
    started.run(lambda _number: None, 3)
    _, *told = [(event.code, event.text.partition(" (")[0]) for event in started.told]
    said = f"law {law.__name__} cannot start: ValueError: not here"
    refused = [(EventCode.DISARMED, f"stays disarmed: {said}")] * auto_arm
    assert told == (refused if starts else [(EventCode.LAW_FAILED, said)])
    assert started.tick.guard.latched == (not starts)


def test_a_supervisor_that_is_silent_when_the_loop_begins_costs_the_force_as_later(started: Started) -> None:
    stall_s = started.config.config.safety.supervisor_stall_s
    started.shared.words[SUPERVISOR_BEAT] = round((started.clock.now_s - stall_s - 0.1) * 1e9)
    started.run(lambda _number: None, 3)
    assert EventCode.SUPERVISOR_STALLED in [event.code for event in started.told]
    assert started.tick.guard.latched


@pytest.mark.parametrize("begins", [0, 20], ids=["with the loop", "later"])
@pytest.mark.parametrize("missed", [49, 50])
def test_a_force_begins_without_any_deadline_missed(monkeypatch: pytest.MonkeyPatch, begins: int, missed: int) -> None:
    """Fifty at once take it away, and not one less; the one in the tick before there was a force is none of them."""
    started = Started(Clock(monkeypatch), auto_arm=begins == 0)
    started.shared.words[SUPERVISOR_BEAT] = 1 << 62
    misses = {begins - 1: 1, begins: missed}

    def each_tick(number: int) -> None:
        read_s = (misses[number] + 0.5) * 1e-3 if number in misses else 0.0
        started.driver.before_read = lambda: started.clock.pass_s(read_s)
        if number == begins > 0:
            assert started.loop.session.arm()

    started.run(each_tick, 40)
    assert started.skipped == missed + (begins > 0)
    assert (EventCode.LOOP_LATE in [event.code for event in started.told]) == (missed == 50)


@pytest.mark.parametrize("enable_s", [0.0, 2e-3, 0.02, 0.04, 0.09])
def test_a_ramp_begins_with_the_first_tick_however_long_the_device_took_to_let_forces_through(
    monkeypatch: pytest.MonkeyPatch, enable_s: float
) -> None:
    """It was counted as the ramp's: 4 N of 10 in the first tick. And from 51 ms on as a force that was held, a 209."""
    started = Started(Clock(monkeypatch), auto_arm=False)
    started.shared.words[SUPERVISOR_BEAT] = 1 << 62
    driver = started.driver
    driver.sample.position_m[0] = -0.01
    written: list[float] = []
    monkeypatch.setattr(driver, "_enable", lambda: started.clock.pass_s(enable_s))
    monkeypatch.setattr(driver, "_write", lambda force_n: written.append(force_n[0]))

    def each_tick(number: int) -> None:
        if number == 5:
            started.shared.post({"do": "arm"})

    started.run(each_tick, 100)
    assert written[:51] == pytest.approx([0.2 * tick for tick in range(51)])
    assert EventCode.LOOP_LATE not in [event.code for event in started.told]
    assert started.skipped >= int(enable_s * 1e3)


@pytest.mark.parametrize("start_s", [0.0, 2e-3, 0.02, 0.04])
@pytest.mark.parametrize(("to", "step_n"), [("stiffness_n_per_m = 2000.0", 0.1), ("stiffness_n_per_m = 200.0", -0.08)])
def test_a_ramp_of_a_switch_begins_once_its_law_has_started_however_long_that_took(
    monkeypatch: pytest.MonkeyPatch, start_s: float, to: str, step_n: float
) -> None:
    """It was counted as the ramp's: at 20 ms the force stepped by 1.9 N of 5 in the first tick, instead of 0.1."""
    started, written = holding(monkeypatch, start_s)
    wanted = parse(f'[[scene.walls]]\n{to}\n[controller]\nlaw = "none"\n', "wanted")
    switched(started, switch_request(started.config, wanted))
    first = last(written[:100], 5.0)
    assert written[first : first + 51] == pytest.approx([5.0 + step_n * tick for tick in range(51)])
    assert started.skipped >= int(start_s * 1e3)


@pytest.mark.parametrize("start_s", [0.0, 2e-3, 0.02, 0.04])
def test_a_limit_comes_down_from_then_on_as_well(monkeypatch: pytest.MonkeyPatch, start_s: float) -> None:
    """By 0.8 N of 2 in the first tick."""
    started, written = holding(monkeypatch, start_s)
    wanted = parse(f'{WALL}[controller]\nlaw = "none"\n[safety]\nmax_force_n = 3.0\n', "wanted")
    switched(started, switch_request(started.config, wanted))
    first = last(written[:100], 5.0)
    assert written[first : first + 51] == pytest.approx([5.0 - 0.04 * tick for tick in range(51)])


def test_a_release_counts_the_time_in_which_a_law_started(monkeypatch: pytest.MonkeyPatch) -> None:
    """Since the force was held: it is gone as soon as without any other request."""
    started, written = holding(monkeypatch, 0.01)
    wanted = parse(f'{WALL}[controller]\nlaw = "none"\n', "wanted")
    switched(started, switch_request(started.config, wanted), release=True)
    released_n = written[70:]
    assert released_n[:2] == pytest.approx([4.9, 4.8])
    assert sum(force_n > 0.0 for force_n in released_n) == 49 - 10


def holding(monkeypatch: pytest.MonkeyPatch, start_s: float) -> tuple[Started, list[float]]:
    """A loop that holds 5 N, under another law than one whose start takes so long; and what it will have written."""
    started = Started(Clock(monkeypatch))
    started.driver.sample.position_m[0] = -0.005
    written: list[float] = []
    monkeypatch.setattr(started.driver, "_write", lambda force_n: written.append(force_n[0]))
    law = plugins.law("none")
    monkeypatch.setattr(law, "start", lambda *_: started.clock.pass_s(start_s))
    started.loop.requests.know("none", law)
    return started, written


def last(written: list[float], held_n: float) -> int:
    """The last tick that wrote this force."""
    return max(at for at, force_n in enumerate(written) if force_n == pytest.approx(held_n))


def switched(started: Started, request: dict[str, Any], release: bool = False) -> None:
    """Run with a switch once the ramp of the arming is over, and perhaps a release right before it."""
    tick = started.tick

    def each_tick(number: int) -> None:
        started.shared.words[SUPERVISOR_BEAT] = started.clock.now_ns
        if number == 70:
            started.shared.post(request)
            if release:
                tick.release()

    started.run(each_tick, 200)
    assert EventCode.SWITCHED in [event.code for event in started.told]
    assert EventCode.LOOP_LATE not in [event.code for event in started.told]


def test_an_event_before_the_first_tick_has_the_time_that_it_is(started: Started) -> None:
    """T3."""
    now_ns = started.clock.now_ns
    started.run(lambda _number: None, 3)
    assert [event.deadline_ns >= now_ns for event in started.told] == [True] * len(started.told)
    assert len(started.told) >= 2


def test_deadlines_that_are_missed_at_once_are_told_and_once_a_second(started: Started) -> None:
    """Ten or more of them; of the others the count tells."""
    late_ms = {20: 9.5, 120: 10.5, 320: 14.5, 1300: 12.5, 1800: 20.5}

    def each_tick(number: int) -> None:
        started.driver.before_read = lambda: started.clock.pass_s(late_ms.get(number, 0.0) * 1e-3)

    started.run(each_tick, 2000)
    bursts = [event for event in started.told if event.code == EventCode.OVERRUN_BURST]
    assert [event.fields["skipped"] for event in bursts] == [10, 12]
    assert [event.text for event in bursts] == [f"{count} deadlines were missed at once" for count in (10, 12)]
    assert started.skipped == 9 + 10 + 14 + 12 + 20
