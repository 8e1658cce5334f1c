"""The whole daemon on the AVR firmware: machine code on a simulated processor, a handle behind its pins, a real pty.

Protocol and safety are shown here, latency is not: a millisecond of the rig is a frame of the daemon's.
"""

from __future__ import annotations

import os
import signal
import time

import pytest

from hapticd.faults.record import read, read_header
from hapticd.tick.event import EventCode
from hapticd_drivers.rig import messages
from tests.daemon.running import PATIENCE_S, Subscriber, wait_until
from tests.drivers.rig.serial_lab import ATTEMPTS, HELD_M, PRESS_N, STIFFNESS_N_PER_M, WALL_M, Lab, on_a_board, until


@on_a_board(-0.04, "low_switch")
def test_a_rig_is_identified_homed_enabled_and_holds_a_wall(lab: Lab) -> None:
    """Its handle stands near the home switch, which is at the lower end."""
    with Subscriber(lab.daemon.endpoint, "hapticd/event", "hapticd/status") as subscriber:
        status = subscriber.until("hapticd/status")
        assert (status["device"], status["serial"], status["armed"]) == ("serial-rig", "0001", False)
        assert not status["calibrated"]
        assert any("no low-latency mode" in warning for warning in status["warnings"])
        assert "hapticd calibrate" in lab.ask("arm")

        assert any(lab.press().held() for _ in range(ATTEMPTS))
        assert lab.board.state().position_m == pytest.approx(WALL_M - PRESS_N / STIFFNESS_N_PER_M, abs=3e-4)
        assert lab.board.state().motor_n == pytest.approx(PRESS_N, rel=0.2)
        status = subscriber.until("hapticd/status", calibrated=True)
        metrics = status["device_metrics"]
        assert 0.0 < metrics["echo_us"] <= metrics["longest_echo_us"]
        assert metrics["round_trip_us"] > 0.0
    lab.daemon.process.terminate()
    assert lab.daemon.wait_exit() == 0
    assert lab.board.state().motor_n == 0.0


@on_a_board(HELD_M)
def test_the_ttl_input_is_in_the_stream_and_the_sync_output_turns_with_the_ticks(lab: Lab) -> None:
    with Subscriber(lab.daemon.endpoint, "hapticd/input") as subscriber:
        before = subscriber.until("hapticd/input", buttons=0)
        lab.board.ttl(True)
        began = subscriber.until("hapticd/input", buttons=2)
        lab.board.ttl(False)
        assert before["seq"] < began["seq"] < subscriber.until("hapticd/input", buttons=0)["seq"]
    turned = lab.board.syncs()
    wait_until(lambda: lab.board.syncs() > turned + 100, "ticks, disarmed as well")


@on_a_board(HELD_M)
def test_when_the_daemon_is_stopped_the_rig_lets_go_and_takes_no_force_until_it_is_enabled_anew(lab: Lab) -> None:
    with Subscriber(lab.daemon.endpoint, "hapticd/event", "hapticd/status") as subscriber:
        subscriber.until("hapticd/status")  # it is connected
        assert any(_hears_of_the_watchdog_once_stopped(lab, subscriber) for _ in range(ATTEMPTS))
        subscriber.until("hapticd/event", code=EventCode.DEVICE_FOUND)
        assert lab.board.state().motor_n == 0.0
        # Held up once more, it has been lost again: what it then says is that there is no device.
        wait_until(lambda: "hapticd clear" in lab.ask("arm"), "the rig to be there and to be cleared first")
        assert lab.ask("clear") == ""
        assert "push the right way" in lab.ask("arm")
        lab.press()


def _hears_of_the_watchdog_once_stopped(lab: Lab, subscriber: Subscriber) -> bool:
    """Whether the rig has told why it let go when a daemon that was stopped goes on.

    Stopped between a tick's read and its end, the loop finds its force held for too long before the rig answers, and
    disables a rig that then has nothing to tell.
    """
    control = lab.press().daemon.control_pid()
    subscriber.until("hapticd/status", armed=True)
    os.kill(lab.daemon.process.pid, signal.SIGSTOP)
    os.kill(control, signal.SIGSTOP)
    wait_until(lambda: lab.board.state().motor_n == 0.0, "the rig's watchdog")
    lab.board.hand(0.0)
    os.kill(control, signal.SIGCONT)
    os.kill(lab.daemon.process.pid, signal.SIGCONT)
    end_s = time.monotonic() + PATIENCE_S
    for topic, fields in subscriber.maps():
        assert lab.board.state().motor_n == 0.0
        if topic == "hapticd/event" and fields["code"] in (EventCode.DEVICE_LOST, EventCode.DEVICE_FAULT):
            return "watchdog heard no command for 20 ms" in fields["text"]
        if (
            topic == "hapticd/status"
            and fields["latched"]
            and not (fields["armed"] or fields["releasing"] or fields["device_lost_timestamp"])
        ):
            return False
        assert time.monotonic() < end_s, "neither rig nor loop has told of the stop"
    raise AssertionError("the daemon says nothing any more")


@on_a_board(HELD_M)
def test_a_killed_loop_leaves_no_force(lab: Lab) -> None:
    os.kill(lab.press().daemon.control_pid(), signal.SIGKILL)
    assert lab.daemon.wait_exit() == 1
    assert lab.board.state().motor_n == 0.0
    assert "the device is without force" in lab.daemon.output()
    (record,) = (path for path in lab.daemon.directory.rglob("*.fault") if "CONTROL_LOST" in str(read_header(path)))
    said = [line.split(" ", 2)[1:] for line in read(record).trace]
    assert len(said) == 200
    assert {way for way, _ in said} == {">", "<"}
    assert any(bytes.fromhex(message)[1] == messages.FORCE for way, message in said if way == ">")


@on_a_board(HELD_M)
def test_a_rig_whose_cable_is_pulled_comes_back_and_has_to_be_calibrated(lab: Lab) -> None:
    with Subscriber(lab.daemon.endpoint, "hapticd/event", "hapticd/status") as subscriber:
        subscriber.until("hapticd/status")  # it is connected
        lab.press().board.hand(0.0)
        lab.board.unplug()
        until(subscriber, "is gone", "watchdog heard no command")  # the latter where the loop was held up just then
        lab.board.plug()
        subscriber.until("hapticd/event", code=EventCode.DEVICE_FOUND)
        # Held up before the cable was pulled, the loop has been lost and found and is lost once more.
        wait_until(lambda: "hapticd calibrate" in lab.ask("arm"), "the rig to be there and not to know where it is")
        lab.press()


@on_a_board(HELD_M)
def test_a_reversed_motor_never_gets_to_push_a_wall(lab: Lab) -> None:
    lab.board.reverse_motor(True)
    before_m = lab.board.state().position_m
    end_s = time.monotonic() + 4.0 * PATIENCE_S
    while "motor_reversed" not in lab.ask("calibrate"):
        assert time.monotonic() < end_s
        time.sleep(0.2)
    assert abs(lab.board.state().position_m - before_m) < 5e-3
    assert "hapticd calibrate" in lab.ask("arm")
    assert lab.board.state().motor_n == 0.0
