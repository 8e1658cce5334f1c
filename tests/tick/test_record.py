"""The layout of a tick record: what is packed is what is unpacked, whatever device and scene."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.config.models import MAX_WALLS
from hapticd.tick.record import Flag, RecordLayout, TickRecord, WallRecord

WHOLE = st.integers(-(2**63), 2**63 - 1)
REAL = st.floats(allow_nan=False)


@st.composite
def walls(draw: st.DrawFn) -> WallRecord:
    return WallRecord(
        draw(st.booleans()), draw(REAL), draw(REAL), draw(WHOLE), draw(REAL), draw(REAL), draw(REAL), draw(REAL)
    )


@st.composite
def records(draw: st.DrawFn) -> tuple[RecordLayout, TickRecord]:
    layout = RecordLayout(draw(st.integers(1, 7)), draw(st.booleans()), MAX_WALLS)
    vector = st.lists(REAL, min_size=layout.axes, max_size=layout.axes).map(tuple)
    turn = st.lists(REAL, min_size=9, max_size=9).map(tuple) if layout.orientation else st.just(())
    record = TickRecord(
        *(draw(WHOLE), draw(WHOLE)),
        *(draw(REAL), draw(REAL), draw(REAL)),
        *(draw(WHOLE), draw(WHOLE), draw(WHOLE), draw(WHOLE)),
        *(draw(REAL), draw(REAL), draw(REAL), draw(REAL), draw(REAL)),
        *(draw(vector), draw(vector), draw(vector), draw(vector)),
        draw(turn),
        tuple(draw(st.lists(walls(), max_size=MAX_WALLS))),
    )
    return layout, record


def values(record: TickRecord) -> list[Any]:
    """A record as the loop packs it: scalars, number of walls, axes, orientation, walls."""
    scalars = [getattr(record, name) for name in TickRecord.__slots__[:14]]
    vectors = [record.position_m, record.velocity_m_per_s, record.force_n, record.force_requested_n, record.orientation]
    flat = [number for vector in vectors for number in vector]
    for wall in record.walls:
        flat += [getattr(wall, name) for name in WallRecord.__slots__]
    return [*scalars, len(record.walls), *flat]


@given(packed=records())
def test_what_is_packed_is_what_is_unpacked(packed: tuple[RecordLayout, TickRecord]) -> None:
    """Also over a slot that held another record before, with more walls."""
    layout, record = packed
    row = bytearray(b"\xff" * layout.size)
    layout.struct(len(record.walls)).pack_into(row, 0, *values(record))
    assert layout.unpack(bytes(row)) == record
    assert all(isinstance(wall.in_contact, bool) for wall in layout.unpack(memoryview(row)).walls)


@pytest.mark.parametrize("axes", [1, 3])
@pytest.mark.parametrize("orientation", [False, True])
def test_every_record_fits_its_slot_and_slots_keep_words_aligned(axes: int, orientation: bool) -> None:
    layout = RecordLayout(axes, orientation, MAX_WALLS)
    assert all(layout.struct(count).size <= layout.size for count in range(MAX_WALLS + 1))
    assert layout.size % 8 == 0
    assert layout.size == 8 * (15 + 4 * axes + 9 * orientation + 8 * MAX_WALLS)


def test_one_wall_too_many_or_a_missing_number_is_refused_and_not_written() -> None:
    layout = RecordLayout(1, False, 2)
    with pytest.raises(IndexError):
        layout.struct(3)
    with pytest.raises(struct.error):
        layout.struct(0).pack(0)


def test_the_state_bits_are_what_the_wire_says() -> None:
    assert [flag.value for flag in Flag] == [1, 2, 4, 8, 16, 32]
    assert [flag.name for flag in Flag] == ["ARMED", "FALLBACK", "RELEASING", "LATCHED", "LIMITED", "UNCALIBRATED"]
