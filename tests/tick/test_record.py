"""The layout of a tick record: what is packed is what is unpacked, whatever device and scene."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.config.walls import MAX_WALLS
from hapticd.tick.contact_record import WallRecord
from hapticd.tick.flags import Flag
from hapticd.tick.record import RecordLayout, TickRecord
from tests.tick.rig import Rig, wall

WHOLE = st.integers(-(2**63), 2**63 - 1)
REAL = st.floats(allow_nan=False)


@st.composite
def wall_records(draw: st.DrawFn) -> WallRecord:
    real = (draw(REAL), draw(REAL), draw(REAL))
    return WallRecord(draw(st.booleans()), *real, draw(WHOLE), draw(REAL), draw(REAL), draw(REAL), draw(REAL))


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
        tuple(draw(st.lists(wall_records(), max_size=MAX_WALLS))),
    )
    return layout, record


def values(record: TickRecord) -> list[Any]:
    """A record as the loop packs it: scalars, number of walls, axes, orientation, walls."""
    scalars = [getattr(record, name) for name in TickRecord.__slots__[:14]]
    vectors = [record.position_m, record.velocity_m_per_s, record.force_n, record.force_requested_n, record.orientation]
    flat = [number for vector in vectors for number in vector]
    for record_of_wall in record.walls:
        flat += [getattr(record_of_wall, name) for name in WallRecord.__slots__]
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
    objects = 4 + 8 * 23 if axes == 3 else 0
    ports = 4 + 24 * (9 + 3 * axes)
    assert layout.size == 8 * (15 + 4 * axes + 9 * orientation + 9 * MAX_WALLS + objects + ports)


def test_one_wall_too_many_or_a_missing_number_is_refused_and_not_written() -> None:
    layout = RecordLayout(1, False, 2)
    with pytest.raises(IndexError):
        layout.struct(3)
    with pytest.raises(struct.error):
        layout.struct(0).pack(0)


def test_the_state_bits_are_what_the_wire_says() -> None:
    assert [flag.value for flag in Flag] == [1, 2, 4, 8, 16, 32]
    assert [flag.name for flag in Flag] == ["ARMED", "FALLBACK", "RELEASING", "LATCHED", "LIMITED", "UNCALIBRATED"]


def test_a_tick_is_recorded_under_the_names_that_it_has() -> None:
    """Every field, by name, of a tick with two walls, one of them touched, the other changing its stiffness."""
    rig = Rig(wall(), wall(position_m=-1.0, changes=({"at_s": 0.003, "stiffness_n_per_m": 700.0},)))
    rig.at(0.01)
    rig.at(-0.002, ticks=4)
    tick, sample = rig.tick, rig.sample
    sample.buttons, sample.gripper_m = 5, 0.03
    row = bytearray(rig.layout.size)
    rig.layout.pack(memoryview(row), 0, tick, sample, 41, 42, 43.0, 44.0, 45, 46)
    record = rig.layout.unpack(memoryview(row))
    asked = (record.seq, record.deadline_ns, record.late_us, record.busy_us, record.skipped, record.law)
    assert asked == (41, 42, 43.0, 44.0, 45, 46)
    assert (record.buttons, record.gripper_m, record.dt_s) == (5, 0.03, tick.motion.dt_s)
    assert record.flags == tick.flags == Flag.ARMED
    assert record.position_m == tuple(tick.motion.position_m) == (-0.002,)
    assert record.velocity_m_per_s == tuple(tick.motion.velocity_m_per_s)
    assert record.force_n == tuple(tick.force_n)
    assert record.force_requested_n == tuple(tick.requested_n)
    assert record.force_n[0] > 0.0
    books = (record.energy_j, record.spring_energy_j, record.dissipated_j, record.generated_j)
    assert books == pytest.approx(rig.books_j, rel=1e-12)
    for known, contact in zip(record.walls, tick.contacts, strict=True):
        ledger = contact.ledger
        assert (known.in_contact, known.damping_n_s_per_m) == (contact.in_contact, contact.damping_n_s_per_m)
        assert (known.felt_mass_kg, known.cycle) == (contact.felt_mass_kg, ledger.cycle)
        assert (known.cycle_energy_j, known.cycle_generated_j) == (ledger.cycle_energy_j, ledger.cycle_generated_j)
        assert known.cycle_damping_n_s_per_m == ledger.cycle_damping_n_s_per_m
        assert known.cycle_duration_s == ledger.cycle_duration_s
    assert [known.in_contact for known in record.walls] == [True, False]
    assert record.walls[1].stiffness_n_per_m == 700.0, "a change over time is recorded as it comes into force"


def test_a_device_that_does_not_know_where_it_is_is_recorded_so() -> None:
    rig = Rig(wall(), arm=False)
    rig.sample.calibrated = False
    row = bytearray(rig.layout.size)
    rig.layout.pack(memoryview(row), 0, rig.tick, rig.sample, 0, 0, 0.0, 0.0, 0, 0)
    assert rig.layout.unpack(memoryview(row)).flags & Flag.UNCALIBRATED
