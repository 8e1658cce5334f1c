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
    told.pass_time(7.0)
    assert told.said[-1] == (ME, "later")


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


def test_no_more_clients_are_remembered_than_so_many(told: Told) -> None:
    for number in range(2000):
        told.refuse(b"%d" % number, "no", 5.0)
        told.refuse(b"%d" % number, "no again", 5.0)
    told.pass_time(6.0)
    assert len(told.said) < 2000 + 600
