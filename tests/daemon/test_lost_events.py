"""Events that the supervisor was too slow to fetch are counted and told."""

from __future__ import annotations

import signal

from hapticd.tick.event import EventCode, LoopEvent
from tests.daemon.running import Daemon, Subscriber
from tests.daemon.test_deaths import PRESSED


def test_events_that_were_overwritten_are_told_like_ticks_that_were() -> None:
    with Daemon(PRESSED).wait_ready() as daemon, Subscriber(daemon.endpoint) as subscriber:
        assert subscriber.until("hapticd/status")["event_drops"] == 0
        memory = daemon.memory()
        daemon.process.send_signal(signal.SIGSTOP)
        for number in range(400):
            memory.write_event(LoopEvent(EventCode.OVERRUN_BURST, f"burst {number}", 0, 0))
        daemon.process.send_signal(signal.SIGCONT)
        told = subscriber.until("hapticd/event", code=EventCode.RING_DROPPED)
        lost = int(str(told["text"]).removesuffix(" events were overwritten before they were published"))
        assert 400 - 256 <= lost < 400
        status = subscriber.until("hapticd/status", event_drops=lost)
        assert status["ring_drops"] == 0
        memory.close()
