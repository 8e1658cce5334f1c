"""Timestamps are the clock's, and never step back."""

from __future__ import annotations

import time
from itertools import pairwise

from hapticd.telemetry.clock import followed_offset_ns, measure_epoch_offset_ns, timestamp_s

CLOCKS_AGREE_S = 1e-3
"""How far the system may set its clock between two readings of it [s]."""


def test_timestamps_are_the_clocks_and_never_step_back() -> None:
    offset = measure_epoch_offset_ns()
    stamps = [timestamp_s(time.monotonic_ns(), offset) for _ in range(1000)]
    assert all(later >= earlier for earlier, later in pairwise(stamps))
    before_s = time.time()
    stamp_s = timestamp_s(time.monotonic_ns(), offset)
    assert before_s - CLOCKS_AGREE_S < stamp_s < time.time() + CLOCKS_AGREE_S


def test_timestamps_follow_a_clock_that_is_set_forward_and_never_one_that_is_set_back() -> None:
    """S10: after a suspend, or a start before the time was known, they stayed wrong until the daemon's end."""
    hour_ns = 3_600_000_000_000
    assert followed_offset_ns(hour_ns, 2 * hour_ns) == 2 * hour_ns
    assert followed_offset_ns(hour_ns, 0) == hour_ns
    assert followed_offset_ns(hour_ns, hour_ns + 1_000_000) == hour_ns
