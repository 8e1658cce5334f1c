"""A minute in the picture: a viewer that comes late sees it whole, and a spike of one tick in it is always seen."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import pytest

from hapticd.tick.event import EventCode, LoopEvent
from hapticd.tick.record import TickRecord
from tests.telemetry.sockets import EPOCH_OFFSET_NS, ticks
from tests.views.dashboard.browser import Browser, Page
from tests.views.dashboard.served import Served
from tests.views.dashboard.stage import Stage

TICKS = 70_000
LARGE_AT, SMALL_AT = 20_500, 45_123
LARGE_N = 8.0
"""A spike that sets the scale."""

CHUNK = 2_500
"""Ticks that fit into what ZeroMQ keeps for a reader that is busy."""


@pytest.fixture(scope="module")
def stage() -> Iterator[Stage]:
    with Stage() as stage:
        yield stage


@pytest.fixture(scope="module")
def served(stage: Stage) -> Iterator[Served]:
    with Served(stage.directory, "--connect", stage.endpoint) as served:
        yield served


def still(count: int, first: int = 0) -> list[TickRecord]:
    """Ticks in which nothing happens."""
    records = ticks(count, first)
    for record in records:
        record.force_n = record.force_requested_n = (0.0,)
        for wall in record.walls:
            wall.in_contact = False
    return records


def has_come(page: Page, seq: int) -> None:
    page.wait_inside(f"page.store.lastSeq === {seq}")
    page.wait_inside("page.charts.list.length > 0")


def play(stage: Stage, page: Page, records: list[TickRecord]) -> None:
    """Have ticks published no faster than the dashboard reads them, so that none is lost on the way."""
    for first in range(0, len(records), CHUNK):
        chunk = records[first : first + CHUNK]
        stage.play(chunk)
        has_come(page, chunk[-1].seq)


def trace(picture: npt.NDArray[np.uint8], chart: dict[str, float]) -> npt.NDArray[np.bool_]:
    """Where the blue of the curve is, within the chart."""
    x, y, width, height = (round(chart[key]) for key in ("x", "y", "width", "height"))
    red, _, blue = (picture[y : y + height, x : x + width, colour].astype(int) for colour in range(3))
    return np.asarray(blue - red > 60)


@pytest.fixture(scope="module", autouse=True)
def row_n(browser: Browser, stage: Stage, served: Served) -> float:
    """The minute. One spike is large; another is as high as one row of pixels [N], and lasts a sixtieth of a column."""
    records = still(TICKS)
    records[LARGE_AT].force_n = (LARGE_N,)
    with browser.page(served.watch) as page:
        page.wait_inside("page.store.status !== null")
        play(stage, page, records[:30_000])
        stage.event(LoopEvent(EventCode.SWITCHED, "to be seen", 29_999, records[29_999].deadline_ns))
        page.click("#span button:nth-child(5)")
        page.wait_inside("page.charts.list[1].uplot.scales.y.max >= 8")
        row_n = page.inside("(({ uplot }) => uplot.posToVal(10, 'y') - uplot.posToVal(11, 'y'))(page.charts.list[1])")
        assert 0.05 < row_n < 0.5
        records[SMALL_AT].force_n = (row_n,)
        play(stage, page, records[30_000:])
    return float(row_n)


def test_a_late_viewer_sees_the_last_minute_and_every_tick_of_it(
    browser: Browser, served: Served, row_n: float
) -> None:
    with browser.page(served.watch) as late:
        has_come(late, TICKS - 1)
        ring = "page.store.ring"
        assert 60.0 <= late.inside(f"{ring}.time({ring}.end - 1) - {ring}.time({ring}.begin)") <= 63.0
        rows = late.inside(f"Array.from({{ length: {ring}.end }}, (_, row) => {ring}.seq[row])")
        assert rows == list(range(TICKS - len(rows), TICKS))
        assert late.inside(f"{ring}.value('f0', {ring}.rowAt({EPOCH_OFFSET_NS / 1e9 + SMALL_AT / 1e3} - 1e-4))") == (
            pytest.approx(row_n)
        )
        assert late.inside("page.store.events.map(({ text }) => text)") == ["to be seen"]


def test_a_spike_of_one_tick_and_one_row_of_pixels_is_in_the_picture(browser: Browser, served: Served) -> None:
    with browser.page(served.watch) as page:
        has_come(page, TICKS - 1)
        page.click("#span button:nth-child(5)")
        page.wait_inside("page.charts.list[1].uplot.scales.x.min <= -59.9")
        page.wait_inside("page.charts.list[1].uplot.scales.y.max >= 8")
        chart = page.inside(
            "(({ uplot }) => { const box = uplot.over.getBoundingClientRect(); return { x: box.x, y: box.y,"
            " width: box.width, height: box.height, zero: uplot.valToPos(0, 'y'), large: uplot.valToPos(8, 'y'),"
            f" largeX: uplot.valToPos(({LARGE_AT} - {TICKS - 1}) / 1e3, 'x'),"
            f" smallX: uplot.valToPos(({SMALL_AT} - {TICKS - 1}) / 1e3, 'x') }}; }})(page.charts.list[1])"
        )
        seen = trace(page.picture(), chart)
    tops = np.where(seen.any(axis=0), seen.argmax(axis=0), -1)[2:-2]  # the highest row of the curve in each column
    flat = int(np.median(tops))
    assert abs(flat - chart["zero"]) <= 2
    higher = {int(column) + 2: flat - int(tops[column]) for column in np.flatnonzero((tops >= 0) & (tops < flat))}
    large = {column for column in higher if abs(column - chart["largeX"]) <= 3}
    small = {column for column in higher if abs(column - chart["smallX"]) <= 3}
    assert set(higher) == large | small  # nothing else stands out
    assert max(higher[column] for column in large) == pytest.approx(chart["zero"] - chart["large"], abs=2)
    assert small
    assert {higher[column] for column in small} == {1}


def test_a_daemon_of_another_schema_is_said_and_its_ticks_are_not_shown(
    browser: Browser, stage: Stage, served: Served
) -> None:
    with browser.page(served.watch) as page:
        has_come(page, first := stage.last)
        stage.speak(schema=2)
        page.wait_for("document.getElementById('trouble').innerText.includes('schema 2')")
        assert page.evaluate("document.getElementById('state').textContent") == "No daemon"
        stage.play(still(100, first + 1))
        stage.speak(schema=1)
        page.wait_for("document.getElementById('trouble').hidden")
        stage.play(still(100, first + 101))
        page.wait_inside(f"page.store.lastSeq === {first + 200}")


@pytest.mark.parametrize("payload", ["text", [1], [{"seq": 1}], [{"timestamp": 0.0, "seq": "x"}]])
def test_a_forged_message_of_the_daemon_is_said_and_what_follows_is_shown(
    browser: Browser, stage: Stage, served: Served, payload: object
) -> None:
    with browser.page(served.watch) as page:
        has_come(page, stage.last)
        stage.forge("hapticd/position", payload)
        page.wait_for("document.getElementById('trouble').innerText.includes('hapticd/position')")
        page.wait_for("document.getElementById('trouble').hidden")


def test_every_tick_counts_by_the_step_it_was_published_with(browser: Browser, stage: Stage, served: Served) -> None:
    """For a page that is there when `telemetry.every_ticks` is reloaded, and for one that is sent it as the past."""
    first = stage.last + 10 - stage.last % 10
    with browser.page(served.watch) as page:
        has_come(page, stage.last)
        before = page.inside("page.store.punctuality().lost") + first - stage.last - 1
        stage.play(still(2000, first))
        stage.reload(every_ticks=10)
        stage.play(still(1000, first + 2000))
        stage.play(still(1000, first + 3050))  # five of those that are published are not there
        stage.reload(every_ticks=1)
        stage.play(still(100, first + 4050))
        has_come(page, first + 4149)
        with browser.page(served.watch) as late:
            has_come(late, first + 4149)
            thin = [*range(first + 2000, first + 3000, 10), first + 3050, *range(first + 3050, first + 4050, 10)]
            wanted = [*range(first, first + 2000), *thin, *range(first + 4050, first + 4150)]  # 3050: a row of nothing
            for one in (page, late):
                assert one.inside("page.store.punctuality().lost") == before + 5
                ring = "page.store.ring"
                seqs = one.inside(
                    f"Array.from({{ length: {ring}.end }}, (_, row) => {ring}.seq[row % {ring}.capacity])"
                )
                assert seqs[-len(wanted) :] == wanted


def test_lost_ticks_are_counted_and_a_restart_is_not_a_loss(browser: Browser, stage: Stage, served: Served) -> None:
    with browser.page(served.watch) as page:
        last = stage.last
        has_come(page, last)
        before = page.inside("page.store.punctuality().lost")
        stage.play(still(50, last + 8))  # seven ticks are not there
        page.wait_inside(f"page.store.lastSeq === {last + 57}")
        assert page.inside("page.store.punctuality().lost") == before + 7
        records = still(100)
        for record in records:
            record.deadline_ns += (last + 100) * 1_000_000
        stage.play(records)
        page.wait_inside("page.store.lastSeq === 99")
        assert page.inside("page.store.punctuality().lost") == before + 7


def test_a_device_of_three_axes_has_a_curve_and_a_figure_for_each(
    browser: Browser, stage: Stage, served: Served
) -> None:
    """It takes the place of the one before, whose past it does not have."""
    records = still(500, 1000)
    for record in records:
        record.deadline_ns += 100_000_000_000
        for name in ("position_m", "velocity_m_per_s", "force_n", "force_requested_n"):
            setattr(record, name, (0.001, 0.002, 0.003))
    with browser.page(served.watch) as page:
        stage.play(records)
        has_come(page, 1499)
        page.wait_inside("page.store.ring.axes === 3 && page.charts.list[0].figures.length === 3")
        page.wait_inside("page.charts.list[0].uplot.data.length === 4")
        figures = page.inside("page.charts.list[0].figures.map(({ output }) => output.textContent)")
        assert figures == ["1.000", "2.000", "3.000"]
        assert page.inside("page.charts.list[1].uplot.data.length") == 1 + 2 * 3
        assert not page.events("Runtime.exceptionThrown")
