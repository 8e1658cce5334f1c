"""What the loop does beside its tick: signs of life, its own lateness, what clients say, and what it writes down."""

from __future__ import annotations

import contextlib
import threading

import pytest

from hapticd import plugins
from hapticd.config.loading import parse
from hapticd.errors import DeviceFaultError, DeviceProtocolError
from hapticd.loop.memory import ANSWERED, DISARM, REQUESTS, SUPERVISOR_BEAT, RecordReader
from hapticd.loop.remote_slots import SlotWriter
from hapticd.supervisor.reload import switch_request
from hapticd.tick.event import EventCode, LoopEvent
from hapticd.tick.guard import Mode
from hapticd.tick.record import TickRecord
from tests.daemon.running import wait_until
from tests.loop.clock import Clock
from tests.loop.started import WALL, Started
from tests.loop.test_remote_slots import at

LAW = f"{WALL}[controller]\nlaw = 'none'\n"
TOOL = '[[scene.couplings]]\nname = "tool"\nstiffness_n_per_m = 100.0\nmax_force_n = 3.0\nhold_s = 0.1\n'
TOOLS = [("tool", "coupling")]


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


def test_each_tick_is_written_down_with_its_times_and_its_walls(clock: Clock) -> None:
    """One that wakes 0.25 ms late, one whose read takes 1.3 ms, and nothing of those that are skipped."""
    started = Started(clock)
    started.shared.words[SUPERVISOR_BEAT] = 1 << 62
    started.driver.sample.position_m[0] = -2e-3
    reader = RecordReader(started.shared)
    seen: list[TickRecord] = []

    def each_tick(number: int) -> None:
        seen.extend(reader.read())
        clock.pass_s(1.05e-3 if number == 10 else 0.0)
        started.driver.before_read = lambda: clock.pass_s(1.3e-3 if number == 20 else 0.2e-3)

    started.run(each_tick, 120)
    assert [record.seq for record in seen] == list(range(len(seen)))
    first_ns = seen[0].deadline_ns
    assert first_ns % 1_000_000 == 0
    assert [record.deadline_ns - first_ns for record in seen[:30]] == [
        (number + (number > 20)) * 1_000_000 for number in range(30)
    ]
    assert [record.skipped for record in seen[:30]] == [int(number > 20) for number in range(30)]
    late_us = {number: record.late_us for number, record in enumerate(seen) if record.late_us}
    assert late_us == {10: pytest.approx(250.0)}
    busy_us = [record.busy_us for record in seen]
    assert busy_us == [pytest.approx(1300.0 if number == 20 else 200.0) for number in range(len(seen))]
    assert {len(record.walls) for record in seen} == {1}
    assert seen[100].position_m == (-2e-3,)
    assert seen[100].force_n == pytest.approx((2.0,))


def told(started: Started, code: EventCode) -> list[LoopEvent]:
    return [event for event in started.told if event.code == code]


@pytest.mark.parametrize("before_s", [1.0, 0.1], ids=["from the start", "after a switch"])
def test_a_supervisor_that_shows_no_sign_of_life_is_told_each_time_and_costs_the_force(
    clock: Clock, before_s: float
) -> None:
    """After the very time that is set for it, and not at the first tick that has waited for so long."""
    text = LAW + "[safety]\nsupervisor_stall_s = {}\n"
    started = Started(clock, text=text.format(before_s))
    started.loop.requests.know("none", plugins.law("none"))
    silent = [range(100, 1400), range(1500, 2700)]
    latched: list[int] = []

    def each_tick(number: int) -> None:
        if not any(number in span for span in silent):
            started.shared.words[SUPERVISOR_BEAT] = clock.now_ns
        if started.tick.guard.latched:
            latched.append(number)
        if number == 20 and before_s != 1.0:
            started.shared.post(switch_request(started.config, parse(text.format(1.0), "patient")))
        if number == 1450:
            started.tick.guard.clear()
            started.loop.session.arm()

    started.run(each_tick, 2900)
    # The last sign of life came before tick 98, which is a millisecond later.
    assert latched[0] == 100 + 1000
    stalled = told(started, EventCode.SUPERVISOR_STALLED)
    assert [event.text for event in stalled] == ["no sign of the supervisor for 1 s"] * 2
    assert started.tick.guard.mode is Mode.DISARMED
    assert started.tick.guard.latched


