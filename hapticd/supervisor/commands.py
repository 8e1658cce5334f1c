"""The control socket: requests from this computer, and from others with keys, each with a way to answer it.

A request is one msgpack map with the key `do`; the answer is one with `ok` and `text`. What is not understood is
refused by name, and nothing that arrives can raise.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import msgpack
import zmq

from hapticd.errors import InstanceError
from hapticd.keys.connections import ConnectionBound, descriptor_of, local_peer
from hapticd.keys.frames import FrameReader
from hapticd.keys.heartbeat import expect_signs_of_life
from hapticd.keys.local_bind import bind_local
from hapticd.keys.server import CurveServer
from hapticd.keys.store import KeyRing
from hapticd.own_file import OwnFile
from hapticd.paths import why_refused

_LARGEST_REQUEST = 1 << 13  # bytes of a frame
_MOST_UNREAD = 100  # requests of a client
_MOST_AT_ONCE = 50
_LAST_WORDS_MS = 100

Reply = Callable[..., None]
"""Call with ok, text and further fields of the answer."""


class Request(NamedTuple):
    """A request that has come.

    Attributes:
        fields: what it says.
        reply: how to answer it.
        who: asks, for people.
    """

    fields: dict[str, Any]
    reply: Reply
    who: str


class CommandSocket:
    """A ROUTER on the instance's runtime directory, and on a TCP endpoint for those that have a key.

    Args:
        path: where the socket lies; its directory decides who may reach it.
        tcp: the TCP endpoint; None for none.
        ring: the keys that it takes.

    Attributes:
        refused: requests that were answered with no.

    Raises:
        InstanceError: it cannot be bound.
    """

    def __init__(self, path: Path, tcp: str | None = None, ring: KeyRing | None = None) -> None:
        if path.exists() and not path.is_socket():  # ZeroMQ would put its socket over it
            raise InstanceError(f"ipc://{path}: a file that is no socket is in the way; remove it")
        self._file: OwnFile | None = None
        self._names = _names(ring)
        self.refused = 0
        self._gate: CurveServer | None = None
        self._context = zmq.Context(io_threads=1)
        self._socket = self._context.socket(zmq.ROUTER)
        self._socket.setsockopt(zmq.LINGER, _LAST_WORDS_MS)
        self._connections = ConnectionBound(self._socket, keep_heard=False)  # `hapticd disarm` always gets in
        self._frames = FrameReader(self._socket)
        self._socket.setsockopt(zmq.MAXMSGSIZE, _LARGEST_REQUEST)
        self._socket.setsockopt(zmq.RCVHWM, _MOST_UNREAD)
        try:
            self._file = bind_local(self._socket, path)
        except (zmq.ZMQError, OSError) as error:
            self.close()
            raise InstanceError(f"ipc://{path}: {why_refused(error.errno)}") from error
        if tcp is not None:
            self._bind_tcp(tcp, ring)

    @property
    def endpoint(self) -> str | None:
        """The TCP endpoint as it was bound."""
        return self._gate.endpoint if self._gate is not None else None

    def admit(self, ring: KeyRing) -> None:
        """Take other keys over; who is no longer listed is disconnected."""
        self._names = _names(ring)
        if self._gate is not None:
            self._gate.renew(ring.pair, ring.commanders())

    def receive(self) -> list[Request]:
        """Requests that have come; those that make no sense are answered here."""
        if self._gate is not None:
            self._gate.turn()
        requests = []
        for _ in range(_MOST_AT_ONCE):
            message = self._frames.read()
            if message is None:
                break
            reply = self._replier(message.identity)
            request = _decoded(message.frame.bytes) if message.single else None
            if request is None:
                reply(False, 'a request is one msgpack map with a text under "do"')
            else:
                self._connections.heard(descriptor_of(message.frame))
                requests.append(Request(request, reply, self._who(message.frame)))
        return requests

    def close(self) -> None:
        """Let go of the path; answers under way have a moment to leave."""
        self._socket.close()
        self._connections.close()
        if self._gate is not None:
            self._gate.close()
        self._context.term()
        if self._file is not None:
            self._file.unlink()

    def _bind_tcp(self, endpoint: str, ring: KeyRing | None) -> None:
        try:
            if ring is None:
                raise InstanceError(f"{endpoint}: takes keys: make them with `hapticd keys make`")
            expect_signs_of_life(self._socket)
            self._gate = CurveServer(self._socket, endpoint, ring.pair, ring.commanders())
        except zmq.ZMQError as error:
            self.close()
            raise InstanceError(f"{endpoint}: {zmq.strerror(error.errno or 0)}; set another control.tcp") from error
        except InstanceError:
            self.close()
            raise

    def _who(self, frame: zmq.Frame) -> str:
        try:
            key = str(frame.get("User-Id"))
        except zmq.ZMQError:  # it came in without a key, so from this computer
            return local_peer(descriptor_of(frame)) or "one who has gone"
        return f"{self._names.get(key, 'a key that is no longer listed')} at {frame.get('Peer-Address')}"

    def _replier(self, identity: bytes) -> Reply:
        def reply(ok: bool, text: str = "", **fields: Any) -> None:
            self.refused += not ok
            # A path need not be UTF-8.
            answer = msgpack.packb({"ok": ok, "text": text, **fields}, unicode_errors="surrogateescape")
            with contextlib.suppress(zmq.ZMQError):  # who asked has gone
                self._socket.send_multipart((identity, answer), zmq.NOBLOCK)

        return reply


def _names(ring: KeyRing | None) -> dict[str, str]:
    """Names of listed clients by their public keys."""
    return {} if ring is None else {key.public: name for name, key in ring.clients.items()}


def _decoded(said: bytes) -> dict[str, Any] | None:
    """The request in these bytes; None when it is none."""
    try:
        request = msgpack.unpackb(said)
    except Exception:  # noqa: BLE001 - msgpack has many ways to say that bytes make no sense
        return None
    if not isinstance(request, dict) or not isinstance(request.get("do"), str):
        return None
    return request if all(isinstance(key, str) for key in request) else None
