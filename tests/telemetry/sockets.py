"""Real sockets for tests: a publisher, subscribers without hapticd in them, and handshakes instead of sleeps."""

from __future__ import annotations

import itertools
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import msgpack
import zmq

from hapticd.config.models import TelemetryConfig
from hapticd.telemetry.publisher import Publisher
from hapticd.telemetry.records import Status
from hapticd.telemetry.wire import Inputs
from hapticd.tick.record import TickRecord
from hapticd_bench.telemetry import synthetic_info, synthetic_records

PATIENCE_S = 20.0
"""How long anything may take on a busy machine before a test gives up."""

EPOCH_OFFSET_NS = 1_700_000_000_000_000_000

END = "end"
"""A topic that no publisher has: what a subscriber reads up to."""


class Wire:
    """A publisher on an ipc path of its own, with status already said, and subscribers that are known to be heard."""

    def __init__(self, inputs: Inputs | None = None, say_status: bool = True, **telemetry: Any) -> None:
        self.directory = Path(tempfile.mkdtemp(prefix="hapticd-"))  # short: an ipc path has at most 107 bytes
        self.path = self.directory / "telemetry"
        self.endpoint = f"ipc://{self.path}"
        self.config = TelemetryConfig(**telemetry)
        self.inputs = inputs or synthetic_info()
        self.publisher = Publisher(self.config, self.path, self.inputs, EPOCH_OFFSET_NS)
        self.context = zmq.Context()
        self._sockets: list[zmq.Socket[bytes]] = []
        if say_status:
            self.publisher.status(Status(version="1.2.3", law="energy-cycle", rate_hz=1000.0).as_map())

    def __enter__(self) -> Wire:
        return self

    def __exit__(self, *_: object) -> None:
        for one in self._sockets:
            one.close(0)
        self.context.term()
        self.publisher.close()
        shutil.rmtree(self.directory)

    def subscribe(self, *topics: str, high_water: int = 0) -> Subscriber:
        """A subscriber whose subscriptions the publisher has seen."""
        prefixes = (*(topics or ("hapticd/",)), END)
        wanted = served(self.publisher) + len(prefixes)
        socket = self.socket(zmq.SUB, self.endpoint, high_water)
        for prefix in prefixes:
            socket.setsockopt(zmq.SUBSCRIBE, prefix.encode())
        wait_until(lambda: served(self.publisher) >= wanted, "subscriptions")
        return Subscriber(socket, self.say)

    def say(self, topic: str, payload: Any) -> None:
        """Publish what a publisher would not."""
        self.publisher._socket.send_multipart((topic.encode(), msgpack.packb(payload)))

    def socket(self, kind: int, endpoint: str, high_water: int = 0) -> zmq.Socket[bytes]:
        """A connected socket that is closed with everything else."""
        socket = self.context.socket(kind)
        self._sockets.append(socket)
        socket.setsockopt(zmq.RCVHWM, high_water)
        socket.connect(endpoint)
        return socket

    def restart(self, **status: Any) -> None:
        """Close the publisher and start another in its place, as a restarted daemon would."""
        self.publisher.close()
        self.publisher = Publisher(self.config, self.path, self.inputs, EPOCH_OFFSET_NS)
        self.publisher.status(Status(version="1.2.3", **status).as_map())


class Subscriber:
    """Reads messages as the contract has them, and holds them to it.

    Args:
        socket: connected and subscribed.
        say: publishes a message behind all others; without it there is no `waiting`.
    """

    def __init__(self, socket: zmq.Socket[bytes], say: Callable[[str, Any], None] | None = None) -> None:
        self.socket = socket
        self._say = say
        self._ends = 0

    def message(self) -> tuple[str, list[dict[str, Any]]]:
        """The next message."""
        while (message := self._next())[0] == END:
            pass  # an end that `waiting` has said once more than was needed
        return message

    def until(self, topic: str, count: int) -> list[dict[str, Any]]:
        """So many maps of a topic, whatever else comes."""
        collected: list[dict[str, Any]] = []
        while len(collected) < count:
            name, maps = self.message()
            if name == topic:
                collected += maps
        return collected

    def waiting(self) -> list[tuple[str, list[dict[str, Any]]]]:
        """What has come, up to an end that is published now; again and again, since a full queue drops it as well."""
        assert self._say is not None
        self._ends += 1
        end = (END, [{"timestamp": 0.0, "seq": self._ends}])
        messages: list[tuple[str, list[dict[str, Any]]]] = []
        give_up_s = time.monotonic() + PATIENCE_S
        while True:
            assert time.monotonic() < give_up_s, "no end came"
            self._say(*end)
            while self.socket.poll(50):
                message = self._next()
                if message == end:
                    return messages
                if message[0] != END:
                    messages.append(message)

    def _next(self) -> tuple[str, list[dict[str, Any]]]:
        assert self.socket.poll(int(PATIENCE_S * 1000)), "nothing came"
        frames = self.socket.recv_multipart(zmq.NOBLOCK)
        assert len(frames) == 2
        maps = msgpack.unpackb(frames[1])
        assert isinstance(maps, list)
        assert maps
        for fields in maps:
            assert isinstance(fields, dict)
            assert isinstance(fields["timestamp"], float)
            assert isinstance(fields["seq"], int)
        return frames[0].decode(), maps


def ticks(count: int, first: int = 0) -> list[TickRecord]:
    """Synthetic ticks, deadlines from 0 on."""
    return list(itertools.islice(synthetic_records(0, first), count))


def seqs(maps: Iterable[dict[str, Any]]) -> list[int]:
    return [fields["seq"] for fields in maps]


def served(publisher: Publisher) -> int:
    """Subscriptions seen, after looking for new ones."""
    publisher.service()
    return publisher.counts.subscriptions


def wait_until(condition: Callable[[], bool], what: str) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s, f"waited in vain for: {what}"
        time.sleep(0.002)
