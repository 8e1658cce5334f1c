"""The client's end: a connection to a daemon that may take keys, and why it does not come about."""

from __future__ import annotations

import errno
import math
import os
import struct
import time
from pathlib import Path
from typing import Any

import zmq

from hapticd.errors import ConfigError, HapticdError
from hapticd.keys.file import Key, read
from hapticd.keys.heartbeat import expect_signs_of_life

ENVIRONMENT = "HAPTICD_KEYS"
"""Environment variable that names a client's key file."""

_REFUSED = 400
_NEWS = (
    zmq.EVENT_HANDSHAKE_SUCCEEDED
    | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL
    | zmq.EVENT_HANDSHAKE_FAILED_AUTH
    | zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL
    | zmq.EVENT_DISCONNECTED
)


class RefusedKeyError(HapticdError):
    """The daemon takes keys and not this one, or takes none; the message says what to do."""


def client_keys(endpoint: str, given: Path | str | None = None) -> Key | None:
    """The keys with which this user connects to an endpoint; None for one that takes none, such as ipc.

    Args:
        endpoint: of the daemon.
        given: a file; None: the one that $HAPTICD_KEYS names, if any.

    Raises:
        ConfigError: the file cannot be used for that.
    """
    named = str(given) if given is not None else os.environ.get(ENVIRONMENT)
    if not named or not endpoint.startswith("tcp://"):
        return None
    key = read(Path(named))
    if not key.secret or not key.server:
        missing = "secret-key" if not key.secret else "server-key"
        raise ConfigError(
            f"{named}: no {missing} in it: `hapticd keys make NAME --server-key KEY` makes a client's file"
        )
    return key


class CurveClient:
    """A socket's connection to a daemon.

    Args:
        socket: what `connect` is going to connect; this closes it.
        endpoint: of the daemon.
        keys: to show there, if it takes any.

    Attributes:
        doubt: what is wrong with what answers there, empty when nothing is.
        connected: something there has spoken ZeroMQ with this client.
        lost: it was connected, and is not any more; ZeroMQ tries again.
    """

    def __init__(self, socket: zmq.Socket[bytes], endpoint: str, keys: Key | None) -> None:
        self.doubt = ""
        self.connected = False
        self.lost = False
        self._socket = socket
        self._endpoint = endpoint
        self._keys = keys
        if keys is not None:
            socket.setsockopt(zmq.CURVE_SERVERKEY, keys.server.encode())
            socket.setsockopt(zmq.CURVE_PUBLICKEY, keys.public.encode())
            socket.setsockopt(zmq.CURVE_SECRETKEY, keys.secret.encode())
        if endpoint.startswith("tcp://"):
            expect_signs_of_life(socket)
        if "[" in endpoint:
            socket.setsockopt(zmq.IPV6, 1)
        self._news: zmq.Socket[Any] = socket.get_monitor_socket(_NEWS)
        self._poller = zmq.Poller()
        self._poller.register(socket, zmq.POLLIN)
        self._poller.register(self._news, zmq.POLLIN)

    def connect(self) -> None:
        """Connect; ZeroMQ connects again after a loss.

        Raises:
            zmq.ZMQError: ZeroMQ cannot use the endpoint.
        """
        try:
            self._socket.connect(self._endpoint)
        except UnicodeEncodeError:
            raise zmq.ZMQError(errno.EINVAL) from None

    def wait(self, timeout_s: float | None) -> bool:
        """Whether a message has come in time.

        Args:
            timeout_s: how long to wait for one [s]; None: for ever.

        Raises:
            RefusedKeyError: none will ever come.
        """
        until_s = math.inf if timeout_s is None else time.monotonic() + timeout_s
        while True:
            left_s = until_s - time.monotonic()
            ready = dict(self._poller.poll(None if left_s == math.inf else max(0, math.ceil(left_s * 1e3))))
            if self._socket in ready:
                return True
            if self._news in ready:
                self._learn(*struct.unpack("=Hi", self._news.recv_multipart()[0]))
            elif left_s <= 0.0:
                return False

    def close(self, last_words_ms: int = 0) -> None:
        """Close the socket. May be called twice.

        Args:
            last_words_ms: how long what was sent may take to leave [ms].
        """
        if not self._socket.closed:
            self._socket.disable_monitor()
        self._news.close(0)
        self._socket.close(last_words_ms)

    def _learn(self, event: int, value: int) -> None:
        if event == zmq.EVENT_HANDSHAKE_SUCCEEDED:
            self.doubt = ""
            self.connected = True
            self.lost = False
        elif event == zmq.EVENT_DISCONNECTED:
            self.lost = self.connected
        elif event == zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL and self._keys is not None:
            self.doubt = "; what answers there lacks the server-key of your key file, or is another kind of endpoint"
        elif event == zmq.EVENT_HANDSHAKE_FAILED_AUTH and value == _REFUSED:
            public = self._keys.public if self._keys is not None else ""
            raise RefusedKeyError(
                f"{self._endpoint}: the daemon there does not let your key in: on its computer "
                f"`sudo hapticd keys add NAME '{public}'`, then `sudo hapticd reload`"
            )
        elif value == zmq.Event.PROTOCOL_ERROR_ZMTP_MECHANISM_MISMATCH:
            raise RefusedKeyError(
                f"{self._endpoint}: takes no keys: leave --keys and ${ENVIRONMENT} away"
                if self._keys is not None
                else f"{self._endpoint}: takes keys: name your key file with --keys or ${ENVIRONMENT}; "
                "docs/telemetry.md says how to get one"
            )
