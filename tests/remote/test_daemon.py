"""Real clients of a real daemon: driven, told, bounded; killed, stopped, replaced, hostile."""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import re
import signal
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import msgpack
import numpy as np
import pytest
import zmq

import hapticd
from hapticd.client import ClientError, RefusedError, RemotePort
from hapticd.loop.memory import SKIPPED
from hapticd.remote.state_map import ports_of
from hapticd.tick.event import EventCode
from hapticd.tick.remote.port_state import PortState
from tests.daemon.running import Daemon, Subscriber, all_records, gone, wait_until
from tests.remote.stage import (
    CONFIG,
    HOLD_S,
    MAX_FORCE_N,
    driven,
    hold,
    other_client,
    remote_pid,
    runtime,
)

LARGEST_STEP_N = 0.5
"""In a period; the force that is let go would be more than four times that at once."""

BURSTS, BURST, PAUSE_S = 20, 100, 0.01
"""A stretch of the flood: so many times so many messages, 10,000 a second in all."""

UNDAMPED = CONFIG + '[remote]\nlaw = "none"\nlease_s = 5.0\n'
"""What a law takes is none of what is looked at here; and who has no processor for a second still sees a lease."""

FIRM = UNDAMPED.replace("damping_n_s_per_m = 5.0 }", "damping_n_s_per_m = 5.0, stiffness_n_per_m = 300.0 }")
"""A hand that is not drawn along, so that there is a force to let go of."""


@pytest.fixture(scope="module")
def daemon() -> Iterator[Daemon]:
    with Daemon(UNDAMPED) as daemon:
        yield daemon.wait_ready()


@pytest.fixture
def tool(daemon: Daemon) -> Iterator[RemotePort]:
    with driven(daemon) as tool:
        hold_at_last(tool, 0.0)  # the client of the test before may still be letting go
        yield tool


def test_a_target_is_followed_and_the_client_learns_from_which_tick_on(tool: RemotePort) -> None:
    assert (tool.kind, tool.axes, tool.limits["max_force_n"]) == ("coupling", ("x",), MAX_FORCE_N)
    hold(tool, 0.01, 400)
    state = tool.state(20.0)
    assert state.armed
    assert state.port is not None
    assert state.port.state == "held"
    assert state.port.seq == tool.seq
    assert state.port.target_m == pytest.approx((0.01,), abs=1e-4)
    assert state.position_m == pytest.approx((0.01,), abs=1e-3), "a hand that only damps is drawn along"
    assert state.ports["tool"] == state.port
    tool.change(stiffness_n_per_m=1e9)
    with pytest.raises(RefusedError, match="must be 0 to 300"):
        hold(tool, 0.01)
    with pytest.raises(ValueError, match=r"position_m = 0\.01: must be a list of numbers"):
        tool.move(0.01)  # type: ignore[arg-type]  # a number is no list
    tool.move(np.array([0.01], np.float32))  # type: ignore[arg-type]  # as simulators have it
    tool.change(stiffness_n_per_m=100.0)
    sent = tool.seq
    wait_until(lambda: (port := tool.state().port) is not None and port.seq >= sent, "the change to be in force")
    tool.close()
    for use in (tool.state, tool.mean_force_n, tool.release, lambda: tool.move([0.0])):
        with pytest.raises(ClientError, match="open it again"):
            use()


def test_the_mean_force_is_that_of_the_ticks_in_between_whatever_was_lost(daemon: Daemon, tool: RemotePort) -> None:
    hold(tool, -0.01)
    tool.mean_force_n()
    first = tool._newest
    for _ in range(20):  # 10 ms without listening: most states are lost
        tool.move([-0.01])
        time.sleep(0.01)
    mean_n = tool.mean_force_n()
    last = tool._newest
    assert first is not None
    assert last is not None
    assert last.seq > first.seq + 100
    memory = daemon.memory()
    between = [record for record in all_records(memory) if first.seq < record.seq <= last.seq]
    memory.close()
    # Of one axis and one coupling the force on the device is the coupling's, held from each tick to the next.
    held_n = [record.force_n[0] for record in between]
    assert len(between) > 0.9 * (last.seq - first.seq)
    assert mean_n[0] == pytest.approx(sum(held_n) / len(held_n), abs=0.05 * MAX_FORCE_N)


