"""A TCP endpoint through which only listed keys come in.

ZeroMQ asks about every client that has proved to own its key (ZAP, ZeroMQ RFC 27); `turn` answers. Without an answer
no client comes in.
"""

from __future__ import annotations

import logging
import shlex

import zmq
from zmq.utils import z85

from hapticd.keys.file import Key

_HANDSHAKE_MS = 10_000  # that a client has to prove who it is
_QUESTIONS = "inproc://zeromq.zap.01"
_MOST_AT_ONCE = 50
_MOST_STRANGERS = 100  # that are logged
_TRIES_TOLD = 200

log = logging.getLogger("hapticd")


class CurveServer:
    """A TCP endpoint that admits listed keys only.

    Bind the socket's other endpoints before it: those that come later take keys as well.

    Not for use from two threads, and one of it in a ZeroMQ context.

    Args:
        socket: what clients reach through it.
        endpoint: such as tcp://0.0.0.0:9872.
        pair: the daemon's own keys.
        admitted: public keys of those that may come in.
        watch_only: those that come in here watch and do not command.

    Attributes:
        endpoint: as it was bound.

    Raises:
        zmq.ZMQError: it cannot be bound.
    """

    def __init__(
        self, socket: zmq.Socket[bytes], endpoint: str, pair: Key, admitted: frozenset[str], *, watch_only: bool = False
    ) -> None:
        self.endpoint = endpoint
        self._socket = socket
        self._pair = pair
        self._admitted = admitted
        self._listing = " --watch-only" if watch_only else ""
        self._strangers: set[tuple[str, str]] = set()
        self._open = False
        self._closing = False
        self._tries = 0
        self._questions: zmq.Socket[bytes] = socket.context.socket(zmq.ROUTER)
        try:
            self._questions.setsockopt(zmq.LINGER, 0)
            self._questions.bind(_QUESTIONS)
            self._bind()
        except BaseException:
            self.close()
            raise

    def turn(self) -> None:
        """Answer what ZeroMQ wants to know. Returns at once."""
        if self._closing:
            self._socket.unbind(self.endpoint)
            self._closing, self._open = False, False
        if not self._open:
            self._bind_again()
        for _ in range(_MOST_AT_ONCE):
            if not int(self._questions.getsockopt(zmq.EVENTS)) & zmq.POLLIN:
                break
            self._answer(*self._questions.recv_multipart(zmq.NOBLOCK))

    def renew(self, pair: Key, admitted: frozenset[str]) -> None:
        """Take other keys over.

        When a key is no longer listed, all clients are disconnected and those that are listed come back, which ZeroMQ
        does by itself: it cannot disconnect one of them. That is done at the next turn, so that a client that asked
        for it over this endpoint still gets the answer.
        """
        if self._admitted - admitted or pair != self._pair:
            self._closing = self._open
        self._pair, self._admitted = pair, admitted

    def close(self) -> None:
        """Give the questions back to ZeroMQ; before the socket's context ends. May be called twice."""
        self._questions.close()

    def _bind(self) -> None:
        socket = self._socket
        socket.setsockopt_string(zmq.ZAP_DOMAIN, "hapticd")
        socket.setsockopt(zmq.ZAP_ENFORCE_DOMAIN, 1)
        socket.setsockopt(zmq.HANDSHAKE_IVL, _HANDSHAKE_MS)
        socket.setsockopt(zmq.CURVE_SERVER, 1)
        socket.setsockopt(zmq.CURVE_SECRETKEY, self._pair.secret.encode())
        if "[" in self.endpoint:
            socket.setsockopt(zmq.IPV6, 1)
        socket.bind(self.endpoint)
        self.endpoint = socket.getsockopt_string(zmq.LAST_ENDPOINT)
        self._open = True

    def _bind_again(self) -> None:
        """ZeroMQ lets go of a port in a thread of its own, a moment after it was asked to."""
        try:
            self._bind()
            self._tries = 0
        except zmq.ZMQError as error:
            self._tries += 1
            if self._tries == _TRIES_TOLD:
                why = zmq.strerror(error.errno or 0)
                log.warning("%s: %s; no client comes in there while that is so", self.endpoint, why)

    def _answer(self, who: bytes, empty: bytes, version: bytes, request: bytes, *said: bytes) -> None:
        _domain, address, _identity, mechanism, *credentials = said
        key = z85.encode(credentials[0]).decode() if mechanism == b"CURVE" else ""
        admitted = key in self._admitted
        verdict = (b"200", b"OK") if admitted else (b"400", b"key is not listed")
        self._questions.send_multipart((who, empty, version, request, *verdict, key.encode(), b""), zmq.NOBLOCK)
        if not admitted:
            self._tell(address.decode(errors="replace"), key)

    def _tell(self, address: str, key: str) -> None:
        """Log a refused key with the command that lists it; once for each stranger, since it may try for ever."""
        if (address, key) not in self._strangers and len(self._strangers) < _MOST_STRANGERS:
            self._strangers.add((address, key))
            advice = f"hapticd keys add NAME {shlex.quote(key)}{self._listing}"
            log.warning(
                "%s: refused %s, its key is not listed for this; to list it: %s", self.endpoint, address, advice
            )
