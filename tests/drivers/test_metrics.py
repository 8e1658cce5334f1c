"""What drivers count: it reaches the status, growth is told without a flood, and docs/drivers.md names all of it."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from hapticd import plugins
from hapticd.device import Metric
from hapticd.supervisor.metrics import QUIET_S, MetricWatch, values_of

METRICS = (Metric("lost_frames", "frames that never came", warns=True), Metric("echo_us", "age of the echo"))
DOCS = Path(__file__).parents[2] / "docs"


def told(watch: MetricWatch, lost: float, echo_us: float, now_s: float) -> list[float | int | str]:
    return [fields["grown_by"] for _, fields in watch.grown(METRICS, [lost, echo_us, 0.0], now_s)]


def test_every_metric_has_its_number() -> None:
    assert values_of(METRICS, [3.0, 812.5, 0.0]) == {"lost_frames": 3.0, "echo_us": 812.5}


def test_growth_is_told_at_once_and_then_no_more_than_every_ten_seconds_with_nothing_left_out() -> None:
    watch = MetricWatch()
    assert told(watch, 0, 900, 0.0) == []
    assert told(watch, 2, 5000, 1.0) == [2.0]
    assert told(watch, 2, 5000, 1.0 + 2.0 * QUIET_S) == []
    assert told(watch, 3, 5000, 2.0 + 2.0 * QUIET_S) == [1.0]
    assert told(watch, 9, 5000, 3.0 + 2.0 * QUIET_S) == []
    assert told(watch, 11, 5000, 2.0 + 3.0 * QUIET_S) == [8.0]


def test_a_device_that_was_opened_anew_is_watched_from_zero_again() -> None:
    watch = MetricWatch()
    assert told(watch, 50, 0, 0.0) == [50.0]
    assert told(watch, 0, 0, QUIET_S) == []
    assert told(watch, 4, 0, 2.0 * QUIET_S) == [4.0]


def test_a_warning_says_which_number_how_much_and_what_it_means() -> None:
    ((text, fields),) = MetricWatch().grown(METRICS, [7.0, 0.0], 0.0)
    assert text == "lost_frames: 7 more, 7 since the device was opened: frames that never came"
    assert fields == {"metric": "lost_frames", "grown_by": 7.0, "value": 7.0}


@pytest.mark.parametrize("nonsense", [math.nan, -1.0, -math.inf])
def test_a_number_that_makes_no_sense_is_no_growth(nonsense: float) -> None:
    assert told(MetricWatch(), nonsense, nonsense, 0.0) == []


@pytest.mark.parametrize("name", plugins.names(plugins.DRIVERS))
def test_the_page_names_every_metric_of_a_built_in_driver_and_which_of_them_warn(name: str) -> None:
    rows = re.findall(rf"^\| `{name}` \| `(\w+)` \| (.+) \|$", (DOCS / "drivers.md").read_text(), flags=re.MULTILINE)
    assert {key: meaning.endswith("; warns") for key, meaning in rows} == {
        metric.name: metric.warns for metric in plugins.driver(name).METRICS
    }
