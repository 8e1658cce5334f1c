"""What the outbox lets through while its device takes its time; a write here ends when the test says so."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd_drivers.rig.hid_rig_outbox import MOST_WAITING, Outbox
from hapticd_drivers.scheduling import LOOK_EVERY_TICKS
from tests.daemon.running import PATIENCE_S, wait_until

GRACE_S = 0.2
"""What an outbox that gave its device back too early would need much less of [s]."""


class SlowDevice:
    """Writes one report each time it is let; `written` is what it took, in order."""

    def __init__(self) -> None:
        self.written: list[bytes] = []
        self.result = 65
        self.released = threading.Event()
        self._begun = threading.Semaphore(0)
        self._let = threading.Semaphore(0)
        self.outbox = Outbox(self._write, self.released.set)

    def _write(self, report: bytes) -> int:
        self.written.append(report)
        self._begun.release()
        assert self._let.acquire(timeout=PATIENCE_S)
        return self.result

    def stall(self) -> None:
        """Begin a write that does not end."""
        self.outbox.send_order(b"stalled")
        assert self._begun.acquire(timeout=PATIENCE_S)

    def send(self, report: bytes) -> None:
        """Send it as what its first word says: tick, order or question."""
        getattr(self.outbox, f"send_{report.split()[0].decode()}")(report)

    def go_on(self) -> None:
        """From now on every write ends at once."""
        for _ in range(1000):
            self._let.release()

    def end(self) -> None:
        self.go_on()
        self.outbox.end()
        assert self.released.is_set()


@pytest.fixture
def slow() -> Iterator[SlowDevice]:
    made = SlowDevice()
    made.stall()
    yield made
    made.end()


@pytest.mark.parametrize(
    ("sends", "written", "dropped"),
    [
        (["tick 1", "tick 2", "tick 3", "tick 4"], ["tick 4"], 3),
        (["tick", "order 1", "order 2", "tick poll"], ["order 1", "order 2", "tick poll"], 0),
        (["tick 1", "question", "question one too many", "tick 2"], ["tick 1", "question", "tick 2"], 1),
    ],
    ids=["of many forces the newest", "an order throws the force before it away", "a question replaces no force"],
)
def test_of_what_waits_for_the_device_goes_out(
    slow: SlowDevice, sends: list[str], written: list[str], dropped: int
) -> None:
    for report in sends:
        slow.send(report.encode())
    slow.end()
    assert slow.written == [b"stalled", *(report.encode() for report in written)]
    assert slow.outbox.dropped == dropped


@given(st.lists(st.sampled_from(["tick", "order", "question"]), max_size=MOST_WAITING))
def test_whatever_is_sent_arrives_in_order_with_every_order_and_the_newest_force(kinds: list[str]) -> None:
    slow = SlowDevice()
    slow.stall()
    sent = [b"%s %d" % (kind.encode(), number) for number, kind in enumerate(kinds)]
    for report in sent:
        slow.send(report)
    assert slow.written == [b"stalled"]
    slow.end()
    arrived = slow.written[1:]
    assert arrived == [report for report in sent if report in arrived]
    assert [report for report in arrived if b"order" in report] == [report for report in sent if b"order" in report]
    ticks = [at for at, kind in enumerate(kinds) if kind == "tick"]
    if ticks and "order" not in kinds[ticks[-1] :]:
        assert sent[ticks[-1]] in arrived
    assert all(not (b"tick" in first and b"order" in then) for first, then in pairwise(arrived))


def test_what_was_sent_before_the_end_still_goes_out() -> None:
    for _ in range(200):
        slow = SlowDevice()
        slow.go_on()
        slow.outbox.send_order(b"disable")
        slow.outbox.end()
        assert slow.written == [b"disable"]


def test_nothing_goes_out_after_a_write_that_failed() -> None:
    slow = SlowDevice()
    slow.result = -1
    slow.stall()
    slow.outbox.send_order(b"lost")
    slow.go_on()
    wait_until(lambda: slow.outbox.failed, "the failure")
    slow.outbox.send_tick(b"nobody hears")
    slow.end()
    assert slow.written == [b"stalled"]


def test_after_a_write_that_failed_nothing_is_released_before_the_end() -> None:
    """The loop may be reading from the handle that releasing it frees."""
    slow = SlowDevice()
    slow.result = -1
    slow.stall()
    slow.go_on()
    wait_until(lambda: slow.outbox.failed, "the failure")
    slow.outbox.join(GRACE_S)
    assert slow.outbox.is_alive()
    assert not slow.released.is_set()
    slow.end()


@pytest.mark.parametrize(("send", "times"), [("send_order", 1), ("send_tick", LOOK_EVERY_TICKS + 1)])
def test_its_thread_is_scheduled_as_the_one_that_sends(slow: SlowDevice, send: str, times: int) -> None:
    thread = slow.outbox.native_id
    assert thread is not None
    before = os.sched_getscheduler(0)
    assert os.sched_getscheduler(thread) == before
    os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
    try:
        for _ in range(times):
            getattr(slow.outbox, send)(b"report")
        assert os.sched_getscheduler(thread) == os.SCHED_BATCH
    finally:
        os.sched_setscheduler(0, before, os.sched_param(0))
