"""What is counted of a rig's answers, and what is waited for: on a link that says what the test has it say."""

from __future__ import annotations

import itertools
from collections import deque
from struct import Struct
from types import SimpleNamespace

import pytest

from hapticd.device import MOST_METRICS
from hapticd.errors import DeviceDisconnectedError, DeviceProtocolError, DeviceTimeoutError
from hapticd_drivers.rig import messages
from hapticd_drivers.rig.conversation import Conversation
from hapticd_drivers.rig.metrics import (
    COMMANDS_DAMAGED,
    COMMANDS_LOST,
    COMMANDS_STALE,
    DAMAGED,
    ECHO_US,
    LATE,
    LONGEST_ECHO_US,
    LOST,
    REPEATED,
    UNKNOWN,
    UNSENT,
)

_STATE = Struct("<BBHHIBBHii")
_PONG = Struct("<BBHHIIIHHH")
_REFUSED = Struct("<BBHHIBB")


class Scripted:
    """A link: what it hears at each look, and what it was sent."""

    where = "a script"
    notes: tuple[str, ...] = ()
    damaged = 0
    unsent = 0

    def __init__(self) -> None:
        self.heard: deque[list[bytes]] = deque()
        self.waits_s: list[float] = []
        self.sent: list[bytes] = []

    def send(self, message: bytes) -> None:
        self.sent.append(message)

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
    """T9."""
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
    """T9."""
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
    """T9."""
    other_version = bytes([messages.VERSION + 1]) + state(5)[1:]
    other_type = state(5)[:1] + b"\x7f" + state(5)[2:]
    talk.link.heard.append([other_version, state(6), other_type])
    found = talk.conversation.newest()
    assert found is not None
    assert found.sequence == 6
    assert talk.counts == (0.0, 0.0, 0.0, 2.0)


def test_a_state_that_has_not_come_is_waited_for(talk: Talk) -> None:
    """T9."""
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


class Answering(Scripted):
    """A link on which each question is answered: with states of these flags, one question later each."""

    def __init__(self, *flags: int) -> None:
        super().__init__()
        self.flags = deque(flags)
        self.asked: list[tuple[int, int]] = []

    def send(self, message: bytes) -> None:
        sequence = int.from_bytes(message[2:4], "little")
        self.asked.append((message[1], sequence))
        if self.flags:
            number = len(self.asked)
            self.heard.append([with_flags(number, sequence, self.flags.popleft())])


def refused(sequence: int, reason: int, of: int) -> bytes:
    body = _REFUSED.pack(messages.VERSION, messages.REFUSED, sequence, 0, 0, reason, of)
    return body + messages.checksum(body).to_bytes(2, "little")


def with_flags(sequence: int, echo: int, flags: int) -> bytes:
    body = _STATE.pack(messages.VERSION, messages.STATE, sequence, echo, 0, flags, 0, 0, 7, 0)
    return body + messages.checksum(body).to_bytes(2, "little")


def test_the_force_is_gone_when_a_state_says_so_and_not_before() -> None:
    """Asked again until then, with a number of its own each time."""
    link = Answering(messages.ENABLED, messages.ENABLED, 0)
    conversation = Conversation(link, Meter(), "rig")
    assert conversation.disable(urgent=False).flags == 0
    assert [kind for kind, _ in link.asked] == [messages.DISABLE] * 3
    first = link.asked[0][1]
    assert [sequence for _, sequence in link.asked] == [first + number & 0xFFFF for number in range(3)]


def test_a_rig_that_keeps_its_force_is_given_up() -> None:
    conversation = Conversation(Answering(*[messages.ENABLED] * 3), Meter(), "rig")
    with pytest.raises(DeviceTimeoutError, match=r"a script did not answer within 0\.04 s"):
        conversation.disable(urgent=True)


def test_an_answer_to_an_older_question_is_none() -> None:
    link = Scripted()
    conversation = Conversation(link, Meter(), "rig")
    older = conversation._sequence - 1 & 0xFFFF
    link.heard.append([with_flags(1, older, 0)])
    with pytest.raises(DeviceTimeoutError):
        conversation.enable(urgent=True)


