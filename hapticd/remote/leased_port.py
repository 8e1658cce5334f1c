"""A port with the client that owns it, and what was counted of it."""

from __future__ import annotations

import hashlib
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hapticd.config.ports import PortLimits
from hapticd.remote.delays import DelayHistogram
from hapticd.remote.message import LARGEST_NUMBER, examine, merge
from hapticd.tick.remote.update import RELEASED, Update

_REMEMBERED = 64


@dataclass(frozen=True, slots=True)
class Sender:
    """Who has sent a message.

    Attributes:
        identity: of its connection, as ZeroMQ has it.
        descriptor: of its connection.
        inode: of its connection, since a descriptor may be another connection's soon after.
        local: it is on this computer, so that its CLOCK_MONOTONIC is ours.
        name: for people.
    """

    identity: bytes
    descriptor: int
    inode: int
    local: bool
    name: str


class NotTakenError(Exception):
    """A message that is not for its sender to send."""


class LeasedPort:
    """A port of the scene.

    Args:
        limits: what it is.
        lease_s: how long a client that says nothing keeps it [s].
        update: what whoever heard clients before has heard of it last; None: nothing.

    Attributes:
        limits: what it is.
        lease_s: how long a client that says nothing keeps it [s].
        update: all that its owner has said, or the last one where it has none.
        owner: the client that it belongs to; None: to none.
        since_ns: since when the loop has it, and sums what it does [ns of CLOCK_MONOTONIC].
        messages: taken.
        late: messages that were passed over: behind a newer one, older than `hold_s`, or of a client that had gone.
        refused: messages that were not taken.
        ages: from a message's sending to the end of the tick that it was first in force at.
        round_trips: from the tick whose state a message answers to the tick that it was first in force at.
    """

    def __init__(self, limits: PortLimits, lease_s: float, update: Update | None = None) -> None:
        self.limits = limits
        self.lease_s = lease_s
        self.update = Update() if update is None else update
        self.owner: Sender | None = None
        self.since_ns = time.monotonic_ns()
        self.messages = 0
        self.late = 0
        self.refused = 0
        self.ages = DelayHistogram()
        self.round_trips = DelayHistogram()
        self._under_way: deque[tuple[int, int, int]] = deque(maxlen=_REMEMBERED)
        self._in_force = -1

    def owner_at(self, now_ns: int) -> Sender | None:
        """Whom the port belongs to now."""
        if self.owner is not None and now_ns - self.update.received_ns > self.lease_s * 1e9:
            self.owner = None
        return self.owner

    def take(self, fields: Mapping[str, Any], sender: Sender, axes: int, now_ns: int) -> bool:
        """Take a message; whether there is something new for the loop.

        Args:
            fields: the message.
            sender: who sent it; a port without an owner is its from now on.
            axes: of the device.
            now_ns: CLOCK_MONOTONIC [ns].

        Raises:
            NotTakenError: the port belongs to another client.
            WrongMessageError: something in it cannot be.
        """
        owner = self.owner_at(now_ns)
        if owner is not None and owner.identity != sender.identity:
            raise NotTakenError(
                f"{self.limits.name} belongs to {owner.name}, until it lets go or is silent for {self.lease_s:g} s"
            )
        if fields.get("release") is True:
            return self._release(now_ns)
        said = examine(fields, self.limits, axes)
        if owner is None:
            self._begin(sender, said.seq)
        self.owner = sender  # who has another connection by now, perhaps
        self.update.received_ns = now_ns  # a message that is late shows that its sender lives
        if said.seq <= self.update.seq:
            self.late += 1
            return False
        merge(said, self.update, now_ns)
        known = sender.local and 0 < said.sent_ns <= now_ns
        self.update.sent_ns = said.sent_ns if known else 0
        if known and now_ns - said.sent_ns > self.limits.hold_s * 1e9:  # the loop does not go by it, but later ones may
            self.late += 1
            return True
        self.messages += 1
        self._under_way.append((said.seq, self.update.sent_ns or now_ns, said.state_seq))
        return True

    def now_in_force(self, seq: int, tick: int, done_ns: int, period_ns: int) -> None:
        """Learn which message a tick was done with.

        Args:
            seq: the client's number of it.
            tick: number of the tick.
            done_ns: when the tick was done [ns of CLOCK_MONOTONIC].
            period_ns: between ticks [ns].
        """
        if seq == self._in_force:
            return
        self._in_force = seq
        while self._under_way and self._under_way[0][0] <= seq:
            number, sent_ns, state_seq = self._under_way.popleft()
            if number == seq:
                self.ages.add(done_ns - sent_ns)
                if 0 <= state_seq <= tick:
                    self.round_trips.add((tick - state_seq) * period_ns)

    def _begin(self, sender: Sender, seq: int) -> None:
        """Have another owner, with nothing said, or the last one once more, which goes on.

        It does where its lease had ended, or where another process has heard it before.
        """
        client = _number_of(sender)
        if client == self.update.client and seq > self.update.seq and not self.update.said & RELEASED:
            return
        self.update = Update()
        self.update.client = client
        self._under_way.clear()

    def _release(self, now_ns: int) -> bool:
        """Have the loop let go, of what a client whose lease has ended holds as well; whether it is yet to be told."""
        if self.update.said & RELEASED:
            return False
        self.owner = None
        self.update.said |= RELEASED
        self.update.seq = min(self.update.seq + 1, LARGEST_NUMBER)
        self.update.received_ns = now_ns
        self.update.sent_ns = 0
        return True


def _number_of(sender: Sender) -> int:
    """A number for a client, never 0, which is the same for whoever hears it."""
    return int.from_bytes(hashlib.blake2b(sender.identity, digest_size=8).digest(), "little") >> 1 | 1
