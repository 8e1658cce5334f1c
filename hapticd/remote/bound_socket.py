"""A socket of the remote process: on the runtime directory, and on a TCP endpoint for those that have a key."""

from __future__ import annotations

from pathlib import Path

import zmq

from hapticd.errors import InstanceError
from hapticd.keys.connections import ConnectionBound, descriptor_of, local_peer
from hapticd.keys.heartbeat import expect_signs_of_life
from hapticd.keys.local_bind import bind_local
from hapticd.keys.server import CurveServer
from hapticd.keys.store import KeyRing
from hapticd.own_file import OwnFile
from hapticd.paths import why_refused

_LAST_WORDS_MS = 100


class BoundSocket:
    """A ZeroMQ socket with bounds on who connects and what waits.

    Args:
        kind: of socket, `zmq.ROUTER` or `zmq.XPUB`.
        path: where it lies; its directory decides who may reach it.
        tcp: the TCP endpoint and the key of the configuration that names it; None for none.
        ring: the keys that it takes.
        watch_only: those who only watch come in too.
        largest: of a frame that comes [bytes].
        unread: messages of a client that wait.
        options: of this kind of socket.

    Attributes:
        socket: the socket.
        connections: bounds them.

    Raises:
        InstanceError: it cannot be bound.
    """

    def __init__(
        self,
        kind: int,
        path: Path,
        tcp: tuple[str, str] | None,
        ring: KeyRing | None,
        *,
        watch_only: bool,
        largest: int,
        unread: int,
        options: dict[int, int],
    ) -> None:
        if path.exists() and not path.is_socket():  # ZeroMQ would put its socket over it
            raise InstanceError(f"ipc://{path}: a file that is no socket is in the way; remove it")
        self._file: OwnFile | None = None
        self._watch_only = watch_only
        self._names: dict[str, str] = {}
        self._gate: CurveServer | None = None
        self._context = zmq.Context(io_threads=1)
        self.socket: zmq.Socket[bytes] = self._context.socket(kind)
        self.connections = ConnectionBound(self.socket)
        for option, value in {zmq.LINGER: _LAST_WORDS_MS, zmq.RCVHWM: unread, **options}.items():
            self.socket.setsockopt(option, value)
        self.socket.setsockopt(zmq.MAXMSGSIZE, largest)
        endpoint = f"ipc://{path}"
        try:
            self._file = bind_local(self.socket, path)
            if tcp is not None:
                endpoint, key = tcp
                self._bind_tcp(endpoint, key, ring)
        except (zmq.ZMQError, OSError) as error:
            self.close()
            if tcp is not None and endpoint == tcp[0]:
                raise InstanceError(f"{endpoint}: {zmq.strerror(error.errno or 0)}; set another {key}") from error
            raise InstanceError(f"{endpoint}: {why_refused(error.errno)}") from error
        except InstanceError:
            self.close()
            raise

    def admit(self, ring: KeyRing | None) -> None:
        """Take other keys over; who is no longer listed is disconnected."""
        if ring is not None and self._gate is not None:
            self._names = {key.public: name for name, key in ring.clients.items()}
            self._gate.renew(ring.pair, self._admitted(ring))

    def turn(self) -> None:
        """Let those in who have a key. Returns at once."""
        if self._gate is not None:
            self._gate.turn()

    def waits(self) -> bool:
        """Whether a message waits; `recv` would raise when there is none, which costs ten times this."""
        return bool(int(self.socket.getsockopt(zmq.EVENTS)) & zmq.POLLIN)

    def peer(self, frame: zmq.Frame) -> tuple[bool, str]:
        """Whether who sent a frame is on this computer, and who it is, for people."""
        try:
            key = str(frame.get("User-Id"))
        except zmq.ZMQError:  # it came in without a key, so from this computer
            return True, local_peer(descriptor_of(frame)) or "one who has gone"
        return False, f"{self._names.get(key, 'a key that is no longer listed')} at {frame.get('Peer-Address')}"

    def close(self) -> None:
        """Let go of the path; answers under way have a moment to leave."""
        self.socket.close()
        self.connections.close()
        if self._gate is not None:
            self._gate.close()
        self._context.term()
        if self._file is not None:
            self._file.unlink()

    def _bind_tcp(self, endpoint: str, key: str, ring: KeyRing | None) -> None:
        if ring is None:
            raise InstanceError(f"{key} = {endpoint!r}: takes keys: make them with `hapticd keys make`")
        expect_signs_of_life(self.socket)
        self._gate = CurveServer(self.socket, endpoint, ring.pair, self._admitted(ring), watch_only=self._watch_only)
        self.admit(ring)

    def _admitted(self, ring: KeyRing) -> frozenset[str]:
        return ring.watchers() if self._watch_only else ring.commanders()
