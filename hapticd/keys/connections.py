"""How many may be connected, and what they may fill: bounds that ZeroMQ itself does not have.

Each connection costs a descriptor, and ZeroMQ aborts the process that has none left when the next client of a local
socket comes. ZeroMQ tells of each connection that it has taken, and takes no more while a thousand or two of those
messages are unread, so that a thread that stands still lets nothing grow. A message of endless frames is seen by the
memory that it takes, and its connection ended.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import logging
import os
import resource
import select
import socket as sockets
import struct
import termios
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from urllib.parse import urlsplit

import zmq

from hapticd.keys.memory import Culprits, MemoryBound

MOST_CONNECTIONS = 256
"""How many clients an endpoint has at most; beyond it those that have said nothing yet are dropped, oldest first."""

DESCRIPTORS = 8192
"""File descriptors that are enough for every endpoint at its bound and ZeroMQ's unread messages beside it."""

MOST_ODD = 32
"""What a client may say that makes no sense before it is disconnected: it may be mistaken, but not for ever."""

_UNREAD = 1000
_QUIET_S = 60.0  # between two lines in the log that say the same of an endpoint
_LOOK_MS = 50
_SENDING_S = 0.02  # in this time who sends without a pause is seen to have sent
_NEWS = zmq.EVENT_ACCEPTED | zmq.EVENT_DISCONNECTED | zmq.EVENT_CLOSED | zmq.EVENT_MONITOR_STOPPED
_MONITOR = "inproc://connections"
_CREDENTIALS = "iII"

log = logging.getLogger("hapticd")


