"""Every fault provoked on a real daemon and a device that pushes: what the device feels, what is said, the way back.

Times and forces are kept with `pytest --junit-xml`; docs/faults.md quotes them. Nothing here asserts a time of the
clock: a ramp is counted in writes to the device, which go at the rate of the loop.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import zmq

from hapticd.faults.store import FaultStore
from hapticd.tick.event import EventCode
from tests.daemon.running import Subscriber, all_records, gone, wait_until
from tests.daemon.test_deaths import nothing_left
from tests.faults.faulty_device import SILENT
from tests.faults.rig import ATTEMPTS, Felt, Report, Rig, anew_where_late, events_until

LIMIT_N = 12.0
RAMP = 50
"""Ticks of `safety.ramp_s`."""

BLIND_RAMP = 10
FROZEN = 20
BEFORE = 5000
"""Ticks before a fault that are kept of it; deadlines that a busy computer skips have none."""


def report_felt(report: Report, felt: Felt) -> None:
    report("writes_until_released", felt.writes)
    report("peak_force_n", felt.peak_n)
    report("released_after_ms", felt.gone_after_ms)


def faults(events: list[dict[str, Any]]) -> list[int]:
    """Their codes; a busy machine may add warnings of its own."""
    return [event["code"] for event in events if 200 <= event["code"] < 300]


@pytest.mark.parametrize(
    ("order", "code", "most_writes"),
    [
        ("nan", EventCode.SAMPLE_IMPOSSIBLE, BLIND_RAMP),
        ("jump", EventCode.OVER_SPEED, RAMP),
        ("frozen", EventCode.DEVICE_FROZEN, FROZEN + RAMP),
        ("slow 70", EventCode.LOOP_LATE, RAMP + 2),
    ],
)
@anew_where_late
def test_what_the_device_does_wrong_takes_the_force_out_by_a_ramp_until_cleared(
    order: str, code: EventCode, most_writes: int, record_property: Report
) -> None:
    with Rig() as rig, rig.pressed().subscriber() as subscriber:
        rig.order(order)
        events = events_until(subscriber, code)
        felt = rig.released()
        report_felt(record_property, felt)
        assert felt.writes <= most_writes
        assert felt.peak_n <= LIMIT_N
        assert subscriber.until("hapticd/status", latched=True, armed=False, releasing=False)["fault_code"] == code
        record, summary = rig.recorded(code)
        if code == EventCode.SAMPLE_IMPOSSIBLE:
            most_n = summary.force_before_n + 1e-6
            assert felt.peak_n <= most_n, "without a position the last force is let out, no more"
        assert summary.ramp_ticks is not None
        assert summary.ramp_ticks <= RAMP
        assert summary.after_s >= 0.9
        assert [after.seq - before.seq for before, after in pairwise(record.ticks)].count(1) == len(record.ticks) - 1
        rig.mend()
        refused = rig.ask("arm")
        assert not refused["ok"]
        assert "hapticd clear" in refused["text"]
        assert faults(events) == [code]
        rig.goes_on("clear", "arm")


SLOW = "end = time.monotonic() + 7e-4\n        while time.monotonic() < end: pass"


@pytest.mark.parametrize(
    ("failure", "code"), [("raise ValueError", EventCode.LAW_FAILED), (SLOW, EventCode.LAW_OVER_BUDGET)]
)
@anew_where_late
def test_a_law_that_fails_is_ramped_out_with_damping(failure: str, code: EventCode, record_property: Report) -> None:
    with Rig(laws={"bad": failure}) as rig, rig.pressed().subscriber() as subscriber:
        rig.switch('\n[controller]\nlaw = "mylab.bad"\n')
        told = faults(events_until(subscriber, code))
        assert [each for each in told if each != EventCode.LOOP_LATE] == [code]  # a busy machine is late as well
        assert subscriber.until("hapticd/status", latched=True, armed=False)
        _, summary = rig.recorded(code)
        record_property("ticks_until_released", summary.ramp_ticks)
        record_property("peak_force_n", summary.peak_force_n)
        assert summary.ramp_ticks is not None
        assert summary.ramp_ticks <= RAMP
        assert summary.peak_force_n <= LIMIT_N
        rig.switch()
        rig.goes_on("clear", "arm")


LOST = ("unplugged", "oserror", "no-write", "garbage", "hang-close")


@anew_where_late
def test_a_lost_device_is_without_force_and_comes_back_disarmed(record_property: Report) -> None:
    """All at once, since a device is looked for from one second on."""
    with contextlib.ExitStack() as stack:
        rigs = {order: stack.enter_context(Rig()) for order in LOST}
        subscribers = {order: stack.enter_context(rig.pressed().subscriber()) for order, rig in rigs.items()}
        for order, rig in rigs.items():
            rig.order(order)
        for order, rig in rigs.items():
            events = events_until(subscribers[order], EventCode.DEVICE_LOST)
            assert faults(events) == [EventCode.DEVICE_LOST], order
            felt = rig.released()
            record_property(order, str(felt))
            assert felt.writes <= 1, order
            assert felt.peak_n <= LIMIT_N
            status = subscribers[order].until("hapticd/status", armed=False)
            assert status["next_try_timestamp"] > status["device_lost_timestamp"] > 0.0
            assert not status["latched"]
            assert "no device" in status["warnings"][0]
            refused = rig.ask("arm")
            assert not refused["ok"]
            assert "no device" in refused["text"]
        for rig in rigs.values():
            rig.mend()
        for order, rig in rigs.items():
            found = subscribers[order].until("hapticd/event", code=EventCode.DEVICE_FOUND)
            last = -1
            for topic, fields in subscribers[order].maps():
                if topic == "hapticd/position":
                    assert last == -1 or fields["seq"] == last + 1
                    assert fields["force_n"] == [0.0], "a real device waits to be armed"
                    assert fields["seq"] > found["seq"]
                    last = fields["seq"]
                    if last > found["seq"] + 300:
                        break
            status = subscribers[order].until("hapticd/status")
            assert (status["device_lost_timestamp"], status["armed"]) == (0.0, False)
            rig.goes_on("arm")
            record, summary = rig.recorded(EventCode.DEVICE_LOST)
            assert (record.ticks[-1].seq, summary.after_s) == (found["seq"], 0.0)


@anew_where_late
def test_a_lost_device_that_its_loop_cannot_let_go_of_is_let_go_of_from_outside(record_property: Report) -> None:
    """It may only be silent. It kept its last force until its own watchdog, or for ever."""
    with contextlib.ExitStack() as stack:
        rigs = {order: stack.enter_context(Rig()) for order in SILENT}
        subscribers = {order: stack.enter_context(rig.pressed().subscriber()) for order, rig in rigs.items()}
        for order, rig in rigs.items():
            rig.order(order)
            events_until(subscribers[order], EventCode.DEVICE_LOST)
        for order, rig in rigs.items():
            felt = rig.released()
            record_property(order, str(felt))
            assert (felt.writes, felt.force_n) == (0, 0.0), order
            rig.mend()
        for order, rig in rigs.items():
            events_until(subscribers[order], EventCode.DEVICE_FOUND)
            rig.goes_on("arm")
            said = rig.daemon.output()
            assert ("; the device is without force" in said, "no helper" in said) == (True, False), order


@anew_where_late
def test_the_device_arms_itself_again_only_where_it_did_so_before_and_nobody_objects() -> None:
    with Rig(safety="auto_arm = true") as rig, rig.subscriber() as subscriber:
        rig.pressing()
        rig.order("unplugged")
        events_until(subscriber, EventCode.DEVICE_LOST)
        rig.mend()
        events_until(subscriber, EventCode.DEVICE_FOUND)
        assert subscriber.until("hapticd/status", device_lost_timestamp=0.0, armed=True)
        rig.pressing()
        rig.order("jump")
        events_until(subscriber, EventCode.OVER_SPEED)
        rig.order("unplugged")
        events_until(subscriber, EventCode.DEVICE_LOST)
        rig.mend()
        events_until(subscriber, EventCode.DEVICE_FOUND)
        status = subscriber.until("hapticd/status", device_lost_timestamp=0.0)
        assert (status["armed"], status["latched"]) == (False, True), "pulling the plug clears no fault"
        assert not rig.ask("arm")["ok"]
        rig.goes_on("clear", "arm")


@anew_where_late
def test_while_the_device_is_gone_commands_and_files_are_taken_for_its_return() -> None:
    with Rig(safety="auto_arm = true") as rig, rig.subscriber() as subscriber:
        rig.pressing()
        rig.order("unplugged")
        events_until(subscriber, EventCode.DEVICE_LOST)
        assert rig.ask("disarm")["ok"]
        rig.switch('\n[controller]\nlaw = "tdpa"\n')
        rig.order("swapped")
        wait_until(
            lambda: "restart hapticd to use it" in str(subscriber.until("hapticd/status")["warnings"]), "a refusal"
        )
        rig.mend()
        events_until(subscriber, EventCode.DEVICE_FOUND)
        status = subscriber.until("hapticd/status", device_lost_timestamp=0.0)
        assert (status["armed"], status["law"], status["law_index"]) == (False, "tdpa", 1)
        rig.goes_on("arm")
        rig.order("unplugged")
        events_until(subscriber, EventCode.DEVICE_LOST)
        rig.daemon.process.send_signal(signal.SIGTERM)
        assert rig.daemon.wait_exit() == 0
        assert nothing_left(rig.daemon)


@anew_where_late
def test_a_fault_of_the_devices_own_is_latched_and_the_device_opened_anew(record_property: Report) -> None:
    with Rig() as rig, rig.pressed().subscriber() as subscriber:
        rig.order("fault")
        events = events_until(subscriber, EventCode.DEVICE_FAULT)
        assert faults(events) == [EventCode.DEVICE_FAULT]
        assert "too hot" in str(events[-1]["text"])
        felt = rig.released()
        report_felt(record_property, felt)
        assert felt.writes == 0
        rig.mend()
        events_until(subscriber, EventCode.DEVICE_FOUND)
        assert subscriber.until("hapticd/status", device_lost_timestamp=0.0)["latched"]
        assert not rig.ask("arm")["ok"]
        rig.goes_on("clear", "arm")


@anew_where_late
def test_a_device_that_hangs_is_released_from_outside_and_the_service_ends(record_property: Report) -> None:
    with contextlib.ExitStack() as stack:
        rigs = {order: stack.enter_context(Rig()) for order in ("hang-read", "hang-write")}
        subscribers = {order: stack.enter_context(rig.pressed().subscriber()) for order, rig in rigs.items()}
        for order, rig in rigs.items():
            rig.order(order)
            events = events_until(subscribers[order], EventCode.CONTROL_LOST)
            assert faults(events) == [EventCode.CONTROL_LOST]
            felt = rig.released()
            record_property(f"{order}_released_after_ms", felt.gone_after_ms)
            assert (felt.writes, felt.force_n, felt.opened) == (0, 0.0, 1)
            assert rig.daemon.wait_exit() == 1
            assert nothing_left(rig.daemon)
            record, summary = rig.recorded(EventCode.CONTROL_LOST)
            assert (summary.after_s, summary.ticks) == (0.0, len(record.ticks))
            assert summary.ticks > 500


@anew_where_late
def test_a_device_that_nobody_can_find_again_is_not_called_one_without_force() -> None:
    """Another of its kind was let go of, the event said that all was well, and so did the answer to a disarm."""
    with Rig() as rig, rig.pressed().subscriber() as subscriber:
        rig.order("swapped")  # for whoever opens it from now on
        os.kill(rig.daemon.control_pid(), signal.SIGSTOP)
        answer = rig.ask("disarm")
        why = "the device could not be opened: found faulty 2 (x) instead of faulty 1 (x)"
        assert answer == {"ok": False, "text": f"the force may still be there: {why}; switch the device off"}
        assert str(events_until(subscriber, EventCode.CONTROL_LOST)[-1]["text"]).endswith(f"; {why}")
        assert rig.daemon.wait_exit() == 1


@anew_where_late
def test_who_disarms_a_device_that_does_not_let_go_hears_of_it() -> None:
    """`hapticd disarm` was content when the ramp began, and a 204 told of it afterwards."""
    with Rig() as rig:
        rig.pressed()
        rig.order("keeps")
        said = rig.hapticd("disarm")
        assert said.returncode == 1
        assert "the force may still be there" in said.stderr
        assert not rig.ask("stop")["ok"]
        assert rig.daemon.wait_exit() == 1, "as where it was stopped before that was known"


@anew_where_late
def test_who_stops_a_daemon_whose_device_is_back_hears_nothing_of_the_force_before_it_was_lost() -> None:
    """For as long as that daemon ran, every stop was refused: the force may still be there."""
    with Rig() as rig, rig.pressed().subscriber() as subscriber:
        rig.order("keeps")
        assert not rig.ask("disarm", wait=True)["ok"]
        rig.mend()
        events_until(subscriber, EventCode.DEVICE_FOUND)
        assert rig.ask("stop") == {"ok": True, "text": ""}
        assert rig.daemon.wait_exit() == 0


@anew_where_late
def test_who_disarms_a_device_that_lets_go_hears_so_once_it_has() -> None:
    with Rig(safety="ramp_s = 0.5") as rig:
        rig.pressed()
        rig.order("")
        assert rig.hapticd("disarm").returncode == 0
        assert rig.felt().force_n == 0.0
        assert rig.hapticd("disarm").returncode == 0, "it is disarmed already"


@anew_where_late
def test_who_stops_a_daemon_whose_lost_loop_hangs_hears_what_became_of_the_force() -> None:
    with Rig() as rig, rig.pressed().subscriber() as subscriber:
        rig.order("hang-disable")
        events_until(subscriber, EventCode.DEVICE_LOST)
        rig.order("swapped")  # for whoever opens it from now on
        why = "the device could not be opened: found faulty 2 (x) instead of faulty 1 (x)"
        assert rig.ask("stop") == {"ok": False, "text": f"the force may still be there: {why}; switch the device off"}
        assert rig.daemon.wait_exit() == 1
        assert why in rig.daemon.output()


@anew_where_late
def test_a_helper_that_was_killed_is_replaced_when_it_is_needed_and_outlives_nobody() -> None:
    with contextlib.ExitStack() as stack:
        first, second = (stack.enter_context(Rig()).pressed() for _ in range(2))
        with first.subscriber() as subscriber:
            os.kill(helper_of(first), signal.SIGKILL)
            os.kill(first.daemon.control_pid(), signal.SIGKILL)
            event = events_until(subscriber, EventCode.CONTROL_LOST)[-1]
            assert event["text"].endswith("the device is without force")
        helper = helper_of(second)
        second.daemon.process.kill()
        wait_until(lambda: gone(helper), "the helper to end")


@anew_where_late
def test_that_nobody_stands_by_to_release_the_device_is_told_and_the_loop_goes_on() -> None:
    with Rig() as rig, rig.pressed().subscriber() as subscriber:
        assert subscriber.until("hapticd/status")["warnings"] == []
        os.kill(helper_of(rig), signal.SIGKILL)
        event = subscriber.until("hapticd/event", code=EventCode.HELPER_MISSING)
        status = subscriber.until("hapticd/status")
        assert status["warnings"][0] == event["text"]
        assert (status["armed"], status["fault_code"]) == (True, 0)


def helper_of(rig: Rig) -> int:
    """The process that stands by to release the device."""
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            if (
                parent == rig.daemon.process.pid
                and b"hapticd.supervisor.force_release" in (entry / "cmdline").read_bytes()
            ):
                return int(entry.name)
    raise AssertionError("there is no helper")


@anew_where_late
def test_a_supervisor_that_stalls_takes_the_force_out(record_property: Report) -> None:
    with Rig(safety="supervisor_stall_s = 0.3") as rig, rig.pressed().subscriber() as subscriber:
        memory = rig.daemon.memory()
        rig.daemon.process.send_signal(signal.SIGSTOP)
        wait_until(lambda: all_records(memory)[-1].flags & 8, "the fault")
        records = all_records(memory)
        at = next(index for index, record in enumerate(records) if record.flags & 8)
        wait_until(lambda: all_records(memory)[-1].seq > records[at].seq + RAMP, "the ramp")
        ramp = [abs(record.force_n[0]) for record in all_records(memory) if record.seq >= records[at].seq]
        record_property("ticks_until_released", ramp.index(0.0))
        record_property("peak_force_n", max(ramp))
        assert ramp.index(0.0) <= RAMP
        rig.daemon.process.send_signal(signal.SIGCONT)
        assert faults(events_until(subscriber, EventCode.SUPERVISOR_STALLED)) == [EventCode.SUPERVISOR_STALLED]
        rig.recorded(EventCode.SUPERVISOR_STALLED)
        memory.close()
        rig.goes_on("clear", "arm")


@anew_where_late
def test_a_burst_of_missed_deadlines_is_a_warning_and_one_event(record_property: Report) -> None:
    with Rig() as rig, rig.pressed().subscriber() as subscriber:
        rig.order("slow 20")
        event = subscriber.until("hapticd/event", code=EventCode.OVERRUN_BURST)
        record_property("skipped", event["skipped"])
        assert 10 <= event["skipped"] < 50
        rig.mend()
        assert subscriber.until("hapticd/status", armed=True)["fault_code"] == 0
        assert not (rig.daemon.directory / "state/default/faults").exists(), "a warning is no fault to keep a record of"


@anew_where_late
def test_records_reach_back_five_seconds_and_the_oldest_goes_first() -> None:
    with Rig(more="[faults]\nkeep = 1") as rig, rig.pressed().subscriber() as subscriber:
        for topic, fields in subscriber.maps():
            if topic == "hapticd/position" and fields["seq"] > 5500:
                break
        names: list[str] = []
        for _ in range(2):
            rig.order("jump")
            subscriber.until("hapticd/event", code=EventCode.OVER_SPEED)
            wanted = len(names) + 1
            wait_until(lambda wanted=wanted: subscriber.until("hapticd/status")["fault_records"] == wanted, "a record")
            record, summary = rig.recorded(EventCode.OVER_SPEED)
            names.append(record.name)
            first, fault, last = (record.ticks[at] for at in (0, BEFORE, -1))
            assert (fault.deadline_ns, last.seq - fault.seq) == (record.fault_ns, 1000)
            assert summary.before_s == pytest.approx(5.0 + 1e-3 * (fault.skipped - first.skipped), abs=0.1)
            assert summary.after_s == pytest.approx(1.0 + 1e-3 * (last.skipped - fault.skipped), abs=0.1)
            rig.mend()
            rig.goes_on("clear", "arm")
        kept = FaultStore(rig.daemon.directory / "state" / "default" / "faults").paths()
        assert [path.stem for path in kept] == names[1:]
        listed = rig.hapticd("fault", "list").stdout.splitlines()
        assert [line.split()[0] for line in listed] == names[1:]
        assert record.header["config"]["text"] == rig.config
        assert subscriber.until("hapticd/status")["ring_drops"] == 0, "writing records cost the drain nothing"


@pytest.mark.skipif(os.geteuid() != 0 or shutil.which("unshare") is None, reason="needs root and util-linux's unshare")
@anew_where_late
def test_a_full_disk_costs_the_record_and_nothing_else() -> None:
    mount = 'mkdir -p "$HAPTICD_STATE_DIR" && mount -t tmpfs -o size=64k tmpfs "$HAPTICD_STATE_DIR" && exec "$@"'
    with Rig(prefix=("unshare", "--mount", "sh", "-c", mount, "sh")) as rig, rig.pressed().subscriber() as subscriber:
        for topic, fields in subscriber.maps():
            if topic == "hapticd/position" and fields["seq"] > 3000:
                break
        rig.order("jump")
        events_until(subscriber, EventCode.OVER_SPEED)
        event = subscriber.until("hapticd/event", code=EventCode.FAULT_RECORD_FAILED)
        assert "No space left on device" in event["text"]
        inside = Path(f"/proc/{rig.daemon.process.pid}/root{rig.daemon.directory}/state/default/faults")
        assert list(inside.iterdir()) == [], "half a record is none"
        rig.mend()
        rig.goes_on("clear", "arm")
        assert subscriber.until("hapticd/status")["ring_drops"] == 0


def test_a_flood_of_subscriptions_costs_no_tick_and_is_told_once(record_property: Report) -> None:
    for _ in range(ATTEMPTS):
        told, status = flooded()
        codes = [event["code"] for event in told if event["code"] != EventCode.OVERRUN_BURST]
        if EventCode.LOOP_LATE not in codes:
            break
    record_property("subscriptions", [event.get("subscriptions") for event in told])
    assert codes == [EventCode.SUBSCRIBER_FLOOD], told
    assert (status["ring_drops"], status["armed"]) == (0, True)


def flooded() -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """What a daemon tells while subscriptions flood it, and its status after that."""
    with Rig() as rig, rig.pressed().subscriber("hapticd/position", "hapticd/event") as observer:
        context = zmq.Context()
        flood = [context.socket(zmq.SUB) for _ in range(20)]
        for socket in flood:
            socket.setsockopt(zmq.RCVHWM, 10)
            socket.connect(rig.daemon.endpoint)
        end_s = time.monotonic() + 3.0
        while time.monotonic() < end_s:
            for socket in flood:
                for _ in range(10):
                    socket.setsockopt(zmq.SUBSCRIBE, b"hapticd/status")
                    socket.setsockopt(zmq.UNSUBSCRIBE, b"hapticd/status")
        for socket in flood:
            socket.close(0)
        context.term()
        told = []
        last = -1
        until = rig_seq(rig) + 500
        for topic, fields in observer.maps():
            if topic == "hapticd/event":
                told.append(fields)
            else:
                assert last in (-1, fields["seq"] - 1), "a flood of others costs this subscriber nothing"
                last = fields["seq"]
                if last > until:
                    break
        with rig.subscriber("hapticd/status") as subscriber:
            return told, subscriber.until("hapticd/status")


def rig_seq(rig: Rig) -> int:
    with Subscriber(rig.daemon.endpoint, "hapticd/position") as subscriber:
        return int(next(subscriber.maps())[1]["seq"])


def test_a_loop_without_real_time_says_so() -> None:
    with Rig(more='[loop]\nrealtime = "off"') as rig:
        wait_until(lambda: "not real-time" in rig.daemon.output(), "the line in the log")
