"""What `hapticd watch` draws of what it knows."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.cli.watch.line import si
from hapticd.cli.watch.screen import frame, one_line
from hapticd.cli.watch.state import ScreenState
from hapticd.client import Cycle, Damping, Energy, Event, Position, Status
from hapticd.telemetry.records import LateHistogram, late_ticks
from tests.examples import examples

NUMBERS = st.floats(-1e300, 1e300) | st.floats(-1.0, 1.0)


@examples(50)
@given(
    width=st.integers(1, 200),
    height=st.integers(1, 60),
    axes=st.integers(1, 3),
    walls=st.integers(0, 8),
    numbers=st.lists(NUMBERS, min_size=1, max_size=40),
    flags=st.tuples(st.booleans(), st.booleans(), st.booleans(), st.booleans()),
    warnings=st.lists(st.text(), max_size=4),
    metrics=st.dictionaries(st.text(alphabet="abc_", max_size=30), NUMBERS, max_size=8),
)
def test_whatever_is_known_the_picture_has_the_size_of_the_terminal(
    width: int,
    height: int,
    axes: int,
    walls: int,
    numbers: list[float],
    flags: tuple[bool, ...],
    warnings: list[str],
    metrics: dict[str, float],
) -> None:
    known = ScreenState()
    armed, fallback, latched, told = flags
    if told:
        texts = tuple(" ".join(one.split()) for one in warnings)
        status = Status(armed=armed, fallback=fallback, latched=latched, warnings=texts, axes=("x",) * axes)
        known.take([dataclasses.replace(status, device_metrics=metrics)], 0.0)
    for index, number in enumerate(numbers):
        vector, at_s = (number,) * axes, index * 0.03
        known.take([Position(at_s, index, vector, vector, vector, (numbers[0],) * axes)], 0.0)
        known.take([Energy(at_s, index, number, number, number, number)], 0.0)
        known.take([Damping(at_s, index, (number,) * walls, (armed,) * walls, (number,) * walls)], 0.0)
        known.take([Cycle(at_s, index, 0, index, number, number, number, number)], 0.0)
        known.take([Event(at_s, index, 100 * index % 400, "text " * (index % 9))], 0.0)
    lines = frame(known, "ipc:///run/hapticd/default/telemetry", width, height, 1.0)
    assert [line.cell_len for line in lines] == [width] * height


def test_a_fault_whose_force_is_still_being_ramped_out_says_so() -> None:
    known = ScreenState()
    known.take([Status(latched=True, releasing=True)], 0.0)
    assert " LATCHED, RELEASING " in frame(known, "ipc:///x", 80, 24, 0.0)[0].plain


def test_a_latched_fault_says_how_to_go_on() -> None:
    known = ScreenState()
    known.take([Status(latched=True, law="tdpa", rate_hz=1000.0)], 0.0)
    text = "\n".join(line.plain for line in frame(known, "ipc:///x", 80, 24, 0.0))
    assert "LATCHED" in text
    assert "loop ? of 1000 Hz" in text, "a rate that is not known yet is not 0"
    assert "hapticd clear" in text


@pytest.mark.parametrize("armed", [True, False])
def test_a_force_is_shown_as_limited_only_where_forces_are_let_through(armed: bool) -> None:
    known = ScreenState()
    applied_n = (12.0,) if armed else (0.0,)
    known.take([Status(armed=armed, axes=("z",)), Position(0.0, 1, (-0.1,), (0.0,), applied_n, (300.0,))], 0.0)
    text = "\n".join(line.plain for line in frame(known, "ipc:///x", 80, 24, 0.0))
    assert ("limited" in text) == armed


def test_a_device_that_is_lost_is_said_first() -> None:
    known = ScreenState()
    known.take([Status(calibrated=False, device_lost_timestamp=1.0, warnings=("no device: is it plugged in?",))], 0.0)
    lines = [line.plain for line in frame(known, "ipc:///x", 80, 24, 0.0)]
    assert lines[0].rstrip().endswith("NO DEVICE")
    assert lines[1].rstrip() == " ⚠ no device: is it plugged in?"
    assert "calibrate" not in "".join(lines)
    assert "no device" in one_line(known)


def test_a_device_that_is_not_calibrated_says_what_it_waits_for() -> None:
    known = ScreenState()
    known.take([Status(calibrated=False, law="tdpa")], 0.0)
    text = "\n".join(line.plain for line in frame(known, "ipc:///x", 100, 24, 0.0))
    assert "hapticd calibrate" in text


def test_late_ticks_are_those_of_160_us_and_more() -> None:
    histogram = LateHistogram()
    for late_us in (0.0, 159.0, 160.0, 161.0, 20000.0):
        histogram.add(late_us)
    assert late_ticks(histogram.counts) == 3
    assert late_ticks(Status().late_histogram) == 0


def test_one_line_names_each_axis() -> None:
    known = ScreenState()
    known.take([Status(axes=("x", "y"), law="none"), Position(0.0, 1, (1e-3, -2e-3), (), (1.0, 0.0), ())], 0.0)
    assert "disarmed  none" in one_line(known)
    assert "x +1.000 mm +1.00 N  y -2.000 mm +0.00 N" in one_line(known)


@pytest.fixture
def nepal(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A user whose clock is five hours and three quarters ahead of UTC."""
    with monkeypatch.context() as patched:
        patched.setenv("TZ", "NPT-5:45")
        time.tzset()
        yield
    time.tzset()


