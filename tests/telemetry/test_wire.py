"""What leaves for the wire is what docs/telemetry.md promises, whatever a tick record holds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import msgpack
from hypothesis import given
from hypothesis import strategies as st

from hapticd.telemetry import wire
from hapticd.telemetry.clock import timestamp_s
from hapticd.telemetry.wire import Map, Topic
from hapticd.tick.contact_record import WallRecord
from hapticd.tick.event import EventCode, LoopEvent
from hapticd.tick.record import RecordLayout, TickRecord
from tests.telemetry.sockets import ticks

ARRAYS = {"position_m", "velocity_m_per_s", "force_n", "force_requested_n"}
INTEGERS = st.integers(-(2**63), 2**63 - 1)
FLOATS = st.floats(allow_nan=True, allow_infinity=True)


@dataclass(frozen=True)
class Hand:
    buttons: int = 4
    has_gripper: bool = True
    has_orientation: bool = True


WALLS = st.builds(
    WallRecord,
    in_contact=st.booleans(),
    damping_n_s_per_m=FLOATS,
    felt_mass_kg=FLOATS,
    cycle=INTEGERS,
    cycle_energy_j=FLOATS,
    cycle_generated_j=FLOATS,
    cycle_damping_n_s_per_m=FLOATS,
    cycle_duration_s=FLOATS,
)


def any_record(axes: int) -> st.SearchStrategy[TickRecord]:
    whole = ("seq", "deadline_ns", "skipped", "flags", "law", "buttons")
    real = ("late_us", "busy_us", "dt_s", "gripper_m", "energy_j", "spring_energy_j", "dissipated_j", "generated_j")
    fields: dict[str, st.SearchStrategy[Any]] = {
        **dict.fromkeys(whole, INTEGERS),
        **dict.fromkeys(real, FLOATS),
        **dict.fromkeys(ARRAYS, st.tuples(*[FLOATS] * axes)),
        "orientation": st.sampled_from([(), (1.0,) * 9, (math.nan,) * 9]),
        "walls": st.lists(WALLS, max_size=8).map(tuple),
    }
    return st.builds(TickRecord, **fields)


RECORDS = st.integers(1, 3).flatmap(any_record)
"""Any record that the ring can hold."""


def all_maps(record: TickRecord) -> dict[Topic, Map]:
    stamp = timestamp_s(record.deadline_ns, 0)
    maps = {
        Topic.POSITION: wire.position_map(record, stamp),
        Topic.ENERGY: wire.energy_map(record, stamp),
        Topic.DAMPING: wire.damping_map(record, stamp),
        Topic.TIMING: wire.timing_map(record, stamp),
        Topic.INPUT: wire.input_map(record, stamp, Hand()),
    }
    if record.walls:
        maps[Topic.CYCLE] = wire.cycle_map(record, stamp, len(record.walls) - 1)
    return maps


def numbers(value: Any) -> list[float]:
    return [one for element in value for one in numbers(element)] if isinstance(value, list) else [value]


@given(RECORDS)
def test_any_record_arrives_as_finite_plain_numbers(record: TickRecord) -> None:
    packer = wire.new_packer()
    for fields in all_maps(record).values():
        (back,) = msgpack.unpackb(packer.pack([fields]))
        for key, value in back.items():
            for number in numbers(value):
                assert type(number) in (int, float, bool), key
                assert math.isfinite(number), key


@given(RECORDS)
def test_shapes_are_one_element_an_axis_and_one_a_wall(record: TickRecord) -> None:
    maps = all_maps(record)
    assert {key for key, value in maps[Topic.POSITION].items() if isinstance(value, list | tuple)} == ARRAYS
    assert all(len(maps[Topic.POSITION][key]) == len(record.position_m) for key in ARRAYS)
    for key in ("damping_n_s_per_m", "in_contact", "felt_mass_kg"):
        assert len(maps[Topic.DAMPING][key]) == len(record.walls)
    for topic in (Topic.ENERGY, Topic.TIMING, Topic.CYCLE):
        assert not any(isinstance(value, list | tuple) for value in maps.get(topic, {}).values())


@given(RECORDS)
def test_a_map_says_invalid_exactly_when_a_number_was_replaced(record: TickRecord) -> None:
    """And a number that was finite is the same one, however large."""
    for topic, fields in all_maps(record).items():
        source: Any = record
        names = {key: key for key in fields if key not in ("timestamp", "seq", "contact", "invalid")}
        if topic is Topic.CYCLE:
            source = record.walls[-1]
            names = {key: key if key == "cycle" else f"cycle_{key}" for key in names}
        bad = False
        for key, name in names.items():
            if topic is Topic.DAMPING:
                given_numbers = [getattr(wall, name) for wall in record.walls]
            else:
                value = getattr(source, name)
                given_numbers = list(value) if isinstance(value, tuple) else [value]
            sent = numbers(list(fields[key]) if isinstance(fields[key], list | tuple) else fields[key])
            assert sent == [one if math.isfinite(one) else 0 for one in given_numbers]
            bad |= not all(map(math.isfinite, given_numbers))
        assert fields.get("invalid", False) is bad, topic


def test_keys_are_those_of_the_contract() -> None:
    maps = all_maps(ticks(1)[0])
    assert {topic.value: set(fields) - {"timestamp", "seq"} for topic, fields in maps.items()} == {
        "hapticd/position": ARRAYS,
        "hapticd/energy": {"energy_j", "spring_energy_j", "dissipated_j", "generated_j"},
        "hapticd/damping": {"damping_n_s_per_m", "in_contact", "felt_mass_kg"},
        "hapticd/timing": {"deadline_ns", "late_us", "busy_us", "dt_s"},
        "hapticd/cycle": {"contact", "cycle", "energy_j", "generated_j", "damping_n_s_per_m", "duration_s"},
        "hapticd/input": {"buttons", "gripper_m", "orientation"},
    }


def test_input_has_only_what_the_device_has() -> None:
    fields = wire.input_map(ticks(1)[0], 0.0, Hand(buttons=1, has_gripper=False, has_orientation=False))
    assert set(fields) == {"timestamp", "seq", "buttons"}


def test_a_record_out_of_shared_memory_packs_like_any_other() -> None:
    record = ticks(1)[0]
    layout = RecordLayout(axes=1, orientation=False, max_walls=8)
    wall = record.walls[0]
    row = layout.struct(1).pack(
        *(getattr(record, name) for name in TickRecord.__slots__[:14]),
        1,
        *record.position_m, *record.velocity_m_per_s, *record.force_n, *record.force_requested_n,
        *(getattr(wall, name) for name in WallRecord.__slots__),
    )  # fmt: skip
    assert all_maps(layout.unpack(row)) == all_maps(record)


def test_no_topic_is_a_prefix_of_another() -> None:
    """ZeroMQ subscribes by prefix, so a subscriber to one would get both."""
    assert not any(longer.startswith(shorter) for shorter, longer in permutations(Topic, 2))


def wall(cycle: int, energy_j: float = 0.0) -> WallRecord:
    return WallRecord(True, 0.0, 0.0, 0.0, cycle, energy_j, 0.0, 0.0, 0.0)


def test_every_completed_cycle_is_told_once_by_wall() -> None:
    record = ticks(1)[0]
    cycles = wire.Cycles()
    told = []
    for counts in [(0, 0), (1, 0), (1, 0), (2, 1), (2, 1), (2, 4)]:
        record.walls = tuple(wall(count, float(index)) for index, count in enumerate(counts))
        told.append(list(cycles.completed(record)))
    assert told == [[], [(0, 1)], [], [(0, 2), (1, 1)], [], [(1, 4)]]


def test_a_new_scene_starts_counting_anew() -> None:
    record = ticks(1)[0]
    cycles = wire.Cycles()
    told = []
    for counts in [(7,), (0,), (1,), (1, 0), (1, 1), (), (1,)]:
        record.walls = tuple(wall(count) for count in counts)
        told.append(list(cycles.completed(record)))
    assert told == [[(0, 7)], [], [(0, 1)], [], [(1, 1)], [], [(0, 1)]]


@given(
    st.dictionaries(st.text(), FLOATS | st.integers() | st.text() | st.none() | st.lists(FLOATS)),
    st.text(),
    INTEGERS,
)
def test_whatever_an_event_carries_it_can_be_sent(fields: dict[str, Any], text: str, seq: int) -> None:
    """Also names that are taken, lone surrogates and integers beyond msgpack."""
    event = LoopEvent(EventCode.DEVICE_LOST, text, seq, 0, fields)
    (back,) = msgpack.unpackb(wire.new_packer().pack([wire.event_map(event, 1.5)]))
    assert (back["timestamp"], back["seq"], back["code"]) == (1.5, seq, 204)
    assert set(back) >= {"timestamp", "seq", "code", "text"}
    assert all(math.isfinite(one) for value in back.values() for one in numbers(value) if isinstance(one, float))


def test_events_and_status_keep_their_names_and_lose_no_field() -> None:
    event = LoopEvent(EventCode.SWITCHED, "none -> tdpa", 7, 0, {"law_index": 2, "old": "none", "peak_n": math.inf})
    fields = {"law_index": 2, "old": "none", "peak_n": 0, "timestamp": 0.5, "seq": 7, "code": 103}
    assert wire.event_map(event, 0.5) == {**fields, "text": "none -> tdpa", "invalid": True}
    status = wire.status_map({"law": "tdpa", "late_histogram": (1, 2), "nested": {"a": math.nan}}, 0.5, 9, 10)
    assert status == {
        "law": "tdpa", "late_histogram": [1, 2], "nested": {"a": 0}, "invalid": True,
        "timestamp": 0.5, "seq": 9, "schema": wire.SCHEMA, "every_ticks": 10,
    }  # fmt: skip
