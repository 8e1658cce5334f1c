"""What clients say of each port of the scene, in shared memory: one process writes it, the loop reads it.

A slot a port:

    counter, odd while the slot is being written | list of ports that it is for | the update

The word `REMOTE` counts the updates written, so that a tick in which there was none compares one number. `list_of`
numbers the list of ports that an update is for, the same on either side: after a reload an update for the list before
is not taken for another name. Which of the two sides goes over to another list first is not known: until the other one
has, an update for the list before is for the port that goes on under its name. An update for any other list is passed
over.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence

import msgpack

from hapticd.loop.memory import MOST_PORTS, PORTS, PORTS_SINCE, REMOTE, SharedMemory
from hapticd.tick.remote.port import Port
from hapticd.tick.remote.update import SLOT_BYTES, Update, pack, unpack

_WORDS = SLOT_BYTES // 8
_UPDATE = 16
"""Where the update lies in a slot [bytes]."""


def list_of(ports: Iterable[tuple[str, str]]) -> int:
    """A number for a list of ports, never 0.

    Args:
        ports: name and kind of each, in the order of the scene.
    """
    said: bytes = msgpack.packb([list(each) for each in ports])
    return int.from_bytes(hashlib.blake2b(said, digest_size=8).digest(), "little") >> 1 | 1


class SlotReader:
    """The loop's side.

    Args:
        shared: the memory.

    Attributes:
        seen: the word `REMOTE` as it was when everything up to then was taken.
    """

    def __init__(self, shared: SharedMemory) -> None:
        self.seen = 0
        self._shared = shared
        self._area = shared.remote
        self._words = shared.remote_words
        self._counters = [0] * MOST_PORTS
        self._ports: Sequence[Port] = ()
        self._list = 0
        self._heirs: list[Port | None] = []  # of the ports of the list before
        self._list_before = 0
        self._update = Update()

    def serve(self, ports: Sequence[Port], now_ns: int) -> None:
        """Take updates for these ports from now on; of what was written before only what has yet to be taken.

        Args:
            ports: in the order of the scene.
            now_ns: deadline of the tick under way, which is recorded by now [ns of CLOCK_MONOTONIC].
        """
        number = list_of((port.name, port.kind) for port in ports)
        if number != self._list:
            self.take(now_ns)
            goes_on = {(port.name, port.kind): port for port in ports}
            self._heirs = [goes_on.get((port.name, port.kind)) for port in self._ports]
            self._list_before = self._list
            for index in range(MOST_PORTS):  # clients that have gone may have said it
                self._counters[index] = self._words[index * _WORDS]
            self._shared.words[PORTS_SINCE] = now_ns
        self._ports = ports
        self._list = number
        self._shared.words[PORTS] = number

    def take(self, now_ns: int) -> None:
        """Hand each port what was said of it since the last time; what is just being written waits for the next.

        Args:
            now_ns: CLOCK_MONOTONIC, by which it is known how old what was said is [ns].
        """
        written = self._shared.words[REMOTE]
        words = self._words
        counters = self._counters
        update = self._update
        whole = True
        for index in range(max(len(self._ports), len(self._heirs))):
            at = index * _WORDS
            counter = words[at]
            if counter == counters[index]:
                continue
            meant = words[at + 1]
            if not counter & 1:
                unpack(self._area, index * SLOT_BYTES + _UPDATE, update)
            if counter & 1 or words[at] != counter:
                whole = False
                continue
            counters[index] = counter
            port = self._meant(meant, index)
            if port is not None:
                port.take(update, max(0.0, (now_ns - (update.sent_ns or update.received_ns)) * 1e-9))
        if whole:
            self.seen = written

    def _meant(self, ports_list: int, index: int) -> Port | None:
        """The port that an update for a list is for."""
        ports: Sequence[Port | None] = ()
        if ports_list == self._list:
            ports = self._ports
        elif ports_list == self._list_before:
            ports = self._heirs
        return ports[index] if index < len(ports) else None


class SlotWriter:
    """The other side.

    What one that died had begun to write is put right, for no port: the loop would look at it again each tick.

    Args:
        shared: the memory.
        ports: name and kind of each, in the order of the scene.

    Attributes:
        ports_list: the number of their list.
    """

    def __init__(self, shared: SharedMemory, ports: Iterable[tuple[str, str]]) -> None:
        self.ports_list = list_of(ports)
        self._shared = shared
        self._area = shared.remote
        self._words = shared.remote_words
        for at in range(0, MOST_PORTS * _WORDS, _WORDS):
            if self._words[at] & 1:
                self._words[at + 1] = 0
                self._words[at] += 1
                shared.words[REMOTE] += 1

    def recorded(self, deadline_ns: int) -> bool:
        """Whether the loop has the same list of ports, and had it in a tick that was due then [ns]."""
        return self._shared.words[PORTS] == self.ports_list and self._shared.words[PORTS_SINCE] < deadline_ns

    def written(self, index: int) -> Update | None:
        """What was said of a port last, whoever wrote it; None: nothing, or with another list of ports.

        Args:
            index: which one.
        """
        if self._words[index * _WORDS + 1] != self.ports_list:
            return None
        update = Update()
        unpack(self._area, index * SLOT_BYTES + _UPDATE, update)
        return update

    def write(self, index: int, update: Update) -> None:
        """Say something of a port.

        Args:
            index: which one.
            update: all that was said of it.
        """
        words = self._words
        at = index * _WORDS
        counter = words[at]
        words[at] = counter + 1
        words[at + 1] = self.ports_list
        pack(update, self._area, index * SLOT_BYTES + _UPDATE)
        words[at] = counter + 2
        self._shared.words[REMOTE] += 1