@pytest.mark.usefixtures("nepal")
def test_times_say_how_far_they_are_from_utc_as_those_of_the_status_do() -> None:
    """Seconds after the epoch, which a status and a fault record show as the same."""
    known = ScreenState()
    known.take([Status(axes=("x",)), Event(62.0, 1, 101, "armed")], 0.0)
    known.take([Position(61.0, 1, (0.0,), (0.0,), (0.0,), (0.0,))], 0.0)
    assert one_line(known).startswith("1970-01-01 05:46:01 +0545  disarmed")
    for width in (60, 120):
        text = "\n".join(line.plain for line in frame(known, "ipc:///x", width, 40, 0.0))
        assert "05:46:02 · armed" in text
        assert "times +0545" in text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0 J"),
        (0.0123, "12.3 mJ"),
        (12000.0, "12.0 kJ"),
        (0.9999, "1.00 J"),
        (-3.2e-4, "-320 µJ"),
        (4e-12, "0.00 nJ"),
    ],
)
def test_numbers_have_three_digits_and_a_prefix(value: float, text: str) -> None:
    assert si(value, "J") == text


def test_eighty_columns_cut_nothing_that_somebody_waits_for() -> None:
    """A rig that is late, with a fault, long warnings and a dozen counters."""
    known = ScreenState()
    metrics = {f"counter_of_frames_{number}": 0.0 for number in range(12)} | {"echo_us": 123456.789}
    status = Status(
        latched=True, fault_code=202, fault_text="1.01 m/s is above the limit of 1 m/s", calibrated=False,
        warnings=("a link that is slow " * 4 + "ends here",), device_metrics=metrics, rate_hz=1000.0,
        measured_rate_hz=999.9, late_histogram=(1000,) * 12, late_max_us=24500.0, overruns=123456, ring_drops=77,
    )  # fmt: skip
    known.take([status, Event(0.0, 1, 103, "configuration 98032d17ef83: law ring-damping -> tdpa")], 0.0)
    lines = [line.plain for line in frame(known, "ipc:///x", 80, 40, 0.0)]
    text = " ".join(" ".join(lines).split())
    assert "stopped by fault 202: 1.01 m/s is above the limit of 1 m/s; then hapticd clear" in text
    assert "clear its workspace, then hapticd calibrate (and 1 more: hapticd status)" in text
    assert "skipped 123456 lost 77 " in text
    assert " device echo_us 123457 counter" in text
    assert text.count("counter_of_frames_") + int(text.split(" more ")[0].split("+")[-1]) == 12
    assert "law ring-damping -> tdpa" in " ".join(text.replace("│", " ").split())
