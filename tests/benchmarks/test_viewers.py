"""The benchmark of viewers, shortly: with everybody looking nobody misses a tick. How late they are is no test."""

from __future__ import annotations

from hapticd.paths import default_config
from hapticd_bench.audience import TickCount
from hapticd_bench.viewers import ROUNDS, measure


def test_two_recorders_a_dashboard_and_fourteen_subscribers_miss_no_tick() -> None:
    told: list[float] = []
    found = measure(default_config(), 4.0, told.append)
    assert set(found.missing) == {"subscribers", "page", "recorder 1", "recorder 2", "this benchmark"}
    assert found.missing == dict.fromkeys(found.missing, 0)
    assert found.bars[0].verdict == "PASS"
    for reader, ticks in found.ticks.items():
        assert ticks > 500 * ROUNDS, reader
    assert found.alone.count > 500
    assert found.watched.count > 500
    busy = {share.program: (share.alone, share.watched) for share in found.shares}
    assert {"the daemon's loop", "dashboard", "recorder 1", "recorder 2"} < set(busy)
    assert busy["dashboard"][0] == 0.0
    assert sum(told) > 3.0


def test_a_tick_that_did_not_come_is_counted() -> None:
    count = TickCount()
    for seq in (5, 6, 9, 10, 0, 1, 3):  # the daemon was started anew, and counts from 0
        count.take(seq)
    assert (count.ticks, count.missing) == (7, 3)
