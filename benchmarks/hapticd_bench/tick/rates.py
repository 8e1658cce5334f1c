"""What a real daemon does at a set rate."""

from __future__ import annotations

import time
from dataclasses import dataclass

from hapticd.errors import HapticdError
from hapticd.measure import Quantiles, ratio
from hapticd.telemetry.records import LateHistogram
from hapticd_bench.tick.case import scene
from hapticd_bench.tick.daemon import RecordedLoop, serve_daemon

_SETTLE_S = 0.3


@dataclass(frozen=True, slots=True)
class Rate:
    """What a real daemon did at a set rate.

    Attributes:
        rate_hz: set.
        sustained_hz: ticks executed a second.
        ticks: executed in the time that was looked at.
        skipped: deadlines in the same time that had to be skipped.
        dropped: ticks that the supervisor was too slow to fetch, in the whole run.
        late_us, busy_us: how late the ticks that the supervisor fetched began, and their bodies [us].
        late_histogram: those ticks by how late they were, bins of `LATE_EDGES_US`.
        late_p50_ratio: p50 of `late_us` next to the slowest rate of the same run.
        fault: the loop's own reason to stop, empty when all went well.
        warnings: what the loop could not have.
    """

    rate_hz: float
    sustained_hz: float
    ticks: int
    skipped: int
    dropped: int
    late_us: Quantiles
    busy_us: Quantiles
    late_histogram: tuple[int, ...]
    late_p50_ratio: float
    fault: str
    warnings: tuple[str, ...]


def measure_rate(rate_hz: float, seconds: float, reference_us: float = 0.0) -> Rate:
    """Run a real daemon at a rate and see what it did.

    Args:
        rate_hz: set [Hz].
        seconds: how long, not counting its start [s].
        reference_us: p50 lateness to compare with; 0: its own [us].

    Raises:
        HapticdError: it could not run, or not a single tick came.
    """
    daemon = RecordedLoop(serve_daemon, scene(rate_hz=rate_hz))
    try:
        time.sleep(_SETTLE_S + seconds)
        ticks = daemon.stop().from_s(_SETTLE_S)
    finally:
        daemon.kill()
    if len(ticks.seq) < 2:
        raise HapticdError(f"the daemon ran no ticks at {rate_hz:g} Hz: {ticks.fault or 'it gave no reason'}")
    # Sequence numbers and the loop's own count of skips also cover ticks that were never fetched.
    executed = ticks.seq[-1] - ticks.seq[0]
    histogram = LateHistogram()
    for each_us in ticks.late_us:
        histogram.add(each_us)
    late_us = Quantiles.of(ticks.late_us)
    return Rate(
        rate_hz=rate_hz,
        sustained_hz=executed / ((ticks.deadline_ns[-1] - ticks.deadline_ns[0]) * 1e-9),
        ticks=executed,
        skipped=ticks.skipped[-1] - ticks.skipped[0],
        dropped=ticks.dropped,
        late_us=late_us,
        busy_us=Quantiles.of(ticks.busy_us),
        late_histogram=tuple(histogram.counts),
        late_p50_ratio=ratio(late_us.p50, reference_us or late_us.p50),
        fault=ticks.fault,
        warnings=ticks.warnings,
    )
