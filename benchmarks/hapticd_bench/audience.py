"""Those that look at a daemon at the same time: subscribers, and a page of the dashboard, all in one process.

They read every message and count what they miss. In one process they share its interpreter, so that their processor
time is that of one program, and not of fifteen.
"""

from __future__ import annotations

import json
import socket
import struct
import threading
from multiprocessing.connection import Connection
from typing import Any

import msgpack
import zmq
from websockets.sync.client import connect
from websockets.typing import Origin

from hapticd.telemetry.wire import Topic
from hapticd_views.dashboard.frames import HEADER

EVERY_TICK = (Topic.POSITION, Topic.ENERGY, Topic.DAMPING, Topic.TIMING)

READY = "ready"
"""What is said once everybody gets ticks."""


def audience(endpoint: str, subscribers: int, port: int, parent: Connection) -> None:
    """Look until told to stop; then say how many ticks came and how many did not.

    Args:
        endpoint: the daemon's telemetry.
        subscribers: how many sockets read all of it.
        port: of its dashboard.
        parent: says when to stop, and hears of the counts: `subscribers` and `page`, each ticks and missing.
    """
    page = _Page(port)
    page.start()
    context = zmq.Context()
    poller = zmq.Poller()
    counts: dict[Any, dict[bytes, TickCount]] = {}
    for _ in range(subscribers):
        subscriber = context.socket(zmq.SUB)
        subscriber.setsockopt(zmq.LINGER, 0)
        subscriber.setsockopt(zmq.SUBSCRIBE, b"hapticd/")
        subscriber.connect(endpoint)
        poller.register(subscriber, zmq.POLLIN)
        counts[subscriber] = {topic.encode(): TickCount() for topic in EVERY_TICK}
    told = False
    while not parent.poll():
        for subscriber, _ in poller.poll(50):
            topic, payload = subscriber.recv_multipart()
            count = counts[subscriber].get(topic)
            if count is not None:
                for tick in msgpack.unpackb(payload):
                    count.take(tick["seq"])
        if not told and page.count.ticks and all(one.ticks for each in counts.values() for one in each.values()):
            told = True
            parent.send(READY)
    each = [one for topics in counts.values() for one in topics.values()]
    found = {"ticks": sum(one.ticks for one in each) // len(EVERY_TICK), "missing": sum(one.missing for one in each)}
    page.end()
    parent.send({"subscribers": found, "page": {"ticks": page.count.ticks, "missing": page.count.missing}})
    context.destroy(linger=0)


class TickCount:
    """Ticks that came to one reader, and those that did not.

    Attributes:
        ticks: that came.
        missing: that did not come before one that did.
    """

    def __init__(self) -> None:
        self.ticks = 0
        self.missing = 0
        self._last: int | None = None

    def take(self, seq: int) -> None:
        """Count one tick."""
        if self._last is not None:
            self.missing += max(0, seq - self._last - 1)
        self._last = seq
        self.ticks += 1


class _Page(threading.Thread):
    """What a browser does with the frames, without drawing them."""

    def __init__(self, port: int) -> None:
        super().__init__(daemon=True)
        self.count = TickCount()
        address = f"127.0.0.1:{port}"
        self._socket = connect(f"ws://{address}/live", origin=Origin(f"http://{address}"), compression=None)
        self._socket.send(json.dumps({"do": "hello", "token": ""}))

    def run(self) -> None:
        for message in self._socket:
            if isinstance(message, bytes):
                self._take(message)

    def end(self) -> None:
        """Close."""
        self._socket.close()
        self.join(5.0)

    def _take(self, frame: bytes) -> None:
        while frame:
            ticks, axes, _, first, _ = HEADER.unpack_from(frame)
            columns = 2 + 3 * axes + 7
            numbers = struct.unpack_from(f"<{ticks}f", frame, HEADER.size + 4 * ticks)
            for number in numbers:
                self.count.take(int(first) + int(number))
            frame = frame[HEADER.size + 4 * ticks * columns :]


def free_port() -> int:
    """A TCP port of the loopback address that is free now."""
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0))
        return int(trial.getsockname()[1])
