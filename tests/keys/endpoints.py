"""Both endpoints of a daemon that take keys, with real sockets, and clients of every kind; handshakes, no sleeps."""

from __future__ import annotations

import struct
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import zmq

from hapticd.config.models import TelemetryConfig
from hapticd.keys.file import Key
from hapticd.keys.store import KeyRing
from hapticd.supervisor.commands import CommandSocket
from hapticd.telemetry.publisher import Publisher
from hapticd.telemetry.records import Status
from hapticd_bench.telemetry import synthetic_info
from tests.telemetry.sockets import EPOCH_OFFSET_NS, PATIENCE_S

TURN_S = 0.001


class Endpoints:
    """A publisher and a command socket, on ports of their own that every address of this computer reaches."""

    def __init__(self, ring: KeyRing) -> None:
        self.directory = Path(tempfile.mkdtemp(prefix="hapticd-"))  # short: an ipc path has at most 107 bytes
        telemetry = TelemetryConfig().model_copy(update={"tcp": "tcp://0.0.0.0:0"})
        self.publisher = Publisher(telemetry, self.directory / "telemetry", synthetic_info(), EPOCH_OFFSET_NS, ring)
        self.commands = CommandSocket(self.directory / "control", "tcp://0.0.0.0:0", ring)
        self.publisher.status(Status(version="1.2.3").as_map())
        self.telemetry = self.publisher.endpoints[1].replace("0.0.0.0", "127.0.0.2")
        self.control = str(self.commands.endpoint).replace("0.0.0.0", "127.0.0.2")
        self.asked: list[str] = []
        self.askers: list[str] = []
        self.granting: Callable[[], None] = lambda: None
        self.clients: list[Client] = []
        self.context = zmq.Context()

    def __enter__(self) -> Endpoints:
        return self

    def __exit__(self, *_: object) -> None:
        for client in self.clients:
            client.close()
        self.context.term()
        self.publisher.close()
        self.commands.close()
        self.directory.rmdir()

    def turn(self) -> None:
        """What the supervisor does in each of its turns; every request is granted."""
        self.publisher.service()
        for request, reply, who in self.commands.receive():
            self.asked.append(request["do"])
            self.askers.append(who)
            self.granting()
            reply(True, request["do"])

    def turn_until(self, condition: Callable[[], object], what: str) -> None:
        end_s = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end_s, f"waited in vain for: {what}"
            self.turn()
            time.sleep(TURN_S)

    def admit(self, ring: KeyRing) -> None:
        self.publisher.admit(ring)
        self.commands.admit(ring)

    def client(self, kind: int, endpoint: str, keys: Key | None = None) -> Client:
        client = Client(self.context, kind, endpoint, keys)
        self.clients.append(client)
        return client


class Client:
    """A client with no code of hapticd in it, that notes what becomes of its connections."""

    def __init__(self, context: zmq.Context[Any], kind: int, endpoint: str, keys: Key | None) -> None:
        self.socket = context.socket(kind)
        self.socket.setsockopt(zmq.LINGER, 0)
        self.socket.setsockopt(zmq.IPV6, 1)
        if keys is not None:
            self.socket.setsockopt(zmq.CURVE_SERVERKEY, keys.server.encode())
            self.socket.setsockopt(zmq.CURVE_PUBLICKEY, keys.public.encode())
            self.socket.setsockopt(zmq.CURVE_SECRETKEY, keys.secret.encode())
        if kind == zmq.SUB:
            self.socket.setsockopt(zmq.SUBSCRIBE, b"")
        self._news = self.socket.get_monitor_socket(
            zmq.EVENT_HANDSHAKE_SUCCEEDED
            | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL
            | zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL
            | zmq.EVENT_HANDSHAKE_FAILED_AUTH
        )
        self._events: list[int] = []
        self.socket.connect(endpoint)

    def came_in(self) -> bool:
        return zmq.EVENT_HANDSHAKE_SUCCEEDED in self._look()

    def turned_away(self) -> bool:
        """Whether it was, and did not come in before."""
        return bool(self._look()) and zmq.EVENT_HANDSHAKE_SUCCEEDED not in self._events

    def received(self) -> int:
        """Messages that came since it was last asked."""
        count = 0
        while self.socket.poll(0):
            self.socket.recv_multipart()
            count += 1
        return count

    def forget(self) -> None:
        self._look()
        self._events.clear()

    def close(self) -> None:
        self.socket.disable_monitor()
        self._news.close(0)
        self.socket.close(0)

    def _look(self) -> list[int]:
        while self._news.poll(0):
            self._events.append(struct.unpack("=Hi", self._news.recv_multipart()[0])[0])
        return self._events


def ring_of(server: Key, **clients: Key) -> KeyRing:
    """A list of clients, of whose keys the daemon knows the public part."""
    return KeyRing(server, {name: Key(key.public, watch_only=key.watch_only) for name, key in clients.items()})
