"""The pages that look: each has a queue of its own, and one that does not read loses its connection, no other does."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import struct
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

MOST_VIEWERS = 32
"""Pages at the same time."""

MOST_UNSENT = 300
"""Messages that wait for one viewer, ten seconds of them; at one more it is disconnected and may come again."""

KERNEL_BYTES = 128 * 1024
"""What the kernel may keep for one viewer, beside that."""

_NO_FAREWELL = struct.pack("ii", 1, 0)  # SO_LINGER: a connection that is given up frees what the kernel keeps for it

Message = dict[str, Any] | bytes


class Viewer:
    """One page.

    Args:
        connection: its WebSocket.

    Attributes:
        may_command: it has shown the token.
    """

    def __init__(self, connection: ServerConnection) -> None:
        self.may_command = False
        self._connection = connection
        self._queue: asyncio.Queue[str | bytes] = asyncio.Queue()
        self._socket().setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, KERNEL_BYTES)

    def send(self, message: str | bytes) -> None:
        """Have a message sent; returns at once."""
        if self._queue.qsize() >= MOST_UNSENT:
            with contextlib.suppress(OSError):  # it has gone by itself
                self._socket().setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _NO_FAREWELL)
            self._connection.transport.abort()
        else:
            self._queue.put_nowait(message)

    def answer(self, message: dict[str, Any]) -> None:
        """The same, of a message for this page alone."""
        self.send(encoded(message))

    async def run(self) -> None:
        """Send what there is until the page has gone."""
        try:
            while True:
                await self._connection.send(await self._queue.get())
        except ConnectionClosed:
            pass

    def _socket(self) -> Any:
        return self._connection.transport.get_extra_info("socket")


class Audience:
    """All viewers that have been let in."""

    def __init__(self) -> None:
        self._viewers: set[Viewer] = set()

    def __len__(self) -> int:
        return len(self._viewers)

    def join(self, viewer: Viewer, past: list[Message]) -> None:
        """Send a viewer the past, and from now on what comes."""
        for message in past:
            viewer.send(encoded(message))
        self._viewers.add(viewer)

    def leave(self, viewer: Viewer) -> None:
        """Send it nothing more."""
        self._viewers.discard(viewer)

    def send(self, message: Message) -> None:
        """Send a message to all; returns at once."""
        if self._viewers:
            whole = encoded(message)
            for viewer in self._viewers:
                viewer.send(whole)


def encoded(message: Message) -> str | bytes:
    """A message as it is sent: ticks are binary, all else is JSON."""
    return message if isinstance(message, bytes) else json.dumps(message, separators=(",", ":"), allow_nan=False)
