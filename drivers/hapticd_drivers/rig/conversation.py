"""What is said to a rig and what it answers: sequence numbers, latency, and what went wrong on the way."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Protocol, TypeVar

from hapticd.errors import DeviceDisconnectedError, DeviceProtocolError, DeviceTimeoutError, DriverError
from hapticd_drivers.rig import messages
from hapticd_drivers.rig.link import Link
from hapticd_drivers.rig.messages import Axis, Fault, Identity, Message, Pong, Refused, State, is_newer
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

HELLO_EVERY_S = 0.1
HELLO_PATIENCE_S = 4.0
"""A board that is reset when its port is opened is in its boot loader for up to 2 s [s]."""

ANSWER_S = 0.05
PATIENCE_S = 1.0
"""A question is asked anew when its answer has not come for so long, and the rig counts as silent after so long [s]."""

URGENT_S = 0.01
URGENT_PATIENCE_S = 0.04
"""The same where a loop waits for it, which may not miss many deadlines [s]."""

_REMEMBERED = 256  # commands whose time of sending is known
_WINDOW = (1 << 64) - 1  # of sequence numbers, to tell a repeated frame from a late one

AnswerT = TypeVar("AnswerT")


class Metered(Protocol):
    """Whoever keeps the metrics, which may move to other memory at any time."""

    metrics: memoryview[float]


class Conversation:
    """One rig at the other end of a link.

    Args:
        link: what carries the messages.
        meter: counts what went wrong.
        name: of the driver, which errors begin with.

    Attributes:
        identity: what the rig is, once it was greeted.
        fault: the last fault that it told, None before the first.
        unanswered: questions for a state since the last one came.
    """

    def __init__(self, link: Link, meter: Metered, name: str) -> None:
        self.link = link
        self.fault: Fault | None = None
        self.unanswered = 0
        self._meter = meter
        self._name = name
        self._sequence = time.monotonic_ns() & 0xFFFF  # of the next message; anything will do
        self._sent_ns = [0] * _REMEMBERED
        self._last = -1  # newest sequence number of the device
        self._seen = 0  # bit i: the number i before it has come
        self._echoed = -1
        self._damaged = 0
        self._unsent = 0
        self._device_counts: tuple[int, int, int] | None = None

    def greet(self) -> Identity:
        """Say hello until the rig says what it is.

        Raises:
            DeviceTimeoutError: it does not answer.
            DeviceProtocolError: it speaks another version.
        """
        end_s = time.monotonic() + HELLO_PATIENCE_S
        asked = set()
        while time.monotonic() < end_s:
            asked.add(self._sequence)
            self._send(messages.hello)
            for said in self._until(time.monotonic() + HELLO_EVERY_S):
                if isinstance(said, Identity) and said.echo in asked:
                    return said
                if isinstance(said, Refused) and said.reason == messages.WRONG_VERSION:
                    raise self._refused(said)
        raise DeviceTimeoutError(
            f"{self._name}: nothing on {self.link.where} answers as a rig does; is it switched on, with the firmware "
            "of docs/serial-rig.md or docs/hid-rig.md, and at the rate of device.options?"
        )

    def describe(self, axis: int) -> Axis:
        """Ask what an axis is.

        Raises:
            DriverError: the rig is silent, refuses or is gone.
        """
        return self._ask(
            lambda sequence: messages.describe(sequence, axis),
            lambda said: said if isinstance(said, Axis) and said.axis == axis else None,
        )

    def set_home(self, axis: int, home: int) -> Axis:
        """Tell the rig which count is the origin of an axis.

        Raises:
            DriverError: the rig is silent, refuses or is gone.
        """
        return self._ask(
            lambda sequence: messages.set_home(sequence, axis, home),
            lambda said: said if isinstance(said, Axis) and (said.axis, said.home) == (axis, home) else None,
        )

    def state(self) -> State:
        """Ask for the state as it is now.

        Raises:
            DriverError: the rig is silent or is gone.
        """
        return self._ask(lambda sequence: messages.poll(sequence, 0), _any_state)

    def enable(self, urgent: bool) -> State:
        """Ask for forces; the state says whether the rig lets them through.

        Args:
            urgent: a loop waits for it.

        Raises:
            DriverError: the rig is silent or is gone.
        """
        return self._ask(messages.enable, _any_state, urgent)

    def disable(self, urgent: bool) -> State:
        """Take the force away.

        Args:
            urgent: a loop waits for it.

        Raises:
            DriverError: the rig is silent or is gone.
        """
        return self._ask(
            messages.disable,
            lambda said: said if isinstance(said, State) and not said.flags & messages.ENABLED else None,
            urgent,
        )

    def round_trip_s(self) -> float:
        """How long the answer to a PING takes [s].

        Raises:
            DriverError: the rig is silent or is gone.
        """
        started_s = time.monotonic()
        self._ask(lambda sequence: messages.ping(sequence, 0), lambda said: said if isinstance(said, Pong) else None)
        return time.monotonic() - started_s

    def push(self, answer_after_us: int, force_un: list[int]) -> None:
        """Set the force, and ask for a state; does not wait for it.

        Raises:
            DeviceDisconnectedError: the link is gone.
        """
        sequence = self._sequence
        self._sequence = sequence + 1 & 0xFFFF
        self.unanswered += 1
        self._sent_ns[sequence % _REMEMBERED] = time.monotonic_ns()
        self.link.send(messages.force(sequence, answer_after_us, force_un))

    def poll(self, answer_after_us: int) -> None:
        """Ask for a state; does not wait for it.

        Raises:
            DeviceDisconnectedError: the link is gone.
        """
        self.unanswered += 1
        self._send(lambda sequence: messages.poll(sequence, answer_after_us))

    def ping(self) -> None:
        """Ask what the rig has counted; does not wait for it.

        Raises:
            DeviceDisconnectedError: the link is gone.
        """
        self._send(lambda sequence: messages.ping(sequence, 0))

    def newest(self) -> State | None:
        """The newest state that has come since the last call; None when there is none. Does not wait.

        Raises:
            DeviceDisconnectedError: the link is gone, or the rig has been switched off and on.
        """
        newest: State | None = None
        for said in self._heard():
            if type(said) is State:
                newest = said
            elif isinstance(said, Refused):
                if said.reason == messages.NO_HELLO:
                    raise self._refused(said)
                self._meter.metrics[UNKNOWN] += 1.0
        if newest is not None:
            self.unanswered = 0
            self._see_echo(newest.echo)
        return newest

    def await_state(self, timeout_s: float) -> State | None:
        """The newest state, waited for so long [s] at most; None when none has come.

        Raises:
            DeviceDisconnectedError: as `newest`.
        """
        state = self.newest()
        if state is None:
            end_ns = time.monotonic_ns() + round(timeout_s * 1e9)
            while state is None:
                left_ns = end_ns - time.monotonic_ns()
                if left_ns <= 0:
                    break
                self.link.wait(left_ns * 1e-9)
                state = self.newest()
        return state

    def _ask(
        self,
        make: Callable[[int], bytes],
        accept: Callable[[Message], AnswerT | None],
        urgent: bool = False,
    ) -> AnswerT:
        """Ask until there is an answer to this question, and not to an older one."""
        each_s, patience_s = (URGENT_S, URGENT_PATIENCE_S) if urgent else (ANSWER_S, PATIENCE_S)
        first = self._sequence
        end_s = time.monotonic() + patience_s
        while time.monotonic() < end_s:
            self._send(make)
            for said in self._until(time.monotonic() + each_s):
                if isinstance(said, Refused):
                    raise self._refused(said)
                answer = None if is_newer(first, said.echo) else accept(said)
                if answer is not None:
                    self.unanswered = 0
                    return answer
        raise DeviceTimeoutError(f"{self._name}: the rig on {self.link.where} did not answer within {patience_s:g} s")

    def _send(self, make: Callable[[int], bytes]) -> None:
        sequence = self._sequence
        self._sequence = sequence + 1 & 0xFFFF
        self._sent_ns[sequence % _REMEMBERED] = time.monotonic_ns()
        self.link.send(make(sequence))

    def _until(self, end_s: float) -> Iterator[Message]:
        """What is heard until some time, waiting."""
        while True:
            yield from self._heard()
            left_s = end_s - time.monotonic()
            if left_s <= 0.0:
                return
            self.link.wait(left_s)

    def _heard(self) -> list[Message]:
        """What has come in order since the last call; the rest is counted."""
        link = self.link
        heard = []
        for message in link.receive():
            said = messages.decode(message)
            if said is None:
                self._meter.metrics[UNKNOWN] += 1.0
            elif self._is_next(said):
                heard.append(said)
                if type(said) is Pong:
                    self._take_counts(said)
                elif type(said) is Fault:
                    self.fault = said
        if link.damaged != self._damaged:
            self._meter.metrics[DAMAGED] += float(link.damaged - self._damaged)
            self._damaged = link.damaged
        if link.unsent != self._unsent:
            self._meter.metrics[UNSENT] += float(link.unsent - self._unsent)
            self._unsent = link.unsent
        return heard

    def _is_next(self, said: Message) -> bool:
        """Whether a message is newer than all before it; gaps, and what is not newer, are counted."""
        ahead = said.sequence - self._last & 0xFFFF
        if self._last < 0:
            self._seen = 1
        elif 0 < ahead < 0x8000:
            self._seen = (self._seen << ahead | 1) & _WINDOW
            if ahead > 1:
                self._meter.metrics[LOST] += ahead - 1.0
        elif type(said) is Identity or (type(said) is Refused and said.reason == messages.NO_HELLO):
            self._seen = 1  # it has been switched off and on, and counts anew
        else:
            repeated = self._seen >> (-ahead & 0xFFFF) & 1
            self._meter.metrics[REPEATED if repeated else LATE] += 1.0
            return False
        self._last = said.sequence
        return True

    def _see_echo(self, echo: int) -> None:
        """Take the time from a command to its echo, once for each command."""
        if echo == self._echoed or self._sequence - echo & 0xFFFF > _REMEMBERED:
            return
        self._echoed = echo
        echo_us = (time.monotonic_ns() - self._sent_ns[echo % _REMEMBERED]) * 1e-3
        metrics = self._meter.metrics
        metrics[ECHO_US] = echo_us
        if echo_us > metrics[LONGEST_ECHO_US]:
            metrics[LONGEST_ECHO_US] = echo_us

    def _take_counts(self, pong: Pong) -> None:
        counts = (pong.lost, pong.damaged, pong.stale)
        if self._device_counts is not None:
            for place, now, before in zip(
                (COMMANDS_LOST, COMMANDS_DAMAGED, COMMANDS_STALE), counts, self._device_counts, strict=True
            ):
                self._meter.metrics[place] += float(now - before & 0xFFFF)
        self._device_counts = counts

    def _refused(self, said: Refused) -> DriverError:
        if said.reason == messages.NO_HELLO:
            return DeviceDisconnectedError(
                f"{self._name}: the rig on {self.link.where} has restarted, or was switched off and on"
            )
        return DeviceProtocolError(
            f"{self._name}: the rig on {self.link.where} refuses message 0x{said.type:02x}: "
            f"{messages.reason_text(said.reason)}"
        )


def _any_state(said: Message) -> State | None:
    return said if isinstance(said, State) else None