def test_what_the_link_has_counted_since_is_added_once(talk: Talk) -> None:
    talk.link.damaged, talk.link.unsent = 3, 5
    talk.hears(1)
    talk.link.damaged, talk.link.unsent = 4, 5
    talk.hears(2, 3)
    assert (talk.meter.metrics[DAMAGED], talk.meter.metrics[UNSENT]) == (4.0, 5.0)


def test_the_rigs_own_counts_are_added_from_the_second_pong_on(talk: Talk) -> None:
    """They run on over 65536, and what was there before the greeting is no loss of this conversation's."""
    for number, counts in enumerate([(65530, 1, 2), (3, 1, 4), (4, 2, 4)]):
        body = _PONG.pack(messages.VERSION, messages.PONG, number, 0, 0, 0, 0, *counts)
        talk.link.heard.append([body + messages.checksum(body).to_bytes(2, "little")])
        talk.conversation.newest()
    found = [talk.meter.metrics[at] for at in (COMMANDS_LOST, COMMANDS_DAMAGED, COMMANDS_STALE)]
    assert found == [10.0, 1.0, 2.0]


def test_a_rig_that_was_switched_off_and_on_counts_anew(talk: Talk) -> None:
    assert talk.hears(500, 501) == [500, 501]
    talk.link.heard.append([refused(0, messages.NO_HELLO, messages.POLL)])
    with pytest.raises(DeviceDisconnectedError, match="has restarted, or was switched off and on"):
        talk.conversation.newest()
    assert talk.hears(1, 2) == [1, 2]
    assert talk.counts == (0.0, 0.0, 0.0, 0.0)


def test_the_echo_of_a_command_is_timed_once_and_the_longest_is_kept(
    talk: Talk, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = SimpleNamespace(now_ns=1_000_000_000)
    monkeypatch.setattr("hapticd_drivers.rig.conversation.time.monotonic_ns", lambda: clock.now_ns)
    metrics = talk.meter.metrics
    numbers = itertools.count(1)

    def echoed(back: int, after_us: int) -> tuple[float, float]:
        """A state that answers the command so many before the newest, so much later."""
        clock.now_ns += after_us * 1000
        echo = talk.conversation._sequence - 1 - back & 0xFFFF
        talk.link.heard.append([state(next(numbers), echo)])
        assert talk.conversation.newest() is not None
        return metrics[ECHO_US], metrics[LONGEST_ECHO_US]

    talk.conversation.push(0, [0])
    assert echoed(0, 300) == (300.0, 300.0)
    assert echoed(0, 900) == (300.0, 300.0)  # the same once more
    talk.conversation.poll(0)
    assert echoed(0, 200) == (200.0, 300.0)
    for _ in range(300):
        talk.conversation.push(0, [0])
    assert echoed(256, 100) == (200.0, 300.0)  # too old to know when it was sent
    assert echoed(255, 150) == (250.0, 300.0)
    talk.conversation.ping()
    assert echoed(3, 400) == (650.0, 650.0)


def test_questions_without_an_answer_are_counted_until_one_comes(talk: Talk) -> None:
    talk.conversation.push(0, [0])
    talk.conversation.poll(0)
    assert talk.conversation.unanswered == 2
    talk.hears(4)
    assert talk.conversation.unanswered == 0


def test_a_rig_of_another_version_is_told_at_once_and_what_else_it_refuses_is_not_the_answer(talk: Talk) -> None:
    talk.link.heard += [
        [refused(1, messages.NO_HELLO, messages.POLL)],
        [refused(2, messages.WRONG_VERSION, messages.HELLO)],
    ]
    with pytest.raises(DeviceProtocolError, match="it speaks another version of the protocol"):
        talk.conversation.greet()
    assert not talk.link.heard


def test_a_rig_is_asked_for_its_counts_without_a_delay(talk: Talk) -> None:
    number = talk.conversation._sequence
    talk.conversation.ping()
    assert talk.link.sent == [messages.ping(number, 0)]