def late(clock: Clock, slow: list[int], auto_arm: bool = True, simulated: bool = False) -> list[LoopEvent]:
    """Events of a loop whose reads take 10.5 ms at these ticks, so that ten deadlines are missed at each."""
    started = Started(clock, auto_arm, simulated=simulated)
    started.shared.words[SUPERVISOR_BEAT] = 1 << 62

    def each_tick(number: int) -> None:
        started.driver.before_read = lambda: clock.pass_s(10.5e-3 if number in slow else 0.0)

    started.run(each_tick, 1200)
    assert started.skipped == 10 * len(slow)
    return told(started, EventCode.LOOP_LATE)


def test_a_loop_that_misses_fifty_more_deadlines_than_it_meets_lets_go(clock: Clock) -> None:
    (event,) = late(clock, [1000, 1001, 1002, 1003, 1004])
    assert event.text == "50 more deadlines were missed than met"
    assert event.seq == 1005
    assert event.deadline_ns % 1_000_000 == 0, "it is that of its tick"
    assert late(clock, [1000, 1001, 1002, 1003, 1005]) == []
    (event,) = late(clock, [1000, 1001, 1002, 1003, 1005, 1007])
    assert event.text == "58 more deadlines were missed than met"


@pytest.mark.parametrize("rate_hz", [100, 125, 1000, 4000])
def test_fifty_milliseconds_are_as_many_at_every_rate(clock: Clock, rate_hz: int) -> None:
    """At 100 Hz it took 100 ms to let go."""
    started = Started(clock, text=f"{WALL}[loop]\nrate_hz = {rate_hz}\n")
    started.shared.words[SUPERVISOR_BEAT] = 1 << 62
    period_s = 1.0 / rate_hz
    missed_s = 0.05 + 0.5 * period_s

    def each_tick(number: int) -> None:
        started.driver.before_read = lambda: clock.pass_s({50: missed_s - period_s, 60: missed_s}.get(number, 0.0))

    started.run(each_tick, 100)
    assert [event.seq for event in told(started, EventCode.LOOP_LATE)] == [61]


@pytest.mark.parametrize("stops", [False, True], ids=["disarmed", "stopped"])
def test_a_device_that_does_not_let_go_is_given_up(clock: Clock, stops: bool) -> None:
    """Disarmed was said, and the next thing heard of it came with the end of the daemon."""
    started = Started(clock)
    started.shared.words[SUPERVISOR_BEAT] = 1 << 62
    asked: list[int] = []

    def disable() -> None:
        asked.append(started.tick_number)
        if len(asked) == 1:
            raise DeviceFaultError("the motor does not answer")

    started.driver.on_disable = disable

    def each_tick(number: int) -> None:
        if number == 50 and not stops:
            started.shared.words[DISARM] += 1

    with contextlib.nullcontext() if stops else pytest.raises(DeviceProtocolError, match="it may not have let go: the"):
        started.run(each_tick, 300)
    lost = told(started, EventCode.DEVICE_LOST)
    assert [event.text for event in lost] == ["device lost: it may not have let go: the motor does not answer"][stops:]
    assert len(asked) == 2, "it is asked once more as it is closed"
    assert (asked[0] < 200) is not stops
    assert started.driver.force_left == ""


