"""Ticks on their way to the page: joined, packed, kept for a minute."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest

from hapticd.client import Damping, Energy, Gap, Position, Timing
from hapticd.telemetry.wire import Topic
from hapticd_views.dashboard import history
from hapticd_views.dashboard.frames import COLUMNS, COLUMNS_OF_AN_AXIS, HEADER, MOST_WAITING, Part, TickJoiner, packed
from hapticd_views.dashboard.history import KEEP_S, History


def parts(seq: int, axes: int = 1) -> list[Part]:
    at = 1000.0 + seq / 1000.0
    zeros = (0.0,) * axes
    return [
        Position(at, seq, (seq / 1e3,) * axes, zeros, (2.0,) * axes, (3.0,) * axes),
        Energy(at, seq, 4.0, 0.0, 6.0, 5.0),
        Damping(at, seq, (7.0, 9.0, 8.0), (True, False, True), (0.0, 0.0, 0.0)),
        Timing(at, seq, 0, 11.0, 12.0, 0.001),
    ]


def joined(*given: Part) -> TickJoiner:
    joiner = TickJoiner()
    for part in given:
        joiner.add(part, 1)
    return joiner


def unpacked(frames: bytes) -> list[dict[str, Any]]:
    """Every frame of a message."""
    found, at = [], 0
    while at < len(frames):
        count, axes, t0, seq0, step = HEADER.unpack_from(frames, at)
        at += HEADER.size
        names = ["t", "seq", *(f"{name}{axis}" for name in COLUMNS_OF_AN_AXIS for axis in range(axes)), *COLUMNS]
        columns = {}
        for name in names:
            columns[name] = list(struct.unpack_from(f"<{count}f", frames, at))
            at += 4 * count
        found.append({"axes": axes, "t0": t0, "seq0": seq0, "step": step, **columns})
    return found


def test_a_tick_has_what_was_published_of_it() -> None:
    (frame,) = unpacked(packed(joined(*parts(41), *parts(42)).take()))
    assert (frame["axes"], frame["seq0"], frame["t0"]) == (1, 41, 1000.041)
    assert frame["seq"] == [0.0, 1.0]
    assert frame["t"] == pytest.approx([0.0, 0.001])
    assert frame["position_m0"] == pytest.approx([0.041, 0.042])
    values = {name: frame[name][0] for name in ("force_n0", "force_requested_n0", *COLUMNS)}
    assert values == {
        "force_n0": 2.0,
        "force_requested_n0": 3.0,
        "energy_j": 4.0,
        "generated_j": 5.0,
        "dissipated_j": 6.0,
        "damping_n_s_per_m": 9.0,
        "contacts": 2.0,
        "late_us": 11.0,
        "busy_us": 12.0,
    }


def test_a_tick_waits_for_all_of_its_parts_in_whatever_order_they_come() -> None:
    joiner = joined(*parts(1)[:3], *reversed(parts(0)))
    assert [tick.seq for tick in joiner.take()] == [0]
    joiner.add(parts(1)[3], 1)
    assert [tick.seq for tick in joiner.take()] == [1]
    assert joiner.take() == []


def test_a_part_that_is_lost_leaves_a_hole_in_its_columns_only() -> None:
    position, _, damping, timing = parts(0)
    (frame,) = unpacked(packed(joined(position, damping, timing, *parts(1)).take()))
    assert math.isnan(frame["energy_j"][0])
    assert frame["energy_j"][1] == 4.0
    assert frame["force_n0"] == [2.0, 2.0]


def test_a_topic_that_never_comes_does_not_pile_up() -> None:
    joiner, taken = TickJoiner(), 0
    for seq in range(3 * MOST_WAITING):
        joiner.add(parts(seq)[0], 1)
        if seq % 200 == 0:
            taken += len(joiner.take())
    assert taken >= 2 * MOST_WAITING


@pytest.mark.parametrize("first", [0, 9000])  # it may have counted further when it is heard again
def test_a_daemon_that_starts_anew_is_followed_from_its_first_tick(first: int) -> None:
    joiner = joined(*parts(5000), *parts(5001)[:2])
    assert [tick.seq for tick in joiner.take()] == [5000]
    joiner.restart(Gap(Topic.POSITION, 5001, first, 0))
    for part in parts(first):
        joiner.add(part, 1)
    joiner.restart(Gap(Topic.TIMING, 5000, first, 0))
    for part in parts(first + 1):
        joiner.add(part, 1)
    assert [tick.seq for tick in joiner.take()] == [first, first + 1]


def test_another_number_of_axes_begins_another_frame() -> None:
    frames = unpacked(packed(joined(*parts(0), *parts(1, axes=3), *parts(2, axes=3)).take()))
    assert [(frame["axes"], len(frame["t"])) for frame in frames] == [(1, 1), (3, 2)]


def test_another_step_begins_another_frame_and_a_tick_that_waited_keeps_the_one_before() -> None:
    """A reload of `telemetry.every_ticks` comes between the daemon's messages, not between the page's."""
    *first, timing = parts(1)
    joiner = joined(*parts(0), *first)
    joiner.add(timing, 10)
    for seq in (10, 20):
        for part in parts(seq):
            joiner.add(part, 10)
    frames = unpacked(packed(joiner.take()))
    assert [(frame["step"], frame["seq0"], frame["seq"]) for frame in frames] == [
        (1.0, 0.0, [0.0, 1.0]),
        (10.0, 10.0, [0.0, 10.0]),
    ]


def test_a_tick_that_makes_no_sense_is_left_out() -> None:
    odd = Position(0.0, 0, (0.0, 0.0), (0.0,), (0.0,), (0.0, 0.0))
    (frame,) = unpacked(packed(joined(odd, *parts(0)[1:], *parts(1)).take()))
    assert frame["seq0"] == 1


def test_a_number_that_32_bits_do_not_hold_stops_nothing() -> None:
    position = Position(0.0, 0, (1e300,), (0.0,), (0.0,), (0.0,))
    (frame,) = unpacked(packed(joined(position, *parts(0)[1:]).take()))
    assert frame["position_m0"] == [math.inf]


def test_a_minute_is_kept_and_no_more() -> None:
    kept = History()
    for second in range(200):
        kept.add_ticks(float(second), bytes([second]))
        kept.add_note("cycles", {"timestamp": float(second)})
        kept.add_note("events", {"timestamp": float(second)})
    ticks, past = kept.messages()
    assert ticks == bytes(range(199 - round(KEEP_S), 200))
    assert isinstance(past, dict)
    for notes in past["past"].values():
        assert [note["timestamp"] for note in notes] == [float(second) for second in range(139, 200)]


def test_a_fast_device_takes_no_more_memory_than_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(history, "MOST_BYTES", 1000)
    monkeypatch.setattr(history, "MESSAGE_BYTES", 400)
    kept = History()
    for tick in range(500):
        kept.add_ticks(tick / 1000.0, bytes(10))
    *ticks, _ = kept.messages()
    sizes = [len(part) for part in ticks if isinstance(part, bytes)]
    assert sum(sizes) == 1000
    assert max(sizes) <= 410
