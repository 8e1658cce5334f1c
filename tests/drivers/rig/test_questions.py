"""When a rig is asked what, how often and for how long, and which answer counts: on a clock of the test's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from struct import pack
from types import SimpleNamespace
from typing import Any

import pytest

from hapticd.device import MOST_METRICS
from hapticd.errors import DeviceProtocolError, DeviceTimeoutError
from hapticd_drivers.rig import messages
from hapticd_drivers.rig.conversation import Conversation
from hapticd_drivers.rig.messages import AXIS, ENABLED, FAULT, IDENTITY, PONG, REFUSED, STATE, VERSION

Answer = Callable[[int, int], bytes]
"""A message of the rig: its own number, and the number that it answers."""


def closed(kind: int, layout: str, *values: Any) -> bytes:
    body = pack(f"<BB{layout}", VERSION, kind, *values)
    return body + messages.checksum(body).to_bytes(2, "little")


def axis(index: int, home: int) -> Answer:
    return lambda number, echo: closed(AXIS, "HHIBIIiii", number, echo, 9, index, 1000, 5, -400, 400, home)


def state(flags: int) -> Answer:
    return lambda number, echo: closed(STATE, "HHIBBHii", number, echo, 9, flags, 0, 0, 7, 0)


def pong(number: int, echo: int) -> bytes:
    return closed(PONG, "HHIIIHHH", number, echo, 9, 0, 8, 0, 0, 0)


def identity(number: int, echo: int) -> bytes:
    return closed(IDENTITY, "HHIBBBBHH3B16s12s", number, echo, 9, 1, 0, 0, 0, 20, 4, 1, 2, 3, b"rig", b"7")


def fault(number: int, echo: int) -> bytes:
    return closed(FAULT, "HHIBBi", number, echo, 9, 3, 0, 0)


@dataclass(frozen=True)
class Question:
    """What is asked, and what is to come of it.

    Attributes:
        ask: asks it.
        message: as it is sent, by its number.
        every_s: after how long it is sent anew [s].
        patience_s: after how long the rig counts as silent [s].
        right: the answer.
        wrong: what is none.
    """

    ask: Callable[[Conversation], Any]
    message: Callable[[int], bytes]
    every_s: float
    patience_s: float
    right: Answer
    wrong: Sequence[Answer]


QUESTIONS = {
    "greet": Question(Conversation.greet, messages.hello, 0.1, 4.0, identity, [state(0), pong, axis(0, 0)]),
    "describe": Question(
        lambda rig: rig.describe(2), lambda n: messages.describe(n, 2), 0.05, 1.0, axis(2, 0), [axis(1, 0), state(0)]
    ),
    "set home": Question(
        lambda rig: rig.set_home(1, -70),
        lambda n: messages.set_home(n, 1, -70),
        0.05,
        1.0,
        axis(1, -70),
        [axis(1, 70), axis(0, -70), state(0)],
    ),
    "state": Question(Conversation.state, lambda n: messages.poll(n, 0), 0.05, 1.0, state(0), [pong, fault]),
    "enable": Question(lambda rig: rig.enable(False), messages.enable, 0.05, 1.0, state(ENABLED), [pong]),
    "enable at once": Question(lambda rig: rig.enable(True), messages.enable, 0.01, 0.04, state(0), [pong]),
    "disable": Question(lambda rig: rig.disable(False), messages.disable, 0.05, 1.0, state(0), [state(ENABLED), pong]),
    "disable at once": Question(
        lambda rig: rig.disable(True), messages.disable, 0.01, 0.04, state(0), [state(ENABLED)]
    ),
    "ping": Question(Conversation.round_trip_s, lambda n: messages.ping(n, 0), 0.05, 1.0, pong, [state(0)]),
}


class Timed:
    """A link on which answers take their time.

    Attributes:
        answers: to each question that is sent, what comes after how long [s]; by how many were sent and its number.
        sent: when [s], what.
    """

    where = "a script"
    notes: tuple[str, ...] = ()
    damaged = 0
    unsent = 0

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_ns = 100_000_000_000
        self.answers: Callable[[int, int], list[tuple[float, bytes]]] = lambda _count, _number: []
        self.sent: list[tuple[float, bytes]] = []
        self._due: list[tuple[int, bytes]] = []
        clock = SimpleNamespace(monotonic=lambda: self.now_ns * 1e-9, monotonic_ns=lambda: self.now_ns)
        monkeypatch.setattr("hapticd_drivers.rig.conversation.time", clock)

    @property
    def passed_s(self) -> float:
        return (self.now_ns - 100_000_000_000) * 1e-9

    def send(self, message: bytes) -> None:
        self.sent.append((self.passed_s, message))
        number = int.from_bytes(message[2:4], "little")
        for after_s, answer in self.answers(len(self.sent), number):
            self._due.append((self.now_ns + round(after_s * 1e9), answer))

    def receive(self) -> list[bytes]:
        come = [message for at_ns, message in self._due if at_ns <= self.now_ns]
        self._due = [each for each in self._due if each[0] > self.now_ns]
        return come

    def wait(self, timeout_s: float) -> None:
        end_ns = self.now_ns + round(timeout_s * 1e9) + 1
        self.now_ns = min([end_ns, *(at_ns for at_ns, _ in self._due)])

    def close(self) -> None: ...


class Rig:
    """A conversation over such a link."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.link = Timed(monkeypatch)
        self.metrics = memoryview(bytearray(8 * MOST_METRICS)).cast("d")
        self.conversation = Conversation(self.link, self, "rig")
        self.first = self.conversation._sequence


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Rig:
    return Rig(monkeypatch)