def test_a_mean_force_has_nothing_of_a_sum_that_began_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was -72 N of a coupling that gives 3 N: what it had summed before it was taken away was taken off."""
    with Daemon(FIRM).wait_ready() as daemon, driven(daemon) as tool:
        monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(daemon.directory / "run"))
        hold(tool, 0.02, 1500)
        assert tool.mean_force_n()[0] > 0.5 * MAX_FORCE_N
        before = tool._newest
        with hapticd.connect() as client:
            for text in (FIRM.replace('"tool"', '"other"'), FIRM):
                daemon.config.write_text(text)
                client.reload()
        assert before is not None
        assert before.port is not None
        most_n_s = before.port.impulse_n_s[0]
        wait_until(lambda: (port := tool.state(20.0).port) is not None and port.impulse_n_s[0] < most_n_s, "a new sum")
        assert abs(tool.mean_force_n()[0]) <= MAX_FORCE_N * (1.0 + 1e-6)


def test_a_client_that_is_killed_is_told_once_let_go_without_a_step_and_replaced() -> None:
    with (
        Daemon(FIRM).wait_ready() as daemon,
        Subscriber(daemon.endpoint, "hapticd/event", "hapticd/status") as subscriber,
        driven(daemon) as other,
    ):
        subscriber.until("hapticd/status")
        with other_client(daemon, 0.02) as client:
            wait_until(lambda: other.state().ports["tool"].state == "held", "the other client to be in force")
            pressed_tick = other.state().seq + 500
            wait_until(lambda: other.state().seq >= pressed_tick, "the hand to stand where both springs leave it")
            assert abs(other.state().ports["tool"].force_n[0]) > 4.0 * LARGEST_STEP_N
            client.kill()
            killed_tick = other.state().seq
            stale = subscriber.until("hapticd/event", code=EventCode.REMOTE_STALE)
        assert stale["name"] == "tool"
        assert stale["seq"] < killed_tick + 1000
        wait_until(lambda: other.state().ports["tool"].force_n == (0.0,), "the force to be out")
        out_tick = other.state().seq
        memory = daemon.memory()
        after = [record for record in all_records(memory) if record.seq >= killed_tick]
        memory.close()
        for one, later in pairwise(after):
            periods = (later.deadline_ns - one.deadline_ns) * 1e-6
            assert abs(later.force_n[0] - one.force_n[0]) < LARGEST_STEP_N * periods
        hold(other, 0.0)  # at once: whose connection has ended has no lease
        back = subscriber.until("hapticd/event", code=EventCode.REMOTE_BACK)
        assert back["seq"] >= out_tick - 1


@pytest.mark.parametrize("dies", [True, False], ids=["a dead client", "one that stands still too"])
def test_what_has_waited_for_a_process_that_stood_still_is_not_gone_by(daemon: Daemon, dies: bool) -> None:
    """1.9 N for a client that was dead for two seconds: the message counted from when it was read."""
    with driven(daemon) as other, other_client(daemon, 0.02, 0.005, *([] if dies else ["when"])) as client:
        wait_until(lambda: other.state().ports["tool"].state == "held", "the other client to be in force")
        process = remote_pid(daemon)
        os.kill(process, signal.SIGSTOP)
        try:
            time.sleep(0.1)  # so that messages wait
            os.kill(client.pid, signal.SIGKILL if dies else signal.SIGSTOP)
            time.sleep(2.0 * HOLD_S)
        finally:
            os.kill(process, signal.SIGCONT)
        came = other.state(20.0)
        while came.deadline_ns < time.monotonic_ns() - 100_000_000:  # those of the standstill
            came = other.state(20.0)
        assert came.ports["tool"].state == "stale"
        memory = daemon.memory()
        until = came.seq + 300
        wait_until(lambda: other.state(20.0).seq > until, "the time in which it would be in force")
        after = [port.state for record in all_records(memory) if record.seq > came.seq for port in ports_of(record)]
        memory.close()
        assert set(after) == {PortState.STALE}


def test_a_softer_spring_throws_a_moving_target_back_no_more(tool: RemotePort) -> None:
    tool.move([0.0])
    wait_until(lambda: abs(tool.state(20.0).ports["tool"].target_m[0]) < 1e-4, "the target to be there")
    tool.move([0.0], [0.1])
    ways_m = []
    for turn in range(100):
        if turn % 20 == 10:
            tool.change(stiffness_n_per_m=100.0 + turn)
        ways_m.append(tool.state(20.0).ports["tool"].target_m[0])
    assert max(ways_m) > 2e-3
    assert min(later - one for one, later in pairwise(ways_m)) > -1e-5


def test_a_move_that_was_refused_moves_nothing_later(tool: RemotePort) -> None:
    """Its velocity went with the next message, without the place: the target went off by 30 mm."""
    hold_at_last(tool, 0.0)
    tool.move([math.nan], [0.1])
    with pytest.raises(RefusedError, match="position_m: must be a finite number"):
        wait_until(lambda: tool.state(20.0) is None, "the refusal")
    tool.change(stiffness_n_per_m=100.0)
    sent = tool.seq
    wait_until(lambda: tool.state(20.0).ports["tool"].seq == sent, "the change to be in force")
    assert max(abs(tool.state(20.0).ports["tool"].target_m[0]) for _ in range(100)) < 1e-4


def test_a_client_that_is_stopped_keeps_its_name_for_the_lease_and_then_loses_it(daemon: Daemon) -> None:
    with driven(daemon) as other, other_client(daemon) as client:
        wait_until(lambda: other.state().ports["tool"].state == "held", "the other client to be in force")
        os.kill(client.pid, signal.SIGSTOP)
        wait_until(lambda: other.state().ports["tool"].state == "stale", "it to be let go")
        other.move([0.0])
        with pytest.raises(RefusedError, match=f"tool belongs to user .*, process {client.pid}, until"):
            go_on(other)
        end_s = time.monotonic() + 20.0
        mine = False
        while not mine:
            assert time.monotonic() < end_s
            with contextlib.suppress(RefusedError):
                mine = other.state().ports["tool"].seq == other.seq
                other.move([0.0])
        os.kill(client.pid, signal.SIGCONT)
        moved_s = time.monotonic()
        for _ in range(300):
            held = other.state().ports["tool"].state == "held"
            assert held or time.monotonic() > moved_s + 0.5 * HOLD_S, "it was on time, and let go all the same"
            moved_s = time.monotonic()
            other.move([0.0])
        with Subscriber(daemon.endpoint, "hapticd/status") as subscriber:
            status = subscriber.until("hapticd/status", remote_owner=[f"user {os.getuid()}, process {os.getpid()}"])
        assert status["remote_refused"][0] > 0


def go_on(tool: RemotePort) -> None:
    """Say the same for 20 s: states that wait may all be read before a word is heard."""
    end_s = time.monotonic() + 20.0
    while time.monotonic() < end_s:
        tool.state(20.0)
        tool.move([0.0])


@pytest.mark.parametrize("pairs", [6, pytest.param(200, marks=[pytest.mark.nightly, pytest.mark.timeout(900)])])
def test_nothing_hostile_gets_in_or_holds_the_loop_up(daemon: Daemon, tool: RemotePort, pairs: int) -> None:
    """Of another client NaN, too much and what makes no sense, 10,000 a second; of the owner jumps of 1 m.

    In turns a stretch with the flood and one without: what a busy computer makes the loop miss falls on both.
    """
    hold(tool, 0.0)
    heard_before = refused(daemon)
    first = tool.state(20.0)
    memory = daemon.memory()
    missed: list[tuple[int, int]] = []
    with Flood(daemon) as flood:
        for pair in range(pairs):
            counts = []
            for flooded in (True, False) if pair % 2 else (False, True):
                before = memory.words[SKIPPED]
                for turn in range(BURSTS):
                    if flooded:
                        flood.send(BURST)
                    with contextlib.suppress(RefusedError):  # of the NaN before
                        tool.move([math.nan if turn == 9 else 0.5 if turn % 2 else -0.5])
                    time.sleep(PAUSE_S)
                counts.append(memory.words[SKIPPED] - before)
            missed.append((counts[pair % 2], counts[1 - pair % 2]))
        wait_until(lambda: refused(daemon) - heard_before >= 0.7 * flood.sent, "the flood to have been heard")
    hear_all_refusals(tool)
    hold_at_last(tool, 0.0)
    last = tool.state(20.0)
    assert last.port is not None
    assert last.port.state == "held"
    records = [record for record in all_records(memory) if first.seq < record.seq <= last.seq]
    memory.close()
    assert max(abs(record.force_n[0]) for record in records) <= MAX_FORCE_N + 1e-9
    assert all(port.seq <= tool.seq for record in records for port in ports_of(record)), (
        "none of the flood was in force"
    )
    calm, flooded_too = map(sum, zip(*missed, strict=True))
    worse = sum(with_it > without for without, with_it in missed)
    assert worse < 0.9 * pairs or flooded_too < 2 * calm + 3 * pairs, f"missed without and with the flood: {missed}"


def hear_all_refusals(tool: RemotePort) -> None:
    """Return when nothing that was refused is left to be told: the last of each second is, and this one is the last."""
    sent = False
    for _ in range(20_000):
        try:
            if not sent:
                tool.move([0.0])
                tool.change(stiffness_n_per_m=1e9)
                sent = True
            tool.state(20.0)
        except RefusedError as error:
            if "stiffness_n_per_m" in str(error):
                return
    raise AssertionError("the last refusal was not told")


class Flood:
    """A client of what is refused, as fast as it is told to."""

    HOSTILE = (
        {"name": "nothing", "seq": 1},
        {"name": "tool", "seq": 1 << 40, "position_m": [math.nan]},
        {"name": "tool", "seq": 1 << 40, "position_m": [0.5], "stiffness_n_per_m": 1e9},
        {"name": "tool", "seq": 1 << 40, "release": True},
    )

    def __init__(self, daemon: Daemon) -> None:
        self.sent = 0
        self._said = itertools.cycle(msgpack.packb(fields) for fields in self.HOSTILE)
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.DEALER)
        self._socket.setsockopt(zmq.SNDHWM, 0)
        self._socket.connect(f"ipc://{runtime(daemon)}/scene")

    def __enter__(self) -> Flood:
        return self

    def __exit__(self, *_: object) -> None:
        self._context.destroy(0)

    def send(self, count: int) -> None:
        """Send so many messages."""
        self.sent += count
        for _ in range(count):
            self._socket.send(next(self._said))


def test_a_subscriber_that_never_reads_costs_the_others_nothing(daemon: Daemon, tool: RemotePort) -> None:
    """Behind what waits for it, it loses ticks; one that reads gets what it got without.

    The fixture's client does not read either. A thousand ticks that wait for both take 0.4 MB; the two thousand of this
    test take 0.77 MB if all wait.
    """
    pid = remote_pid(daemon)
    hold(tool, 0.0)
    before_kb = memory_kb(pid)
    context = zmq.Context()
    stalled, reader = context.socket(zmq.SUB), context.socket(zmq.SUB)
    stalled.setsockopt(zmq.RCVHWM, 1)
    reader.setsockopt(zmq.RCVHWM, 0)
    for subscriber in (stalled, reader):
        subscriber.setsockopt(zmq.SUBSCRIBE, b"")
        subscriber.connect(f"ipc://{runtime(daemon)}/state")
    told = [heard(reader)]
    while told[-1] < told[0] + 2000:
        told.append(heard(reader))
    assert len(told) > 1600, "a busy computer may cost some, a subscriber that stands still none"
    grew_kb = memory_kb(pid) - before_kb
    got = [heard(stalled)]
    while stalled.poll(100) and got[-1] <= told[-1]:
        got.append(heard(stalled))
    context.destroy(0)
    assert len([seq for seq in got if told[0] <= seq <= told[-1]]) < len(told), "it was never too slow"
    assert grew_kb < 550


def heard(subscriber: zmq.Socket[bytes]) -> int:
    """Number of the next tick that a subscriber is told."""
    assert subscriber.poll(20_000)
    seq: int = msgpack.unpackb(subscriber.recv())["seq"]
    return seq


def memory_kb(pid: int) -> int:
    """What it has of its own; the pages of the loop's memory, of which it reads others in each tick, do not count."""
    return int(re.findall(r"^RssAnon:\s+(\d+)", Path(f"/proc/{pid}/status").read_text(), re.MULTILINE)[0])


