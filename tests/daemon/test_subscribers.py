"""Every tick reaches every subscriber, for 20 s and nightly a minute, and one that stalls costs the others nothing."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.daemon.running import PATIENCE_S, Daemon, Subscriber
from tests.daemon.test_deaths import PRESSED

SUBSCRIBERS = 16
SCRIPT = Path(__file__).with_name("counting_subscriber.py")

KEPT_TICKS = 10_000
"""More than is kept for a stalled subscriber: 300 messages of 20 ticks, and what the kernel's buffers hold."""


@pytest.mark.parametrize("ticks", [14_000, pytest.param(60_000, marks=pytest.mark.nightly)])
def test_sixteen_subscribers_get_every_tick_while_another_is_stalled(ticks: int) -> None:
    # A low mark, so that the stalled subscriber has long been cut off at the end.
    config = PRESSED + "[telemetry]\nsend_high_water = 300\n"
    with Daemon(config).wait_ready() as daemon, Subscriber(daemon.endpoint) as observer:
        command = [sys.executable, str(SCRIPT), daemon.endpoint, str(ticks)]
        stalled = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        counting = []
        try:
            assert stalled.stdout is not None
            stalled_from = int(stalled.stdout.readline())
            stalled.send_signal(signal.SIGSTOP)
            counting += [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(SUBSCRIBERS)]
            for subscriber in counting:
                first, last, missed, backwards = counted(subscriber, ticks / 1000.0 + PATIENCE_S)
                assert last - first >= ticks
                assert (missed, backwards) == (0, 0)

            stalled.send_signal(signal.SIGCONT)
            last, missed, backwards = counted(stalled, PATIENCE_S)
            assert missed > last - stalled_from - KEPT_TICKS, "it is not kept for whoever does not take it"
            assert backwards == 0
        finally:
            for subscriber in (*counting, stalled):
                subscriber.kill()
                subscriber.communicate()
        while (status := observer.until("hapticd/status"))["seq"] < ticks:
            pass
        assert status["ring_drops"] == 0
        assert status["armed"]


def counted(subscriber: subprocess.Popen[str], patience_s: float) -> list[int]:
    """The numbers that a subscriber still has to say."""
    output, _ = subscriber.communicate(timeout=patience_s)
    return [int(word) for word in output.split()]