def raise_descriptor_limit() -> str:
    """Let this process have `DESCRIPTORS` of them.

    Returns:
        What is wrong when it may not, a line for people; "" when nothing is.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if _enough(soft):
        return ""
    wanted = DESCRIPTORS if _enough(hard) else hard
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
        soft = wanted
    if _enough(soft):
        return ""
    return (
        f"only {soft} file descriptors, of {DESCRIPTORS}: a flood of connections could end the daemon; "
        "raise the limit (ulimit -n, LimitNOFILE=)"
    )


class ConnectionBound:
    """Bounds the connections of a socket. Make it before the socket is bound.

    Args:
        socket: that clients connect to, one of it in a ZeroMQ context.
        most: connections of an endpoint.
        keep_heard: a client that has said something is not dropped for one that is newer. Without, the one that has
            said nothing for the longest time is, so that there is always a way in.
    """

    def __init__(self, socket: zmq.Socket[bytes], most: int = MOST_CONNECTIONS, *, keep_heard: bool = True) -> None:
        self._most = most
        self._keep_heard = keep_heard
        self._endpoints: dict[str, dict[int, _Client]] = {}  # by descriptor, oldest first
        self._lock = threading.Lock()
        self._told_s: dict[str, float] = {}
        self._memory = MemoryBound()
        self._looked_s = 0.0
        self._closed = threading.Event()
        socket.monitor(_MONITOR, _NEWS)
        self._news: zmq.Socket[bytes] = socket.context.socket(zmq.PAIR)
        self._news.setsockopt(zmq.RCVHWM, _UNREAD)
        self._news.connect(_MONITOR)
        self._thread = threading.Thread(target=self._run, name="connections", daemon=True)
        self._thread.start()

    def heard(self, descriptor: int) -> None:
        """A client has said something that makes sense: those that have not are dropped before it.

        Args:
            descriptor: of its connection, by `descriptor_of`.
        """
        with self._lock:
            for clients in self._endpoints.values():
                if descriptor in clients:
                    clients[descriptor].heard_s = time.monotonic()

    def odd(self, descriptor: int) -> bool:
        """A client has said what makes no sense; past `MOST_ODD` of it, it is disconnected.

        Args:
            descriptor: of its connection, by `descriptor_of`.

        Returns:
            Whether that was the last.
        """
        with self._lock:
            for endpoint, clients in self._endpoints.items():
                client = clients.get(descriptor)
                if client is not None:
                    client.odd += 1
                    if client.odd > MOST_ODD:
                        del clients[descriptor]
                        _shut(descriptor, endpoint)
                        return True
        return False

    def close(self) -> None:
        """Look no more; after the socket is closed, and before its context ends. May be called twice."""
        self._closed.set()
        self._thread.join()
        self._news.close(0)  # where the thread ended before its time: the context would wait for it

    def _run(self) -> None:
        # Until the socket is closed and all has been read: a thread of ZeroMQ may wait for that.
        while self._news.poll(_LOOK_MS) or not self._closed.is_set():
            with contextlib.suppress(OSError):  # the next look is soon; without the thread ZeroMQ's own stand still
                self._look_at_memory()
            if not self._news.poll(0):
                continue
            news, where = self._news.recv_multipart()
            event, value = struct.unpack("=Hi", news)
            if event == zmq.EVENT_MONITOR_STOPPED:
                break
            with self._lock:
                self._learn(event, value, where.decode(errors="replace"))
        self._news.close(0)

    def _look_at_memory(self) -> None:
        now_s = time.monotonic()
        if now_s - self._looked_s < 1e-3 * _LOOK_MS:
            return
        self._looked_s = now_s
        culprits = self._memory.turn(now_s)
        if culprits is Culprits.NO_ONE:
            return
        with self._lock:
            known = [(one, endpoint) for endpoint, clients in self._endpoints.items() for one in clients]
        ended = _sending(known) if culprits is Culprits.SENDERS else known
        with self._lock:
            for descriptor, endpoint in ended:
                if self._endpoints.get(endpoint, {}).pop(descriptor, None) is not None:
                    _shut(descriptor, endpoint)
        for endpoint in {endpoint for _, endpoint in ended}:
            self._tell(endpoint, "what clients have sent fills the memory; those that send were disconnected")

    def _learn(self, event: int, descriptor: int, endpoint: str) -> None:
        if event == zmq.EVENT_CLOSED:  # the endpoint itself, and with it all that were connected there
            self._endpoints.pop(endpoint, None)
            return
        for known in self._endpoints.values():  # of a wildcard the end has another name than the beginning
            known.pop(descriptor, None)
        if event == zmq.EVENT_DISCONNECTED:
            return
        clients = self._endpoints.setdefault(endpoint, {})
        clients[descriptor] = _Client()
        if len(clients) > self._most:
            victim = self._victim(clients)
            del clients[victim]
            _shut(victim, endpoint)
            self._tell(endpoint, f"more than {self._most} connections; the oldest that say nothing are dropped")

    def _victim(self, clients: dict[int, _Client]) -> int:
        *before, _newest = clients
        if self._keep_heard:
            return next(one for one, client in clients.items() if not client.heard_s)
        return min(before, key=lambda one: clients[one].heard_s)

    def _tell(self, endpoint: str, what: str) -> None:
        now_s = time.monotonic()
        if now_s - self._told_s.get(endpoint + what, -_QUIET_S) >= _QUIET_S:
            self._told_s[endpoint + what] = now_s
            log.warning("%s: %s", endpoint, what)


@dataclass(slots=True)
class _Client:
    heard_s: float = 0.0  # when it last said something that makes sense; 0: never
    odd: int = 0


def descriptor_of(frame: zmq.Frame) -> int:
    """The connection that a frame came by; -1 where ZeroMQ does not know, as of what is no request of a subscriber."""
    try:
        return int(frame.get(zmq.SRCFD))
    except zmq.ZMQError:
        return -1


def local_peer(descriptor: int) -> str:
    """Who is at the other end of a connection within this computer, as the kernel knows; "" when it does not.

    Args:
        descriptor: of the connection, by `descriptor_of`.
    """
    with contextlib.suppress(OSError), _held(descriptor) as connection:
        size = struct.calcsize(_CREDENTIALS)
        said = connection.getsockopt(sockets.SOL_SOCKET, sockets.SO_PEERCRED, size)
        process, user, _group = struct.unpack(_CREDENTIALS, said)
        return f"user {user}, process {process}"
    return ""


def inode_of(descriptor: int) -> int:
    """What tells a connection from the next one that has its descriptor; 0 when it has ended."""
    try:
        return os.fstat(descriptor).st_ino
    except OSError:
        return 0


def has_ended(descriptor: int, inode: int) -> bool:
    """Whether a connection has ended, also before ZeroMQ has seen that: its other end is closed.

    Args:
        descriptor: of it, by `descriptor_of`.
        inode: what `inode_of` said of it.
    """
    if inode_of(descriptor) != inode or not inode:
        return True
    look = select.poll()
    look.register(descriptor, select.POLLRDHUP)
    return bool(look.poll(0))


def _sending(known: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Those connections on which something comes that has not been read yet."""
    found: dict[tuple[int, str], None] = {}
    until_s = time.monotonic() + _SENDING_S
    while time.monotonic() < until_s:
        for one in known:
            with contextlib.suppress(OSError):
                unread = fcntl.ioctl(one[0], termios.FIONREAD, bytes(4))
                if any(unread):
                    found[one] = None
        time.sleep(1e-3)
    return list(found)


def _enough(limit: int) -> bool:
    return limit == resource.RLIM_INFINITY or limit >= DESCRIPTORS


def _shut(descriptor: int, endpoint: str) -> None:
    """End a connection; ZeroMQ sees that and closes it.

    The number may be another thing's by now, so only what belongs to the endpoint is ended.
    """
    with contextlib.suppress(OSError), _held(descriptor) as connection:
        if _is_at(connection.getsockname(), endpoint):
            connection.shutdown(sockets.SHUT_RDWR)


@contextlib.contextmanager
def _held(descriptor: int) -> Iterator[sockets.socket]:
    """What a descriptor leads to now, whatever becomes of the descriptor; where no other is free, by its own number."""
    try:
        own = os.dup(descriptor)
    except OSError as error:
        if error.errno != errno.EMFILE:
            raise
        connection = sockets.socket(fileno=descriptor)  # what fills them all has to be ended without one
        try:
            yield connection
        finally:
            connection.detach()
        return
    try:
        connection = sockets.socket(fileno=own)
    except OSError:  # no socket any more
        os.close(own)
        raise
    with connection:
        yield connection


def _is_at(name: object, endpoint: str) -> bool:
    if isinstance(name, tuple):
        return endpoint.startswith("tcp://") and name[1] == urlsplit(endpoint).port
    return f"ipc://{name}" == endpoint
