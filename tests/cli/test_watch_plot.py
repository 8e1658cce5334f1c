"""Traces, axes and bars of `hapticd watch`."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from hapticd.cli.watch.plot import SLICE_S, Trace, axis, bars, plot


def test_a_trace_keeps_the_extremes_of_every_slice() -> None:
    """An oscillation far faster than a column of dots is still seen in full."""
    trace = Trace(1)
    for index in range(1000):
        trace.add(index * 1e-3, ((-1.0) ** index,))
    assert trace.window(5) == [([-1.0], [1.0])] * 5
    trace.add(0.0, (7.0,))  # the clock of another daemon
    assert trace.window(3) == [None, None, ([7.0], [7.0])]


def test_a_plot_puts_values_where_its_axis_says() -> None:
    trace = Trace(1)
    for index in range(20):
        trace.add(index * SLICE_S * 1.001, (float(index),))
    lines = [line.plain for line in plot(trace, 17, 5, ["cyan"], marks=(0.0,))]
    assert lines[0].strip().startswith("20")
    assert lines[-1].strip().startswith("0")
    assert lines[0].rstrip()[-1] != "20"
    assert [bool(set(line[7:]) - {" ", "┈"}) for line in lines] == [True] * 5
    assert lines[-1].index("⣀" if "⣀" in lines[-1] else lines[-1][7]) == 7


@given(st.floats(-1e6, 1e6), st.floats(0.0, 1e6), st.floats(1e-3, 10.0))
def test_an_axis_holds_its_values_and_is_round(lowest: float, length: float, least: float) -> None:
    bottom, top = axis(lowest, lowest + length, least)
    slack = 1e-6 * max(1.0, abs(lowest) + length)
    assert bottom <= lowest + slack
    assert top >= lowest + length - slack
    assert top - bottom >= 0.999 * least


def test_bars_hide_nothing_that_is_not_zero() -> None:
    assert bars([0.0, 0.001, 4.0, 8.0]) == " ▁▄█"
    assert bars([0.0, 0.0]) == "  "