def asked(rig: Rig, question: Question, count: int) -> None:
    """So many questions were sent, each in its time and with a number of its own."""
    assert [at_s for at_s, _ in rig.link.sent] == pytest.approx(
        [question.every_s * at for at in range(count)], abs=1e-6
    )
    assert [said for _, said in rig.link.sent] == [question.message(rig.first + at & 0xFFFF) for at in range(count)]


@pytest.mark.parametrize("name", QUESTIONS)
def test_a_silent_rig_is_asked_again_and_again_and_then_given_up(rig: Rig, name: str) -> None:
    question = QUESTIONS[name]
    with pytest.raises(DeviceTimeoutError):
        question.ask(rig.conversation)
    asked(rig, question, round(question.patience_s / question.every_s))
    assert rig.link.passed_s == pytest.approx(question.patience_s, abs=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.7, 1.6])
@pytest.mark.parametrize("name", QUESTIONS)
def test_the_answer_counts_when_it_comes_also_after_the_question_was_sent_anew(
    rig: Rig, name: str, share: float
) -> None:
    """The first question was lost; what answers the second comes after a share of the time between two."""
    question = QUESTIONS[name]

    def answers(count: int, number: int) -> list[tuple[float, bytes]]:
        return [(share * question.every_s, question.right(5, number))] if count == 2 else []

    rig.link.answers = answers
    said = question.ask(rig.conversation)
    came_s = (1.0 + share) * question.every_s
    assert rig.link.passed_s == pytest.approx(came_s, abs=1e-6)
    asked(rig, question, 2 + int(share))
    expected = came_s if name == "ping" else messages.decode(question.right(5, rig.first + 1 & 0xFFFF))
    assert said == (pytest.approx(expected, abs=1e-6) if name == "ping" else expected)
    assert rig.conversation.unanswered == 0


@pytest.mark.parametrize("name", QUESTIONS)
def test_what_is_no_answer_or_one_to_a_question_of_before_is_passed_over(rig: Rig, name: str) -> None:
    question = QUESTIONS[name]
    old = rig.first - 1 & 0xFFFF

    def answers(count: int, number: int) -> list[tuple[float, bytes]]:
        told = [(0.0, wrong(10 * count + at, number)) for at, wrong in enumerate(question.wrong)]
        told.append((0.0, question.right(10 * count + 8, old)))
        return [*told, (0.0, question.right(10 * count + 9, number))] if count == 3 else told

    rig.link.answers = answers
    question.ask(rig.conversation)
    asked(rig, question, 3)


@pytest.mark.parametrize("name", [name for name in QUESTIONS if name != "greet"])
def test_a_refusal_ends_the_asking_and_says_why(rig: Rig, name: str) -> None:
    rig.link.answers = lambda _count, number: [(0.0, closed(REFUSED, "HHIBB", 4, number, 9, 3, 0x42))]
    with pytest.raises(DeviceProtocolError, match=r"refuses message 0x42"):
        QUESTIONS[name].ask(rig.conversation)
    asked(rig, QUESTIONS[name], 1)


def test_states_are_asked_for_after_the_time_that_is_said(rig: Rig) -> None:
    rig.conversation.poll(350)
    rig.conversation.push(120, [5, -6])
    rig.conversation.ping()
    first = rig.first
    assert [said for _, said in rig.link.sent] == [
        messages.poll(first, 350),
        messages.force(first + 1 & 0xFFFF, 120, [5, -6]),
        messages.ping(first + 2 & 0xFFFF, 0),
    ]
    assert rig.conversation.unanswered == 2
