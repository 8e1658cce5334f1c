"""The histogram of late ticks counts every tick once, in bins whose edges never change."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from hapticd.telemetry.records import LATE_EDGES_US, LateHistogram, Status


def test_edges_double_from_ten_microseconds() -> None:
    assert LATE_EDGES_US[0] == 10
    assert all(later == 2 * earlier for earlier, later in pairwise(LATE_EDGES_US))
    assert LATE_EDGES_US[-1] == 10240


def test_an_edge_belongs_to_the_bin_above_it() -> None:
    histogram = LateHistogram()
    for late_us in (0.0, 9.99, 10.0, 19.9, 20.0, 10239.0, 10240.0, 1e9):
        histogram.add(late_us)
    assert histogram.counts == [2, 2, 1, 0, 0, 0, 0, 0, 0, 0, 1, 2]
    assert histogram.max_us == 1e9


@given(st.lists(st.floats(-1e6, 1e12)))
def test_every_tick_is_counted_once(late_us: list[float]) -> None:
    histogram = LateHistogram()
    for one in late_us:
        histogram.add(one)
    assert sum(histogram.counts) == len(late_us)
    assert len(histogram.counts) == len(LATE_EDGES_US) + 1


def test_a_map_has_every_key_of_a_status() -> None:
    assert Status(law="tdpa").as_map()["law"] == "tdpa"
    assert set(Status().as_map()) == set(Status.__slots__)