def hold_at_last(tool: RemotePort, position_m: float) -> None:
    """Keep the target somewhere, as soon as what was said before is heard: a refusal, a client that lets go."""
    end_s = time.monotonic() + 20.0
    while time.monotonic() < end_s:
        with contextlib.suppress(RefusedError):
            tool.move([position_m])
            port = tool.state(20.0).port
            if port is not None and port.state == "held" and tool.seq - 20 < port.seq <= tool.seq:
                break
    hold(tool, position_m)


def refused(daemon: Daemon) -> int:
    with Subscriber(daemon.endpoint, "hapticd/status") as subscriber:
        status = subscriber.until("hapticd/status")
    return int(status["remote_refused"][0])


def test_a_killed_process_is_started_again_and_a_client_goes_on_by_itself(daemon: Daemon, tool: RemotePort) -> None:
    with Subscriber(daemon.endpoint, "hapticd/event", "hapticd/status") as subscriber:
        subscriber.until("hapticd/status")
        hold_at_last(tool, 0.005)
        before = remote_pid(daemon)
        os.kill(before, signal.SIGKILL)
        lost = subscriber.until("hapticd/event", code=EventCode.REMOTE_LOST)
        assert "was killed by signal 9; it is started again" in lost["text"]
        wait_until(lambda: remote_pid(daemon) not in (0, before), "another process")
        hold_at_last(tool, 0.005)
    assert gone(before)
    memory = daemon.memory()
    records = [record for record in all_records(memory) if record.seq >= lost["seq"] - 100]
    memory.close()
    states = [port.state for record in records for port in ports_of(record)]
    assert states[-1] == PortState.HELD
    assert max(abs(record.force_n[0]) for record in records) <= MAX_FORCE_N + 1e-9


def test_a_process_that_is_started_anew_throws_a_moving_target_not_back() -> None:
    """A softer spring, said after it has come back: the target went back to where it was said to be seconds before."""
    speed_m_per_s = 0.01
    config = UNDAMPED.replace(f"hold_s = {HOLD_S}", "hold_s = 10.0")
    with Daemon(config).wait_ready() as daemon, driven(daemon) as tool:
        hold_at_last(tool, 0.0)
        tool.move([0.0], [speed_m_per_s])
        sent = tool.seq
        wait_until(lambda: tool.state(20.0).ports["tool"].seq == sent, "it to be in force")
        before = remote_pid(daemon)
        os.kill(before, signal.SIGKILL)
        wait_until(lambda: remote_pid(daemon) not in (0, before), "another process")
        wait_until(lambda: tool.state(20.0).ports["tool"].target_m[0] > 2e-3, "the target to have gone on")
        tool.change(stiffness_n_per_m=100.0)
        ways_m = []
        for _ in range(1000):
            port = tool.state(20.0).ports["tool"]
            ways_m.append(port.target_m[0])
            if port.seq == tool.seq and len(ways_m) > 200:
                break
    assert port.seq == tool.seq
    assert min(later - one for one, later in pairwise(ways_m)) > -1e-5
