"""The state of the device and of each port, one frame a tick, for those who answer it: an XPUB."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgpack
import zmq

from hapticd.keys.connections import descriptor_of, has_ended, inode_of
from hapticd.keys.store import KeyRing
from hapticd.remote.bound_socket import BoundSocket

_MOST_AT_ONCE = 100
_LARGEST_REQUEST = 128  # bytes of a subscription; ZeroMQ keeps forty times that for each
_LARGEST_WITH_KEYS = 1024  # the handshake is longer, and who it lets in is listed
_MOST_UNREAD = 10
_MOST_WAITING = 1000  # ticks, for a subscriber that is busy, before it loses the next


class StateSocket:
    """The state socket.

    Args:
        path: where it lies.
        tcp: its TCP endpoint; None for none.
        ring: the keys that this takes.

    Attributes:
        subscribed: inodes of subscribers' connections, by descriptor; without any no tick is worth telling.

    Raises:
        InstanceError: it cannot be bound.
    """

    def __init__(self, path: Path, tcp: str | None, ring: KeyRing | None) -> None:
        self.subscribed: dict[int, int] = {}
        self._packer = msgpack.Packer(autoreset=True)
        self._bound = BoundSocket(
            zmq.XPUB,
            path,
            None if tcp is None else (tcp, "remote.state_tcp"),
            ring,
            watch_only=True,
            largest=_LARGEST_REQUEST if tcp is None else _LARGEST_WITH_KEYS,
            unread=_MOST_UNREAD,
            options={zmq.SNDHWM: _MOST_WAITING, zmq.XPUB_VERBOSER: 1},
        )

    def admit(self, ring: KeyRing | None) -> None:
        """Take other keys over."""
        self._bound.admit(ring)

    def turn(self) -> None:
        """Look at who has come or gone. Returns at once."""
        self._bound.turn()
        for _ in range(_MOST_AT_ONCE):
            if not self._bound.waits():
                return
            request = self._bound.socket.recv(zmq.NOBLOCK, copy=False)
            said, client = request.bytes, descriptor_of(request)
            if said == b"\x01":
                self.subscribed[client] = inode_of(client)
                self._bound.connections.heard(client)
            elif said == b"\x00" and client >= 0:  # ZeroMQ hands on what was never subscribed to as well
                self.subscribed.pop(client, None)
            elif said == b"\x00":  # of one that has gone
                self.subscribed = {one: of for one, of in self.subscribed.items() if not has_ended(one, of)}
            elif said[:1] == b"\x01":
                self._bound.connections.odd(client)

    def send(self, state: dict[str, Any]) -> None:
        """Tell a tick; a subscriber that is too slow loses it."""
        self._bound.socket.send(self._packer.pack(state), zmq.NOBLOCK)

    def close(self) -> None:
        """Let go of the path."""
        self._bound.close()
