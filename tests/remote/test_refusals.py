"""Each client hears of its first refusal at once and then of the last one of each second."""

from __future__ import annotations

import pytest

from hapticd.remote.refusals import QUIET_NS, Refusal, Refusals

ME, OTHER = b"me", b"other"


class Told:
    """What clients were told."""

    def __init__(self) -> None:
        self.said: list[tuple[bytes, str]] = []
        self.refusals = Refusals(lambda who, refusal: self.said.append((who, refusal.text)))

    def refuse(self, who: bytes, text: str, at_s: float, *, passing: bool = False) -> None:
        self.refusals.add(who, Refusal("tool", text, passing=passing), round(at_s * QUIET_NS))

    def pass_time(self, to_s: float) -> None:
        self.refusals.turn(round(to_s * QUIET_NS))


@pytest.fixture
def told() -> Told:
    return Told()


def test_the_first_refusal_of_each_client_is_told_at_once(told: Told) -> None:
    told.refuse(ME, "one", 5.0)
    told.refuse(OTHER, "two", 5.1)
    assert told.said == [(ME, "one"), (OTHER, "two")]


def test_what_is_refused_within_the_second_is_told_at_its_end_once_and_the_last_of_it(told: Told) -> None:
    for tenth in range(9):
        told.refuse(ME, f"{tenth}", 5.0 + 0.1 * tenth)
    told.pass_time(5.99)
    assert told.said == [(ME, "0")]
    told.pass_time(6.0)
    told.pass_time(6.01)
    assert told.said == [(ME, "0"), (ME, "8")]
    told.refuse(ME, "later", 6.5)
    told.pass_time(6.9)
    assert len(told.said) == 2, "the end of a second is an answer as well"
    for second in (7.0, 8.0, 9.0):
        told.pass_time(second)
    assert [text for _, text in told.said] == ["0", "8", "later"]


def test_who_has_the_name_by_now_is_not_told_that_it_was_another_ones(told: Told) -> None:
    told.refuse(ME, "belongs to another", 5.0, passing=True)
    told.refuse(ME, "belongs to another", 5.5, passing=True)
    told.refusals.taken(ME, "tool")
    told.pass_time(7.0)
    assert len(told.said) == 1


def test_who_was_taken_since_is_told_all_the_same_what_was_wrong_before(told: Told) -> None:
    told.refuse(ME, "not finite", 5.0)
    told.refuse(ME, "too stiff", 5.5)
    told.refusals.taken(ME, "tool")
    told.pass_time(7.0)
    assert told.said == [(ME, "not finite"), (ME, "too stiff")]


def test_what_waits_when_a_newer_one_is_told_at_once_is_not_told_behind_it(told: Told) -> None:
    for text, at_s in (("one", 5.0), ("two", 5.5), ("three", 6.2)):
        told.refuse(ME, text, at_s)
    told.pass_time(8.0)
    assert [text for _, text in told.said] == ["one", "three"]


def test_no_more_clients_are_remembered_than_so_many(told: Told) -> None:
    for number in range(2000):
        told.refuse(b"%d" % number, "no", 5.0)
        told.refuse(b"%d" % number, "no again", 5.0)
    told.pass_time(6.0)
    assert len(told.said) == 2000 + 512


def test_of_many_clients_the_one_that_was_told_the_longest_ago_is_forgotten(told: Told) -> None:
    for number in range(512):
        told.refuse(b"%d" % number, "no", 5.0)
    told.refuse(b"0", "no", 6.0)
    told.refuse(ME, "no", 6.0)  # one too many: it is not the first any more that is the oldest
    before = len(told.said)
    told.refuse(b"0", "within its second", 6.5)
    told.refuse(b"2", "and its second is over", 6.5)
    told.refuse(b"1", "forgotten", 5.5)
    assert told.said[before:] == [(b"2", "and its second is over"), (b"1", "forgotten")]
