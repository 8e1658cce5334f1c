"""What is counted of a rig's answers, and what is waited for: on a link that says what the test has it say."""

from __future__ import annotations

import itertools
from collections import deque
from struct import Struct

import pytest

from hapticd.device import MOST_METRICS
from hapticd_drivers.rig import messages
from hapticd_drivers.rig.conversation import Conversation
from hapticd_drivers.rig.metrics import LATE, LOST, REPEATED, UNKNOWN

_STATE = Struct("<BBHHIBBHii")


class Scripted:
    """A link: what it hears at each look, and what it was sent."""

    where = "a script"
    notes: tuple[str, ...] = ()
    damaged = 0
    unsent = 0

    def __init__(self) -> None:
        self.heard: deque[list[bytes]] = deque()
        self.waits_s: list[float] = []

    def send(self, message: bytes) -> None: ...

    def receive(self) -> list[bytes]:
        return self.heard.popleft() if self.heard else []

    def wait(self, timeout_s: float) -> None:
        self.waits_s.append(timeout_s)

    def close(self) -> None: ...


class Meter:
    """Keeps metrics."""

    def __init__(self) -> None:
        self.metrics = memoryview(bytearray(8 * MOST_METRICS)).cast("d")


class Talk:
    """A conversation over a script."""

    def __init__(self) -> None:
        self.link = Scripted()
        self.meter = Meter()
        self.conversation = Conversation(self.link, self.meter, "rig")

    def hears(self, *sequences: int) -> list[int]:
        """States with these numbers, each for itself; which of them were taken."""
        taken = []
        for sequence in sequences:
            self.link.heard.append([state(sequence)])
            found = self.conversation.newest()
            if found is not None:
                taken.append(found.sequence)
        return taken

    @property
    def counts(self) -> tuple[float, ...]:
        """Lost, late, repeated and unknown."""
        return tuple(self.meter.metrics[at] for at in (LOST, LATE, REPEATED, UNKNOWN))


def state(sequence: int, echo: int = 0) -> bytes:
    body = _STATE.pack(messages.VERSION, messages.STATE, sequence, echo, 0, 0, 0, 0, 7, 0)
    message = body + messages.checksum(body).to_bytes(2, "little")
    assert messages.is_intact(message)
    assert isinstance(messages.decode(message), messages.State)
    return message


@pytest.fixture
def talk() -> Talk:
    return Talk()


def test_a_frame_that_comes_again_is_repeated_and_one_that_was_missing_is_late(talk: Talk) -> None:
    assert talk.hears(10, 11, 13) == [10, 11, 13]
    assert talk.counts == (1.0, 0.0, 0.0, 0.0)
    assert talk.hears(13, 11, 10) == []
    assert talk.counts == (1.0, 0.0, 3.0, 0.0)
    assert talk.hears(12) == []
    assert talk.counts == (1.0, 1.0, 3.0, 0.0)


def test_what_came_long_ago_counts_as_late_and_not_as_repeated(talk: Talk) -> None:
    """What is remembered of the past is 64 frames."""
    assert talk.hears(*range(100)) == list(range(100))
    assert talk.hears(36) == []
    assert talk.counts[1:3] == (0.0, 1.0)
    assert talk.hears(35) == []
    assert talk.counts[1:3] == (1.0, 1.0)


def test_after_number_zero_numbers_are_in_order_as_after_any_other(talk: Talk) -> None:
    assert talk.hears(0, 1, 0, 2) == [0, 1, 2]
    assert talk.counts == (0.0, 0.0, 1.0, 0.0)


def test_numbers_go_on_from_zero_after_the_last_one(talk: Talk) -> None:
    assert talk.hears(0xFFFE, 0xFFFF, 0, 1, 0xFFFF) == [0xFFFE, 0xFFFF, 0, 1]
    assert talk.counts == (0.0, 0.0, 1.0, 0.0)


def test_half_the_circle_ahead_is_behind(talk: Talk) -> None:
    assert talk.hears(0, 0x7FFF) == [0, 0x7FFF]
    assert talk.hears(0xFFFF) == []
    assert talk.counts[:2] == (0x7FFE, 1.0)


def test_what_cannot_be_decoded_is_counted_and_passed_over(talk: Talk) -> None:
    other_version = bytes([messages.VERSION + 1]) + state(5)[1:]
    other_type = state(5)[:1] + b"\x7f" + state(5)[2:]
    talk.link.heard.append([other_version, state(6), other_type])
    found = talk.conversation.newest()
    assert found is not None
    assert found.sequence == 6
    assert talk.counts == (0.0, 0.0, 0.0, 2.0)


def test_a_state_that_has_not_come_is_waited_for(talk: Talk) -> None:
    talk.link.heard.extend([[], [], [state(3)]])
    found = talk.conversation.await_state(5.0)
    assert found is not None
    assert found.sequence == 3
    assert len(talk.link.waits_s) == 2
    assert 0.0 < talk.link.waits_s[1] <= talk.link.waits_s[0] <= 5.0


def test_one_that_is_there_is_not_waited_for(talk: Talk) -> None:
    talk.link.heard.append([state(3)])
    assert talk.conversation.await_state(5.0) is not None
    assert talk.link.waits_s == []


def test_none_is_waited_for_longer_than_was_asked(talk: Talk, monkeypatch: pytest.MonkeyPatch) -> None:
    clock_ns = itertools.count(0, 1_000_000)
    monkeypatch.setattr("hapticd_drivers.rig.conversation.time.monotonic_ns", lambda: next(clock_ns))
    assert talk.conversation.await_state(0.0035) is None
    assert len(talk.link.waits_s) == 3
