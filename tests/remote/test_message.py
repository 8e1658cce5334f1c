"""What is let in is finite and within the limits; of what is refused, nothing is."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.config.ports import PortLimits
from hapticd.remote.message import (
    FARTHEST_M,
    FASTEST_TURN_RAD_PER_S,
    LARGEST_NUMBER,
    WrongMessageError,
    examine,
    merge,
)
from hapticd.tick.remote.update import (
    DAMPING,
    FORCE,
    ORIENTATION,
    POSITION,
    RELEASED,
    STIFFNESS,
    TURNING,
    VELOCITY,
    Update,
)
from tests.examples import examples
from tests.remote.heard import BALL, FIELD, TOOL, copied

KEYS = (
    "position_m", "velocity_m_per_s", "force_n", "orientation", "angular_velocity_rad_per_s", "stiffness_n_per_m",
    "damping_n_s_per_m", "seq", "sent_ns", "state_seq", "moved_seq", "name", "position", "\x00",
)  # fmt: skip
NUMBERS = st.one_of(st.floats(), st.integers(-(2**63), 2**64 - 1))
VALUES = st.one_of(
    NUMBERS, st.lists(NUMBERS, max_size=5), st.none(), st.booleans(), st.text(max_size=3), st.lists(st.none())
)


def said_all(update: Update) -> list[object]:
    return [getattr(update, name) for name in Update.__slots__]


def taken(port: PortLimits, axes: int = 1, **fields: Any) -> Update:
    update = Update()
    merge(examine({"seq": 1, **fields}, port, axes), update, 0)
    return update


@given(fields=st.dictionaries(st.sampled_from(KEYS), VALUES), port=st.sampled_from([TOOL, FIELD, BALL]))
@examples(300)
def test_whatever_comes_is_refused_whole_or_is_finite_and_within_limits(
    fields: dict[str, Any], port: PortLimits
) -> None:
    update = Update()
    before = said_all(copied(update))
    try:
        said = examine(fields, port, 2)
    except WrongMessageError:
        assert said_all(update) == before
        return
    merge(said, update, 0)
    vectors = (update.position_m, update.velocity_m_per_s, update.angular_velocity_rad_per_s, update.force_n)
    assert all(math.isfinite(number) for vector in (*vectors, update.orientation) for number in vector)
    assert math.hypot(*update.velocity_m_per_s) <= port.max_speed_m_per_s * (1.0 + 1e-12)
    assert math.hypot(*update.force_n) <= port.max_force_n * (1.0 + 1e-12)
    assert 0.0 <= update.stiffness_n_per_m <= port.stiffness_n_per_m
    assert 0.0 <= update.damping_n_s_per_m <= port.damping_n_s_per_m
    assert 0 <= update.seq < 2**62
    copied(update)  # it fits into its slot


@pytest.mark.parametrize(
    ("port", "fields", "text"),
    [
        (TOOL, {"position_m": [math.nan]}, "position_m: must be a finite number"),
        (TOOL, {"position_m": [0.0, 0.0]}, "position_m: must be a list of 1 numbers"),
        (TOOL, {"position_m": [10.5]}, "position_m: must be -10 to 10"),
        (TOOL, {"stiffness_n_per_m": 501.0}, "stiffness_n_per_m = 501: must be 0 to 500, as the configuration has it"),
        (
            TOOL, {"force_n": [1.0]},
            "tool is a coupling and has no force_n: it takes position_m, velocity_m_per_s, stiffness_n_per_m, "
            "damping_n_s_per_m",
        ),
        (FIELD, {"force_n": [True]}, "force_n: must be a finite number"),
        (BALL, {"position_m": [0.0]}, "position_m: must be a list of 3 numbers"),
        (BALL, {"orientation": [0.0, 0.0, 0.0, 0.0]}, "orientation: must be a quaternion w x y z, of length 1"),
        (TOOL, {"seq": -1}, "seq: must be a whole number, 0 or more"),
        (TOOL, {"moved_seq": 2}, "moved_seq = 2: must be at most seq = 1, the number of this message"),
        (TOOL, {"seq": None}, "seq: must be a whole number, 0 or more"),
    ],
)  # fmt: skip
def test_a_refusal_says_what_is_wrong(port: PortLimits, fields: dict[str, Any], text: str) -> None:
    with pytest.raises(WrongMessageError) as refused:
        taken(port, **fields)
    assert str(refused.value) == text


@pytest.mark.parametrize(
    ("port", "fields"),
    [
        (TOOL, {"stiffness_n_per_m": 0}),
        (TOOL, {"stiffness_n_per_m": 0.25}),
        (TOOL, {"stiffness_n_per_m": 500.0}),
        (TOOL, {"damping_n_s_per_m": 5.0}),
        (TOOL, {"position_m": [FARTHEST_M]}),
        (TOOL, {"position_m": (-FARTHEST_M,)}),
        (BALL, {"angular_velocity_rad_per_s": [FASTEST_TURN_RAD_PER_S, -FASTEST_TURN_RAD_PER_S, 0.0]}),
        (BALL, {"orientation": [1e-3, 0.0, 0.0, 0.0]}),
        (BALL, {"orientation": [0.0, 0.0, -1e3, 0.0]}),
        (TOOL, {"seq": 0}),
        (TOOL, {"seq": LARGEST_NUMBER - 1, "sent_ns": LARGEST_NUMBER - 1, "state_seq": LARGEST_NUMBER - 1}),
    ],
)
def test_what_is_just_within_a_limit_is_taken_as_it_is(port: PortLimits, fields: dict[str, Any]) -> None:
    said = examine({"seq": 1, **fields}, port, 1)
    update = taken(port, **fields)
    for key, value in fields.items():
        if key in ("seq", "sent_ns", "state_seq"):
            assert getattr(said, key) == value
        else:
            told = getattr(update, key)
            assert (told[: len(value)] if isinstance(value, list | tuple) else told) == (
                list(value) if isinstance(value, tuple) else value
            )


@pytest.mark.parametrize(
    ("port", "key", "value"),
    [
        (TOOL, "stiffness_n_per_m", -1e-9),
        (TOOL, "damping_n_s_per_m", 5.001),
        (TOOL, "position_m", [10.001]),
        (TOOL, "position_m", [-10.001]),
        (TOOL, "position_m", [True]),
        (TOOL, "position_m", "0"),
        (TOOL, "position_m", 0.0),
        (TOOL, "position_m", []),
        (TOOL, "orientation", [1.0, 0.0, 0.0, 0.0]),
        (BALL, "force_n", [1.0, 0.0, 0.0]),
        (BALL, "orientation", [1.0, 0.0, 0.0]),
        (BALL, "orientation", [0.9e-3, 0.0, 0.0, 0.0]),
        (BALL, "orientation", [1.1e3, 0.0, 0.0, 0.0]),
        (BALL, "angular_velocity_rad_per_s", [0.0, -100.1, 0.0]),
        (FIELD, "force_n", [math.inf]),
        (FIELD, "x" * 100, 1),
    ],
)
def test_what_is_just_beyond_a_limit_is_refused_and_its_key_named(port: PortLimits, key: str, value: object) -> None:
    with pytest.raises(WrongMessageError) as refused:
        examine({"seq": 1, key: value}, port, 1)
    assert refused.value.key == key[:40]


@pytest.mark.parametrize("key", ["seq", "sent_ns", "state_seq", "moved_seq"])
@pytest.mark.parametrize("value", [-1, LARGEST_NUMBER, True, 1.0, "1", None])
def test_what_is_no_number_of_a_message_is_refused(key: str, value: object) -> None:
    with pytest.raises(WrongMessageError, match=f"{key}: must be a whole number, 0 or more"):
        examine({"seq": 1, key: value}, TOOL, 1)


def test_a_message_that_does_not_say_when_and_to_what_it_was_sent_says_nothing_of_that() -> None:
    said = examine({"name": "tool", "seq": 4}, TOOL, 1)
    assert (said.seq, said.sent_ns, said.state_seq, said.moved_seq, said.values, said.bits) == (4, 0, -1, 4, {}, 0)


def test_each_key_is_said_by_a_bit_of_its_own() -> None:
    said = [
        taken(TOOL, position_m=[0.1]).said,
        taken(TOOL, velocity_m_per_s=[0.1]).said,
        taken(TOOL, stiffness_n_per_m=1.0).said,
        taken(TOOL, damping_n_s_per_m=1.0).said,
        taken(FIELD, force_n=[0.1]).said,
        taken(BALL, orientation=[1, 0, 0, 0]).said,
        taken(BALL, angular_velocity_rad_per_s=[0, 0, 1]).said,
    ]
    assert said == [POSITION, VELOCITY, STIFFNESS, DAMPING, FORCE, ORIENTATION, TURNING]
    assert len({*said, RELEASED}) == 8


def test_a_velocity_beyond_the_limit_keeps_its_direction() -> None:
    assert taken(TOOL, axes=2, velocity_m_per_s=[-3.0, 4.0]).velocity_m_per_s[:2] == pytest.approx([-0.6, 0.8])
    assert taken(TOOL, axes=2, velocity_m_per_s=[0.6, 0.7]).velocity_m_per_s[:2] == [0.6, 0.7]
    assert taken(TOOL, axes=2, velocity_m_per_s=[0.9, -0.9]).velocity_m_per_s[:2] == pytest.approx(
        [0.5**0.5, -(0.5**0.5)]
    )
    assert taken(BALL, axes=1, velocity_m_per_s=[0.0, 0.0, 2.0]).velocity_m_per_s == [0.0, 0.0, 1.0]


def test_a_force_beyond_the_limit_keeps_its_direction() -> None:
    assert taken(FIELD, axes=2, force_n=[30.0, -40.0]).force_n[:2] == pytest.approx([1.2, -1.6])
    assert taken(FIELD, force_n=[1e308]).force_n[0] == pytest.approx(2.0)
    assert taken(FIELD, force_n=[1]).force_n[0] == 1.0
    largest = [1.7e308, 0.0, -1.7e308]
    assert taken(FIELD, axes=3, force_n=largest).force_n == pytest.approx([2.0**0.5, 0.0, -(2.0**0.5)])


def test_what_was_said_before_stays_but_for_the_velocity_of_another_place() -> None:
    update = Update()
    merge(examine({"seq": 1, "position_m": [0.1], "velocity_m_per_s": [0.5]}, TOOL, 1), update, 0)
    merge(examine({"seq": 2, "stiffness_n_per_m": 100}, TOOL, 1), update, 0)
    assert update.said == POSITION | VELOCITY | STIFFNESS
    assert (update.position_m[0], update.velocity_m_per_s[0], update.stiffness_n_per_m) == (0.1, 0.5, 100.0)
    merge(examine({"seq": 3, "position_m": [0.2]}, TOOL, 1), update, 0)
    assert update.said == POSITION | STIFFNESS
    assert update.seq == 3


def test_a_turn_belongs_to_its_orientation() -> None:
    update = Update()
    pose = {"orientation": [1, 0, 0, 0], "angular_velocity_rad_per_s": [0, 0, 1]}
    merge(examine({"seq": 1, **pose}, BALL, 3), update, 0)
    assert update.said == ORIENTATION | TURNING
    merge(examine({"seq": 2, "orientation": [0, 1, 0, 0]}, BALL, 3), update, 0)
    assert update.said == ORIENTATION


def test_who_speaks_again_has_not_let_go() -> None:
    update = Update()
    update.said = RELEASED | FORCE
    merge(examine({"seq": 1, "force_n": [1.0]}, FIELD, 1), update, 0)
    assert update.said == FORCE
