"""What the status says of a device before the first record of a loop, and after each kind of record."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from unittest.mock import Mock

import pytest

from hapticd.config.loading import parse
from hapticd.device import DeviceInfo
from hapticd.faults.record import read_header
from hapticd.faults.store import FaultStore
from hapticd.loop.memory import SharedMemory
from hapticd.loop.resume import FROM_START
from hapticd.supervisor.child import LoopProcess
from hapticd.supervisor.events import EventLog
from hapticd.supervisor.recovery import Recovery
from hapticd.supervisor.status import StatusBuilder
from hapticd.telemetry.records import Status
from hapticd.tick.event import EventCode, LoopEvent
from hapticd.tick.flags import Flag
from hapticd.tick.record import RecordLayout, TickRecord
from tests.daemon.running import Daemon, Subscriber
from tests.daemon.test_deaths import PRESSED

# What `hapticd run` finds on its path: once systemd has been told that it is ready, it gets no processor for a while,
# and after a reload none until somebody has heard of it.
HELD_UP = """
import socket, time
from pathlib import Path
heard = Path(__file__).with_name("heard")
class Slow(socket.socket):
    reloads = 0
    def sendto(self, data, *rest):
        sent = super().sendto(data, *rest)
        Slow.reloads += b"RELOADING=1" in data
        if b"READY=1" in data:
            time.sleep(0.5)
            for _ in range(2000 * Slow.reloads):
                if heard.exists():
                    break
                time.sleep(0.01)
        return sent
socket.socket = Slow
"""

CONFIG = parse("", "lab.toml")
INFO = DeviceInfo(
    model="rig",
    serial="1",
    axes=("x",),
    max_force_n=3.0,
    resolution_m=1e-5,
    workspace_m=((-0.1, 0.1),),
    nominal_rate_hz=1000.0,
    safe_damping_n_s_per_m=5.0,
    host_silence_ms=50.0,
)


@pytest.fixture
def loop() -> Iterator[LoopProcess]:
    """A process that has said what a loop says when it is ready, and has not ticked."""
    shared = SharedMemory(RecordLayout(1, False, 8), 1000.0)
    hello = {"info": asdict(INFO), "realtime": True, "warnings": [], "accuracy": ""}
    with subprocess.Popen(["sleep", "60"]) as process:
        loop = LoopProcess(process, hello, os.dup(shared.descriptor), CONFIG)
        yield loop
        process.kill()
    loop.close()
    shared.close()


def record(flags: Flag) -> TickRecord:
    zero = (0.0,)
    return TickRecord(0, 0, 0.0, 0.0, 1e-3, 0, flags, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, zero, zero, zero, zero, (), ())


def made(status: StatusBuilder, loop: LoopProcess, recovery: Recovery) -> Status:
    return status.make(CONFIG, loop, recovery, 0, 0, (), {})


def test_a_device_is_calibrated_once_a_record_says_so_and_not_before(loop: LoopProcess) -> None:
    """T12: before the first record, a rig that did not know where it was was said to be calibrated."""
    status, recovery = StatusBuilder("default", 0, Path("/lab.toml")), Recovery(Mock(), Mock())
    assert not made(status, loop, recovery).calibrated
    status.add([record(Flag.UNCALIBRATED)])
    assert not made(status, loop, recovery).calibrated
    status.add([record(Flag(0))])
    assert made(status, loop, recovery).calibrated
    status.expect(FROM_START)
    assert not made(status, loop, recovery).calibrated, "of the loop that comes next nothing is known"


def test_a_device_that_is_lost_is_not_calibrated_until_the_next_loop_says_so(loop: LoopProcess) -> None:
    status, recovery = StatusBuilder("default", 0, Path("/lab.toml")), Recovery(Mock(), Mock())
    status.add([record(Flag.ARMED)])
    assert made(status, loop, recovery).armed
    recovery.lost, recovery.resume = True, replace(FROM_START, latched=True, law=3)
    lost = made(status, loop, recovery)
    assert (lost.calibrated, lost.armed, lost.latched, lost.law_index) == (False, False, True, 3)
    recovery.lost = False
    status.add([record(Flag(0))])
    found = made(status, loop, recovery)
    assert (found.calibrated, found.latched, found.law_index) == (True, False, 0)


def test_the_rate_is_that_of_the_ticks_and_not_of_when_they_were_fetched(
    loop: LoopProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A supervisor that gets no processor fetches the ticks of 0.6 s late, and those of 0.9 s at once."""
    status, recovery, now_s = StatusBuilder("default", 0, Path("/lab.toml")), Recovery(Mock(), Mock()), 100.0
    monkeypatch.setattr("time.monotonic", lambda: now_s)
    rates = []
    for passed_s, ticks in ((0.6, range(600)), (0.6, range(600, 700)), (0.6, range(700, 1600)), (0.6, range(0))):
        status.add([replace(record(Flag.ARMED), seq=tick, deadline_ns=tick * 1_000_000) for tick in ticks])
        now_s += passed_s
        rates.append(made(status, loop, recovery).measured_rate_hz)
    assert rates == pytest.approx([1000.0, 1000.0, 1000.0, 0.0])


def test_a_fault_after_a_suspend_has_the_time_that_the_clock_tells_then(loop: LoopProcess, tmp_path: Path) -> None:
    """S10: status and fault records went on by the clock of the start."""
    status = StatusBuilder("default", 0, Path("/lab.toml"))
    event_log = EventLog("default", Mock(), status, tmp_path, 0)
    status.follow_clock(3_600_000_000_000)
    event_log.follow_clock(3_600_000_000_000)
    event_log.tell(LoopEvent(EventCode.OVER_SPEED, "too fast", 0, 2_000_000_000), CONFIG, loop)
    assert event_log.recorder.close(5, 10.0) == ""
    (path,) = FaultStore(tmp_path).paths()
    assert read_header(path)["event"]["timestamp"] == 3602.0
    assert made(status, loop, Recovery(Mock(), Mock())).fault_timestamp == 3602.0


def test_who_comes_once_it_is_ready_finds_no_status_of_before_the_first_tick(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(HELD_UP)
    with Daemon(PRESSED, pythonpath=tmp_path) as daemon:
        daemon.wait_ready()
        with Subscriber(daemon.endpoint, "hapticd/status") as subscriber:
            _, first = next(subscriber.maps())
    assert first["armed"]
    assert first["ticks"] > 0


def test_sighup_reloads_as_well_and_the_status_tells_of_it_when_systemd_hears_that_all_is_ready(tmp_path: Path) -> None:
    """Who came then found the law before in the status."""
    (tmp_path / "sitecustomize.py").write_text(HELD_UP)
    with Daemon(PRESSED, pythonpath=tmp_path).wait_ready() as daemon:
        with Subscriber(daemon.endpoint, "hapticd/status") as subscriber:
            next(subscriber.maps())
            daemon.config.write_text(PRESSED + '[controller]\nlaw = "tdpa"\n')
            daemon.process.send_signal(signal.SIGHUP)
            daemon.notified("READY=1")
            laws = (status["law"] for _, status in subscriber.maps(8.0))
            told = next((law for law in laws if law == "tdpa"), "")
        (tmp_path / "heard").touch()
    assert told
