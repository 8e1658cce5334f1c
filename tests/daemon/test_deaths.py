"""Who dies, and what follows: every row provoked on a real daemon that presses a wall."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

from hapticd.loop.memory import RECORDS
from hapticd.tick.event import EventCode
from hapticd.tick.record import TickRecord
from tests.daemon.running import Daemon, Subscriber, all_records, gone, wait_until

PRESSED = """
[device.options]
model = "omega7"
hand = { force = { profile = "constant", newton = -3.0 } }

[[scene.walls]]
stiffness_n_per_m = 12000.0
"""

ENDLESS_LAW = '''
"""A law that never returns once it has been asked 300 times in contact."""
from hapticd.law import LawParams
class Params(LawParams):
    """None."""
class State:
    """Counts."""
    asked: int
def start(state, params, snapshot):
    """Count from zero."""
def step(state, params, tick):
    """Hang at 300; the warm-up before the loop takes 200."""
    state.asked += 1
    while state.asked > 300:
        pass
    return tick.contact_n
'''


Report = Callable[[str, object], None]
"""pytest's record_property: how long a reaction took, for `pytest --junit-xml`; nothing asserts it."""


def pressing(daemon: Daemon) -> None:
    """Return when the daemon holds a force against the hand."""
    with Subscriber(daemon.endpoint, "hapticd/position") as subscriber:
        for _, fields in subscriber.maps():
            if fields["seq"] > 500 and abs(fields["force_n"][0]) > 2.0:
                return


def ramped_out(records: Sequence[TickRecord]) -> bool:
    """Whether the force went to zero and stayed there, by less than 1 N a millisecond and in more than 20 ms.

    In time and not in ticks: those of a busy computer come late, and a step that comes late is as much larger.
    """
    small = all(
        abs(after.force_n[0] - before.force_n[0]) < max(1.0, (woke_ms(after) + after.busy_us * 1e-3 - woke_ms(before)))
        for before, after in pairwise(records)
    )
    gone = next((at for at, record in enumerate(records) if record.force_n == (0.0,)), len(records))
    if not small or any(record.force_n != (0.0,) for record in records[gone:]) or gone == len(records):
        return False
    began = max((at for at, record in enumerate(records[:gone]) if record.force_n[0] >= 2.9), default=0)
    return woke_ms(records[gone]) - woke_ms(records[began]) > 20.0


def woke_ms(record: TickRecord) -> float:
    """When a tick began, on CLOCK_MONOTONIC [ms]."""
    return record.deadline_ns * 1e-6 + record.late_us * 1e-3


def nothing_left(daemon: Daemon) -> bool:
    directory = daemon.directory / "run" / "default"
    return not list(directory.iterdir()) and not daemon.control_pid()


def test_a_killed_supervisor_takes_the_force_with_it(record_property: Report) -> None:
    with Daemon(PRESSED).wait_ready() as daemon:
        pressing(daemon)
        memory = daemon.memory()
        pid = daemon.control_pid()
        killed_ns = time.monotonic_ns()
        daemon.process.kill()
        daemon.process.wait()  # an ordinary process has to have the processor once more to die
        dead_ns = time.monotonic_ns()
        wait_until(lambda: gone(pid), "the control process to end")
        record_property("exit_after_ms", (time.monotonic_ns() - killed_ns) * 1e-6)
        after = [record for record in all_records(memory) if record.deadline_ns > killed_ns]
        since_dead = sum(record.deadline_ns > dead_ns for record in after)
        assert since_dead <= 100, "at 1 kHz the force must be out within 100 ticks"
        assert ramped_out(after)
        memory.close()


