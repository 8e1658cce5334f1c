"""An update comes out of shared memory as it went in, and lies there as its page says."""

from __future__ import annotations

import struct

from hypothesis import given
from hypothesis import strategies as st

from hapticd.tick.remote.update import (
    DAMPING,
    FORCE,
    ORIENTATION,
    PACKED_BYTES,
    POSITION,
    RELEASED,
    SLOT_BYTES,
    STIFFNESS,
    TURNING,
    VELOCITY,
    Update,
    pack,
    unpack,
)

WORDS = st.integers(-(1 << 63), (1 << 63) - 1)
NUMBERS = st.floats(allow_nan=False)
VECTORS = st.lists(NUMBERS, min_size=3, max_size=3)


@st.composite
def updates(draw: st.DrawFn) -> Update:
    update = Update()
    for name in ("said", "seq", "sent_ns", "received_ns", "position_ns", "velocity_ns", "orientation_ns", "turning_ns"):
        setattr(update, name, draw(WORDS))
    update.client, update.moved_seq = draw(WORDS), draw(WORDS)
    for name in ("position_m", "velocity_m_per_s", "angular_velocity_rad_per_s", "force_n"):
        setattr(update, name, draw(VECTORS))
    update.orientation = draw(st.lists(NUMBERS, min_size=4, max_size=4))
    update.stiffness_n_per_m = draw(NUMBERS)
    update.damping_n_s_per_m = draw(NUMBERS)
    return update


def fields(update: Update) -> dict[str, object]:
    return {name: getattr(update, name) for name in Update.__slots__}


@given(update=updates(), at=st.integers(0, 3 * SLOT_BYTES))
def test_an_update_comes_back_as_it_was_and_touches_nothing_beside_its_place(update: Update, at: int) -> None:
    area = bytearray(b"\xa5" * 4 * SLOT_BYTES)
    pack(update, memoryview(area), at)
    again = Update()
    position_m = again.position_m
    unpack(memoryview(area), at, again)
    assert fields(again) == fields(update)
    assert again.position_m is position_m
    assert set(area[:at] + area[at + PACKED_BYTES :]) <= {0xA5}


def test_an_update_lies_as_numbers_of_eight_bytes_little_end_first() -> None:
    row = struct.pack(
        "<10q18d", 71, 17, 5_000, 6_000, 6_001, 6_002, 6_003, 6_004, 99, 16, *[float(number) for number in range(18)]
    )
    assert len(row) == PACKED_BYTES <= SLOT_BYTES - 16
    update = Update()
    unpack(row, 0, update)
    assert fields(update) == {
        "said": 71,
        "seq": 17,
        "sent_ns": 5_000,
        "received_ns": 6_000,
        "position_ns": 6_001,
        "velocity_ns": 6_002,
        "orientation_ns": 6_003,
        "turning_ns": 6_004,
        "client": 99,
        "moved_seq": 16,
        "position_m": [0.0, 1.0, 2.0],
        "velocity_m_per_s": [3.0, 4.0, 5.0],
        "angular_velocity_rad_per_s": [6.0, 7.0, 8.0],
        "force_n": [9.0, 10.0, 11.0],
        "orientation": [12.0, 13.0, 14.0, 15.0],
        "stiffness_n_per_m": 16.0,
        "damping_n_s_per_m": 17.0,
    }


def test_each_thing_that_may_be_said_has_a_bit_of_its_own() -> None:
    bits = [POSITION, ORIENTATION, VELOCITY, TURNING, STIFFNESS, DAMPING, FORCE, RELEASED]
    assert bits == [1 << at for at in range(8)]


def test_nothing_is_said_in_a_new_update_and_every_number_is_newer() -> None:
    assert fields(Update()) == {
        "said": 0,
        "seq": -1,
        "sent_ns": 0,
        "received_ns": 0,
        "position_ns": 0,
        "velocity_ns": 0,
        "orientation_ns": 0,
        "turning_ns": 0,
        "client": 0,
        "moved_seq": -1,
        "position_m": [0.0] * 3,
        "velocity_m_per_s": [0.0] * 3,
        "angular_velocity_rad_per_s": [0.0] * 3,
        "force_n": [0.0] * 3,
        "orientation": [1.0, 0.0, 0.0, 0.0],
        "stiffness_n_per_m": 0.0,
        "damping_n_s_per_m": 0.0,
    }
