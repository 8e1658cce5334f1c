"""Every tick of a minute reaches every subscriber, and one that stalls costs nobody else a thing."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

from tests.daemon.running import Daemon, Subscriber
from tests.daemon.test_deaths import PRESSED

MINUTE_TICKS = 60_000
SUBSCRIBERS = 16
SCRIPT = Path(__file__).with_name("counting_subscriber.py")


def test_sixteen_subscribers_get_every_tick_of_a_minute_while_another_is_stalled() -> None:
    # A low mark, so that the stalled subscriber has long been cut off when the minute is over.
    config = PRESSED + "[telemetry]\nsend_high_water = 100\n"
    with Daemon(config).wait_ready() as daemon, Subscriber(daemon.endpoint) as observer:
        command = [sys.executable, str(SCRIPT), daemon.endpoint, str(MINUTE_TICKS + 5000)]
        counting = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(SUBSCRIBERS)]
        stalled = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            observer.until("hapticd/status")
            stalled.send_signal(signal.SIGSTOP)
            for subscriber in counting:
                output, _ = subscriber.communicate(timeout=110)
                first, last, gaps, backwards = map(int, output.split())
                assert last - first > MINUTE_TICKS
                assert (gaps, backwards) == (0, 0)
        finally:
            for subscriber in (*counting, stalled):
                subscriber.kill()
                subscriber.communicate()
        while (status := observer.until("hapticd/status"))["seq"] < MINUTE_TICKS:
            pass
        assert status["ring_drops"] == 0
        assert status["armed"]