def test_a_device_that_cannot_be_armed_and_does_not_let_go_of_what_it_has_enabled_is_given_up(clock: Clock) -> None:
    """It stayed with one motor enabled, and to disarm was answered with ok."""
    started = Started(clock)
    started.shared.words[SUPERVISOR_BEAT] = 1 << 62
    started.driver.refusal = DeviceFaultError("motor 2 refuses")
    asked: list[int] = []

    def disable() -> None:
        asked.append(started.tick_number)
        if len(asked) == 1:
            raise DeviceFaultError("motor 1 does not answer")

    started.driver.on_disable = disable
    with pytest.raises(DeviceProtocolError, match="it may not have let go: motor 1 does not answer"):
        started.run(lambda _number: None, 300)
    assert [event.text for event in told(started, EventCode.DISARMED)] == ["stays disarmed: motor 2 refuses"]
    assert len(asked) == 2, "it is asked once more as it is closed"


def test_lateness_of_a_simulated_device_or_of_one_that_is_disarmed_takes_no_force_away(clock: Clock) -> None:
    slow = [*range(1000, 1010)]
    assert late(clock, slow, simulated=True) == []
    assert late(clock, slow, auto_arm=False) == []
    assert late(clock, slow) != []


@pytest.mark.parametrize("auto_arm", [False, True], ids=["while it was disarmed", "of a force that was let go"])
def test_deadlines_that_were_missed_before_it_was_armed_take_no_force_away(clock: Clock, auto_arm: bool) -> None:
    """A computer that stood still for 5 s, and one more deadline that is missed after somebody has armed."""
    started = Started(clock, auto_arm)
    started.shared.words[SUPERVISOR_BEAT] = 1 << 62

    def each_tick(number: int) -> None:
        missed_s = {10: 5.0, 300: 1.5e-3}.get(number, 0.0)
        started.driver.before_read = lambda: clock.pass_s(missed_s)
        if number == 200:
            started.tick.guard.clear()
            assert started.loop.session.arm()

    started.run(each_tick, 400)
    assert started.skipped == 5001
    assert len(told(started, EventCode.LOOP_LATE)) == auto_arm


@pytest.mark.parametrize("switched", [False, True], ids=["from the start", "after a switch"])
def test_what_clients_drive_is_taken_and_told_when_it_is_let_go_and_when_it_is_back(
    clock: Clock, switched: bool
) -> None:
    """Once the scene has it, from whatever time on; a port that has nothing new has no event."""
    started = Started(clock, text=LAW if switched else LAW + TOOL)
    started.shared.words[SUPERVISOR_BEAT] = 1 << 62
    started.loop.requests.know("none", plugins.law("none"))
    in_force: list[tuple[int, int]] = []

    def each_tick(number: int) -> None:
        shared = started.shared
        if number == 20 and switched:
            shared.post(switch_request(started.config, parse(LAW + TOOL, "with a tool")))
        if number in (200, 201, 400):
            assert shared.words[ANSWERED] == shared.words[REQUESTS]
            said = at(1e-3, seq=number)
            said.received_ns = clock.now_ns
            SlotWriter(shared, TOOLS).write(0, said)
        if number in (202, 402):
            in_force.append((number, started.tick.ports[0].seq))

    started.run(each_tick, 450)
    assert in_force == [(202, 201), (402, 400)]
    stale, back = (told(started, code) for code in (EventCode.REMOTE_STALE, EventCode.REMOTE_BACK))
    assert [event.fields for event in stale] == [{"name": "tool"}]
    assert [event.fields for event in back] == [{"name": "tool"}]
    assert "its client is silent" in stale[0].text
    assert back[0].text == "tool: in force again"
    assert 200 + 100 <= stale[0].seq <= 200 + 102, "from when it was said, just after tick 200"
    assert 400 <= back[0].seq <= 401


def test_while_it_runs_there_is_a_thread_for_what_takes_long(clock: Clock) -> None:
    started = Started(clock)
    started.shared.words[SUPERVISOR_BEAT] = 1 << 62
    before, done = set(threading.enumerate()), threading.Event()

    def each_tick(number: int) -> None:
        if number == 20:
            started.loop.requests.worker.do(done.set)
        if number == 21:
            assert done.wait(20.0)

    started.run(each_tick, 30)
    assert done.is_set()
    wait_until(lambda: set(threading.enumerate()) <= before, "the end of the thread")
