"""No tick waits longer for its message than docs/telemetry.md says, on a clock that the test turns."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from hapticd.config.models import TelemetryConfig
from hapticd.supervisor.daemon import DRAIN_S, WAKE_NS, pause_s
from hapticd.telemetry.publisher import Publisher
from hapticd.telemetry.wire import Map, Topic
from hapticd.tick.record import TickRecord
from hapticd_bench.telemetry import synthetic_info
from tests.telemetry.sockets import ticks

PAGE = (Path(__file__).parents[2] / "docs" / "telemetry.md").read_text()
RECORDED_NS = 200_000
"""From a tick's deadline to its record."""


class Told(Publisher):
    """Keeps how many positions each message had instead of sending it."""

    sent: list[int]
    all_sent = 0

    def _send(self, topic: Topic, maps: list[Map]) -> None:
        if topic is Topic.POSITION:
            self.sent.append(len(maps))
            self.all_sent += 1


@pytest.fixture
def publisher() -> Iterator[Told]:
    publisher = Told(TelemetryConfig(ipc=False), None, synthetic_info(), 0)
    publisher.sent = []
    yield publisher
    publisher.close()


def waits_ms(publisher: Told, records: Sequence[TickRecord], turns: random.Random) -> list[float]:
    """How long each tick waited when every turn comes late by up to `WAKE_NS`, its own work included [ms]."""
    now_ns = turns.randrange(10_000_000)
    fetched = 0
    deadlines: list[int] = []
    waits = []
    while fetched < len(records):
        new = [one for one in records[fetched : fetched + 200] if one.deadline_ns + RECORDED_NS <= now_ns]
        fetched += len(new)
        deadlines += [one.deadline_ns for one in new]
        publisher.publish(new)
        publisher.flush(now_ns + WAKE_NS)
        for count in publisher.sent:
            waits += [(now_ns - deadline) * 1e-6 for deadline in deadlines[:count]]
            del deadlines[:count]
        publisher.sent.clear()
        slept_ns = round(pause_s(publisher.flush_due_ns, now_ns) * 1e9)
        assert slept_ns > 0 or publisher.flush_due_ns is not None, "a turn without an end"
        now_ns += slept_ns + turns.randrange(100_000, WAKE_NS)
    return waits


@pytest.mark.parametrize("rate_hz", [40, 100, 333, 500, 1000, 2000, 4000])
def test_no_tick_waits_longer_than_the_page_says(publisher: Told, rate_hz: int) -> None:
    said = re.search(r"a tick waits at most (\d+) ms", PAGE)
    assert said is not None
    period_ns = 1_000_000_000 // rate_hz
    records = [replace(one, deadline_ns=one.seq * period_ns) for one in ticks(2 * rate_hz)]
    waits = waits_ms(publisher, records, random.Random(rate_hz))
    assert len(waits) > len(records) - 0.05 * rate_hz
    assert max(waits) <= float(said.group(1))


def test_messages_are_as_long_as_that_allows(publisher: Told) -> None:
    """A message for every turn would cost subscribers twice as many."""
    waits = waits_ms(publisher, ticks(2000), random.Random(1))
    assert len(waits) / publisher.all_sent > 15


def test_turns_come_regularly_while_nothing_waits_and_at_once_when_it_is_late() -> None:
    assert pause_s(None, 0) == DRAIN_S
    assert pause_s(10**12, 0) == DRAIN_S
    assert pause_s(WAKE_NS + 3_000_000, 0) == pytest.approx(3e-3)
    assert pause_s(0, 10**9) == 0.0
