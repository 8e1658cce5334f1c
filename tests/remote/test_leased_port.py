"""One owner a name: the first to speak, until it lets go or falls silent; of its messages the newest."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from hapticd.remote.leased_port import LeasedPort, NotTakenError, Sender
from hapticd.remote.message import LARGEST_NUMBER, WrongMessageError
from hapticd.tick.remote.update import POSITION, RELEASED, STIFFNESS, VELOCITY
from tests.remote.heard import TOOL, copied

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


def test_one_whose_lease_has_ended_lets_go_all_the_same(port: LeasedPort) -> None:
    """The loop may hold it on, for `hold_s`: leaving the `with` of a client left 2.9 N."""
    say(port, ONE, 0, 1)
    assert port.owner_at(1500 * MS) is None
    assert port.take({"release": True}, ONE, 1, 1500 * MS)
    assert port.update.said & RELEASED
    assert not port.take({"release": True}, ONE, 1, 1501 * MS)
    assert say(port, ONE, 1502, 2)


def test_a_release_is_handed_on_by_one_that_has_heard_nothing_before(port: LeasedPort) -> None:
    """As after a start anew: what was said to the one before may be in force."""
    assert port.take({"release": True}, ONE, 1, MS)
    assert port.update.said == RELEASED


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


def test_a_message_older_than_it_holds_counts_as_late_and_what_it_says_is_kept(port: LeasedPort) -> None:
    """A client that says each thing once has said it all the same."""
    hold_ms = round(1e3 * TOOL.hold_s)
    assert say(port, ONE, 1 + hold_ms, 1, sent_ns=MS)
    assert (port.messages, port.late) == (1, 0)
    assert port.take({"seq": 2, "stiffness_n_per_m": 10.0, "sent_ns": MS}, ONE, 1, (2 + hold_ms) * MS)
    assert (port.messages, port.late) == (1, 1)
    assert port.update.said == POSITION | STIFFNESS
    port.now_in_force(2, 7, (3 + hold_ms) * MS, MS)
    assert sum(port.ages.counts) == 0
    assert say(port, AFAR, 5000, 1, sent_ns=MS)
    assert (port.messages, port.late) == (2, 1), "its clock is another one"


@pytest.mark.parametrize("old_s", [9, 11, 3600])
def test_a_message_is_late_however_old_it_is(port: LeasedPort, old_s: int) -> None:
    """One that had waited for a daemon that was away for more than 10 s pushed as if it had just been said."""
    now_ms = 10_000_000
    assert say(port, ONE, now_ms, 1, sent_ns=(now_ms - 1000 * old_s) * MS)
    assert (port.messages, port.late) == (0, 1)
    assert port.update.sent_ns == (now_ms - 1000 * old_s) * MS, "the loop sees how old it is"


def test_motion_has_the_time_at_which_it_was_said_first(port: LeasedPort) -> None:
    def said() -> tuple[int, int]:
        return port.update.position_ns // MS, port.update.velocity_ns // MS

    say(port, ONE, 1, 1, velocity_m_per_s=[0.1])
    assert said() == (1, 1)
    port.take({"seq": 2, "stiffness_n_per_m": 10.0}, ONE, 1, 2 * MS)
    assert said() == (1, 1)
    say(port, ONE, 3, 3, velocity_m_per_s=[0.1], moved_seq=1)
    assert said() == (1, 1)
    port.take({"seq": 4, "velocity_m_per_s": [0.2]}, ONE, 1, 4 * MS)
    assert said() == (1, 4)
    say(port, ONE, 5, 6, velocity_m_per_s=[0.1], moved_seq=5)  # what said it first was lost
    assert said() == (5, 5)
    say(port, TWO, 2000, 1, velocity_m_per_s=[0.1])
    assert said() == (2000, 2000)


def heard_by_another(port: LeasedPort) -> LeasedPort:
    """The same port after the process that hears clients was started anew."""
    return LeasedPort(TOOL, LEASE_S, copied(port.update))


def test_a_process_that_is_started_anew_knows_what_its_client_only_repeats(port: LeasedPort) -> None:
    say(port, ONE, 1, 1, velocity_m_per_s=[0.1], stiffness_n_per_m=100.0)
    again = heard_by_another(port)
    assert again.owner_at(2 * MS) is None, "who comes first has the name, as ever"
    assert say(again, ONE, 500, 2, position_m=[0.001], velocity_m_per_s=[0.1], moved_seq=1)
    assert (again.update.position_ns, again.update.velocity_ns) == (MS, MS)
    assert again.update.said == POSITION | VELOCITY | STIFFNESS, "what it leaves out stays as it was said"
    assert say(again, ONE, 501, 3, velocity_m_per_s=[0.1])
    assert (again.update.position_ns, again.update.velocity_ns) == (501 * MS, 501 * MS)


@pytest.mark.parametrize(
    ("who", "seq", "releases"),
    [(TWO, 3, False), (ONE, 2, False), (ONE, 4, True)],
    ids=["another client", "one that counts from the beginning", "one that had let go"],
)
def test_who_is_another_begins_with_nothing_said_after_a_start_anew(
    port: LeasedPort, who: Sender, seq: int, releases: bool
) -> None:
    say(port, ONE, 1, 2, stiffness_n_per_m=100.0)
    if releases:
        port.take({"release": True}, ONE, 1, 2 * MS)
    again = heard_by_another(port)
    assert say(again, who, 500, seq, moved_seq=1)
    assert (again.update.said, again.update.position_ns) == (POSITION, 500 * MS)


def test_one_whose_lease_has_ended_goes_on_where_no_other_has_come(port: LeasedPort) -> None:
    """`hold_s` may be longer than the lease: its target, still under way, was thrown back by a softer spring."""
    say(port, ONE, 1, 1, velocity_m_per_s=[0.1])
    assert port.owner_at(1500 * MS) is None
    assert say(port, ONE, 1500, 2, position_m=[0.001], velocity_m_per_s=[0.1], moved_seq=1)
    assert (port.update.position_ns, port.update.velocity_ns) == (MS, MS)
    assert say(port, TWO, 3000, 3, moved_seq=1)
    assert (port.update.said, port.update.position_ns) == (POSITION, 3000 * MS)


def test_a_velocity_that_was_said_alone_leaves_the_place_of_before_what_it_was(port: LeasedPort) -> None:
    """A message that repeats both took the target back to a place that it had left."""
    say(port, ONE, 1, 1)
    port.take({"seq": 2, "velocity_m_per_s": [0.2]}, ONE, 1, 2 * MS)
    say(port, ONE, 3, 3, velocity_m_per_s=[0.2], moved_seq=2)
    assert (port.update.position_ns, port.update.velocity_ns) == (MS, 2 * MS)


def test_letting_go_is_told_and_frees_the_name(port: LeasedPort) -> None:
    say(port, ONE, 0, 5, stiffness_n_per_m=100.0)
    with pytest.raises(NotTakenError):
        port.take({"release": True}, TWO, 1, MS)
    assert port.take({"release": True}, ONE, 1, MS)
    assert port.update.said == POSITION | STIFFNESS | RELEASED
    assert (port.update.seq, port.update.received_ns, port.update.sent_ns) == (6, MS, 0), "it is news for the loop"
    assert port.owner_at(MS) is None
    assert not port.take({"release": True}, ONE, 1, 2 * MS), "it has nothing to let go"
    assert say(port, TWO, 2, 1)


def test_the_last_number_that_there_is_stays_when_the_name_is_let_go(port: LeasedPort) -> None:
    say(port, ONE, 0, LARGEST_NUMBER - 1, position_m=[0.0], sent_ns=1)
    assert port.take({"release": True}, ONE, 1, MS)
    assert port.update.seq == LARGEST_NUMBER
    assert port.update.sent_ns == 0
    assert copied(port.update).seq == LARGEST_NUMBER, "it fits into its slot"


def test_what_was_in_force_when_the_name_is_let_go_is_counted_all_the_same(port: LeasedPort) -> None:
    """The tick that was done with it is read a moment later."""
    for seq, state_seq in ((1, 0), (2, 1)):
        say(port, ONE, 0, seq, state_seq=state_seq)
    port.take({"release": True}, ONE, 1, MS)
    port.now_in_force(2, 2, 2 * MS, MS)
    port.now_in_force(3, 3, 3 * MS, MS)
    assert (sum(port.ages.counts), sum(port.round_trips.counts)) == (1, 1)


@pytest.mark.parametrize("says", [False, 1, "yes", None])
def test_only_true_lets_go(port: LeasedPort, says: object) -> None:
    say(port, ONE, 0, 1)
    with pytest.raises(WrongMessageError, match="has no release"):
        port.take({"seq": 2, "release": says}, ONE, 1, MS)
    assert port.owner_at(MS) is ONE


def test_the_owner_is_who_has_spoken_last_under_its_identity(port: LeasedPort) -> None:
    again = replace(ONE, descriptor=11, inode=110)
    say(port, ONE, 0, 1)
    say(port, again, 1, 2)
    assert port.owner_at(MS) is again
    assert port.owner_at(1001 * MS) is again
    assert port.owner_at(1001 * MS + 1) is None


def test_of_the_messages_under_way_the_newest_are_remembered_and_none_of_another_owner(port: LeasedPort) -> None:
    for seq in range(1, 101):
        say(port, ONE, 0, seq, state_seq=0)
    port.now_in_force(20, 1, MS, MS)
    assert sum(port.ages.counts) == 0
    for seq in range(101, 165):
        say(port, ONE, 0, seq, state_seq=0)
    port.now_in_force(101, 2, MS, MS)
    assert sum(port.ages.counts) == 1, "the oldest of 64"
    port.now_in_force(101, 3, MS, MS)
    assert sum(port.ages.counts) == 1
    assert say(port, TWO, 2000, 163)
    port.now_in_force(163, 2001, 2001 * MS, MS)
    assert sum(port.ages.counts) == 2
    assert sum(port.round_trips.counts) == 1, "the other one's answered a state, this one's none"


def test_a_message_waits_to_be_in_force_while_a_larger_number_of_the_owner_before_still_is(port: LeasedPort) -> None:
    say(port, ONE, 0, 900)
    port.now_in_force(900, 1, MS, MS)
    assert say(port, TWO, 1500, 1)
    port.now_in_force(900, 1501, 1501 * MS, MS)
    port.now_in_force(1, 1502, 1502 * MS, MS)
    assert sum(port.ages.counts) == 2


@pytest.mark.parametrize(("state_seq", "counts"), [(0, 1), (101, 1), (102, 0)])
def test_a_tick_that_is_still_to_come_has_not_been_answered(port: LeasedPort, state_seq: int, counts: int) -> None:
    say(port, ONE, 100, 1, state_seq=state_seq)
    port.now_in_force(1, 101, 101 * MS, MS)
    assert sum(port.round_trips.counts) == counts


@pytest.mark.parametrize(("before_ns", "known"), [(-1, False), (0, True), (10**10, True), (20 * 10**9 - 1, True)])
def test_a_time_of_sending_that_cannot_be_is_not_believed(port: LeasedPort, before_ns: int, known: bool) -> None:
    now_ns = 20_000 * MS
    say(port, ONE, 20_000, 1, sent_ns=now_ns - before_ns)
    assert port.update.sent_ns == (now_ns - before_ns if known else 0)


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
