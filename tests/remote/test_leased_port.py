"""One owner a name: the first to speak, until it lets go or falls silent; of its messages the newest."""

from __future__ import annotations

from typing import Any

import pytest

from hapticd.remote.leased_port import LeasedPort, NotTakenError, Sender
from hapticd.remote.message import WrongMessageError
from hapticd.tick.remote.update import POSITION, RELEASED, STIFFNESS
from tests.remote.heard import TOOL

ONE = Sender(b"one", 7, 70, True, "user 1000, process 1")
TWO = Sender(b"two", 8, 80, True, "user 1000, process 2")
AFAR = Sender(b"afar", 9, 90, False, "anna at 10.0.0.2")
MS = 1_000_000
LEASE_S = 1.0


@pytest.fixture
def port() -> LeasedPort:
    return LeasedPort(TOOL, LEASE_S)


def say(port: LeasedPort, who: Sender, at_ms: int, seq: int, **fields: Any) -> bool:
    return port.take({"seq": seq, "position_m": [0.001 * seq], **fields}, who, 1, at_ms * MS)


def test_the_first_to_speak_owns_the_name_until_it_has_been_silent_for_long(port: LeasedPort) -> None:
    assert say(port, ONE, 0, 1)
    with pytest.raises(NotTakenError, match="tool belongs to user 1000, process 1, until it lets go or is silent"):
        say(port, TWO, 999, 50)
    assert port.update.position_m[0] == 0.001
    assert say(port, ONE, 999, 2)
    with pytest.raises(NotTakenError):
        say(port, TWO, 1900, 50)
    assert say(port, TWO, 2000, 50)
    assert port.owner_at(2000 * MS) is TWO
    with pytest.raises(NotTakenError):
        say(port, ONE, 2001, 3)


def test_another_owner_begins_with_nothing_said(port: LeasedPort) -> None:
    say(port, ONE, 0, 900, stiffness_n_per_m=100.0)
    assert say(port, TWO, 1500, 1)
    assert port.update.said == POSITION
    assert port.update.seq == 1


def test_a_message_behind_a_newer_one_is_passed_over_and_shows_that_its_sender_lives(port: LeasedPort) -> None:
    say(port, ONE, 0, 5)
    assert not say(port, ONE, 900, 5)
    assert not say(port, ONE, 1800, 4)
    assert (port.messages, port.late) == (1, 2)
    assert port.update.position_m[0] == 0.005
    with pytest.raises(NotTakenError):
        say(port, TWO, 2700, 1)


def test_letting_go_is_told_and_frees_the_name(port: LeasedPort) -> None:
    say(port, ONE, 0, 5, stiffness_n_per_m=100.0)
    with pytest.raises(NotTakenError):
        port.take({"release": True}, TWO, 1, MS)
    assert port.take({"release": True}, ONE, 1, MS)
    assert port.update.said == POSITION | STIFFNESS | RELEASED
    assert port.owner_at(MS) is None
    assert not port.take({"release": True}, ONE, 1, 2 * MS), "it has nothing to let go"
    assert say(port, TWO, 2, 1)


def test_what_is_refused_makes_no_owner_and_keeps_none(port: LeasedPort) -> None:
    with pytest.raises(WrongMessageError):
        say(port, ONE, 0, 1, position_m=[float("nan")])
    assert port.owner_at(0) is None
    say(port, ONE, 0, 1)
    with pytest.raises(WrongMessageError):
        say(port, ONE, 900, 2, position_m=[float("nan")])
    assert port.update.seq == 1
    assert port.owner_at(1500 * MS) is None


def test_age_and_round_trip_are_counted_once_a_message_that_came_into_force(port: LeasedPort) -> None:
    say(port, ONE, 100, 1, sent_ns=97 * MS, state_seq=90)
    say(port, ONE, 101, 2, sent_ns=98 * MS, state_seq=91)
    for tick in (102, 103):
        port.now_in_force(2, tick, tick * MS, MS)
    assert port.ages.counts == [0, 0, 0, 0, 0, 1, *[0] * 6]  # 4 ms
    assert port.round_trips.counts == [0, 0, 0, 0, 0, 0, 1, *[0] * 5]  # 11 ticks


def test_the_clock_of_another_computer_is_not_compared_with_ours(port: LeasedPort) -> None:
    say(port, AFAR, 100, 1, sent_ns=97 * MS)
    assert port.update.sent_ns == 0
    port.now_in_force(1, 101, 101 * MS, MS)
    assert port.ages.counts[3] == 1  # 1 ms since it came
    port.take({"seq": 2, "sent_ns": 10**18}, AFAR, 1, 102 * MS)
    assert port.update.sent_ns == 0
