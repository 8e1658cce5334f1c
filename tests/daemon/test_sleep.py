"""A computer that slept: the clocks of the loop stood still and saw nothing, and a hand may be anywhere."""

from __future__ import annotations

from pathlib import Path

import pytest

from hapticd.client.commands import command
from hapticd.supervisor.sleep import SleepWatch
from hapticd.tick.event import EventCode
from tests.daemon.running import Daemon, Subscriber, wait_until
from tests.daemon.test_deaths import PRESSED, pressing
from tests.faults.rig import events_until

# What `hapticd run` finds on its path: a computer that has slept for as long as a file says.
SLEPT = """
import pathlib, time
real_ns = time.clock_gettime_ns
def clock_gettime_ns(clock):
    slept_s = float(pathlib.Path(__file__).with_name("slept").read_text()) if clock == time.CLOCK_BOOTTIME else 0.0
    return real_ns(clock) + int(1e9 * slept_s)
time.clock_gettime_ns = clock_gettime_ns
"""


def test_a_computer_that_slept_goes_on_disarmed_until_it_is_armed_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sitecustomize.py").write_text(SLEPT)
    slept = tmp_path / "slept"
    slept.write_text("7")  # before the daemon was started
    with Daemon(PRESSED, pythonpath=tmp_path) as daemon:
        daemon.wait_ready()
        monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(daemon.directory / "run"))
        pressing(daemon)
        with Subscriber(daemon.endpoint, "hapticd/event", "hapticd/status") as subscriber:
            assert subscriber.until("hapticd/status")["armed"]
            slept.with_suffix(".new").write_text("10")
            slept.with_suffix(".new").replace(slept)
            events_until(subscriber, EventCode.DISARMED)
            assert subscriber.until("hapticd/status", armed=False, releasing=False)
            wait_until(lambda: "slept for 3.0 s" in daemon.output(), "the log")
            command("arm")
            assert subscriber.until("hapticd/status", armed=True)
            assert daemon.output().count("slept") == 1


def test_time_without_a_processor_is_no_sleep(monkeypatch: pytest.MonkeyPatch) -> None:
    """It passes between the readings of the two clocks, now and then."""
    now_ns = 10**12
    held_up_ns = iter([0] * 16 + [0, 3 * 10**9, 0, 0, 2 * 10**8, 0])

    def monotonic_ns() -> int:
        nonlocal now_ns
        now_ns += next(held_up_ns)
        return now_ns

    monkeypatch.setattr("time.clock_gettime_ns", lambda _clock: now_ns + 5 * 10**9)
    monkeypatch.setattr("time.monotonic_ns", monotonic_ns)
    watch = SleepWatch()
    assert [watch.slept_s() for _ in range(6)] == [0.0] * 6