def test_a_supervisor_that_sleeps_for_a_while_costs_the_loop_nothing() -> None:
    with (
        Daemon(PRESSED + "[telemetry]\nsend_high_water = 20000\n").wait_ready() as brief,  # it sends 3 s at once
        Daemon(PRESSED + "[safety]\nsupervisor_stall_s = 60.0\n").wait_ready() as long,
        Daemon(PRESSED + "[safety]\nsupervisor_stall_s = 1.0\n").wait_ready() as strict,
        Subscriber(brief.endpoint) as from_brief,
        Subscriber(long.endpoint) as from_long,
        Subscriber(strict.endpoint) as from_strict,
    ):
        for daemon in (brief, long, strict):
            pressing(daemon)
        loops = {daemon: daemon.memory() for daemon in (brief, long, strict)}
        for daemon in (brief, long, strict):
            daemon.process.send_signal(signal.SIGSTOP)
        stopped_at = {daemon: memory.words[RECORDS] for daemon, memory in loops.items()}
        wait_until(lambda: loops[brief].words[RECORDS] > stopped_at[brief] + 3000, "ticks without a supervisor")
        resumed_at = loops[brief].words[RECORDS]
        brief.process.send_signal(signal.SIGCONT)
        strict.process.send_signal(signal.SIGCONT)

        last = -1
        for topic, fields in from_brief.maps():
            if topic == "hapticd/position":
                assert last in (-1, fields["seq"] - 1), "no tick may be lost in a ring that holds eight seconds"
                last = fields["seq"]
                if last > resumed_at:
                    break
            assert topic != "hapticd/event" or fields["code"] < 200 or fields["code"] >= 300

        event = from_strict.until("hapticd/event", code=EventCode.SUPERVISOR_STALLED)
        after = [record for record in all_records(loops[strict]) if record.seq > event["seq"] + 60]
        assert after
        assert all(record.force_n == (0.0,) for record in after)

        wait_until(
            lambda: loops[long].words[RECORDS] > stopped_at[long] + loops[long].slots, "more ticks than the ring holds"
        )
        long.process.send_signal(signal.SIGCONT)
        dropped = from_long.until("hapticd/event", code=EventCode.RING_DROPPED)
        status = from_long.until("hapticd/status")
        assert dropped["text"].startswith(f"{status['ring_drops']} ticks")
        assert status["armed"]
        for memory in loops.values():
            memory.close()


def test_a_killed_control_process_ends_the_service(record_property: Report) -> None:
    with Daemon(PRESSED).wait_ready() as daemon, Subscriber(daemon.endpoint) as subscriber:
        subscriber.until("hapticd/status")
        pressing(daemon)
        pid = daemon.control_pid()
        killed_ns = time.monotonic_ns()
        os.kill(pid, signal.SIGKILL)
        event = subscriber.until("hapticd/event", code=EventCode.CONTROL_LOST)
        record_property("device_released_after_ms", (time.monotonic_ns() - killed_ns) * 1e-6)
        assert "killed by signal 9" in event["text"]
        assert "without force" in event["text"]
        assert daemon.wait_exit() == 1
        assert nothing_left(daemon)


def test_a_stopped_control_process_is_killed_and_the_device_released(record_property: Report) -> None:
    with Daemon(PRESSED).wait_ready() as daemon, Subscriber(daemon.endpoint) as subscriber:
        subscriber.until("hapticd/status")
        pressing(daemon)
        pid = daemon.control_pid()
        stopped_ns = time.monotonic_ns()
        os.kill(pid, signal.SIGSTOP)
        wait_until(lambda: gone(pid), "the control process to be killed")
        record_property("killed_after_ms", (time.monotonic_ns() - stopped_ns) * 1e-6)
        event = subscriber.until("hapticd/event", code=EventCode.CONTROL_LOST)
        record_property("device_released_after_ms", (time.monotonic_ns() - stopped_ns) * 1e-6)
        assert "stood still" in event["text"]
        assert daemon.wait_exit() == 1
        assert gone(pid)
        assert nothing_left(daemon)


def test_an_endless_law_is_a_stalled_control_process(tmp_path: Path) -> None:
    package = tmp_path / "mylab"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "endless.py").write_text(ENDLESS_LAW)
    # At normal priority: an endless real-time process would hold up the loops of the tests beside this one.
    config = PRESSED + '[loop]\nrealtime = "off"\n[controller]\nlaw = "mylab.endless"\n'
    with Daemon(config, pythonpath=tmp_path) as daemon:
        assert daemon.wait_exit() == 1
        assert "stood still" in daemon.output()
        assert "without force" in daemon.output()
        assert nothing_left(daemon)


def test_sigterm_ramps_the_force_out_and_ends_well(record_property: Report) -> None:
    with Daemon(PRESSED).wait_ready() as daemon:
        pressing(daemon)
        memory = daemon.memory()
        told_ns = time.monotonic_ns()
        daemon.process.send_signal(signal.SIGTERM)
        assert daemon.wait_exit() == 0
        record_property("exit_after_ms", (time.monotonic_ns() - told_ns) * 1e-6)
        after = [record for record in all_records(memory) if record.deadline_ns > told_ns]
        assert ramped_out(after)
        assert nothing_left(daemon)
        memory.close()


def test_an_interrupt_at_the_terminal_ends_it_as_well() -> None:
    with Daemon(PRESSED).wait_ready() as daemon:
        daemon.process.send_signal(signal.SIGINT)
        assert daemon.wait_exit() == 0
        assert nothing_left(daemon)
