"""A subscription to a daemon: records as they arrive, and gaps where they did not."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Self, TypeVar, overload

import zmq

from hapticd.client.decode import decode
from hapticd.errors import ClientError, EndpointError, SchemaError, SilenceError, WireError
from hapticd.keys.client import CurveClient, client_keys
from hapticd.paths import DEFAULT_INSTANCE, telemetry_endpoint
from hapticd.telemetry.records import Event, Gap, Record, Sent, Status
from hapticd.telemetry.wire import SCHEMA, Topic

_EVERY_TICK = (Topic.POSITION, Topic.ENERGY, Topic.DAMPING, Topic.TIMING)
_LARGEST_MESSAGE = 16 * 1024 * 1024

Kind = TypeVar("Kind", bound=Sent)
"""A record class."""


class Client:
    """A subscription: an iterable of records. `connect` gives one that commands as well.

    The daemon need not run yet, and may be restarted: ZeroMQ connects again by itself. Records are yielded once the
    daemon's first status has arrived and its schema is known. Ticks that are missing are yielded as a `Gap`. One
    thread at a time may use it.

    Args:
        endpoint: for example "tcp://lab.example:9872"; None: the instance's own on this computer.
        instance: name of the daemon's instance, when no endpoint is given.
        topics: record classes, or topics by name ("position" or "hapticd/position"); all unless given.
        timeout_s: longest silence while iterating [s]; None: wait for ever.
        receive_high_water: messages kept while the caller is busy; new ones are lost beyond it.
        keys: key file for a daemon on another computer; None: the one that $HAPTICD_KEYS names, if any.

    Attributes:
        endpoint: what it is connected to.
        latest_status: of the daemon, None before the first, whether or not that topic was asked for.
        missing: ticks that did not arrive, by topic.

    Raises:
        ClientError: no such topic, ZeroMQ cannot use the endpoint, or it is used after `close`.
        ConfigError: the key file cannot be used.
    """

    def __init__(
        self,
        endpoint: str | None = None,
        *,
        instance: str = DEFAULT_INSTANCE,
        topics: Sequence[type[Sent] | Topic | str] = tuple(Topic),
        timeout_s: float | None = None,
        receive_high_water: int = 1000,
        keys: Path | str | None = None,
    ) -> None:
        self.endpoint = endpoint or telemetry_endpoint(instance)
        self.latest_status: Status | None = None
        self.missing: dict[Topic, int] = dict.fromkeys(_EVERY_TICK, 0)
        if isinstance(topics, str | type):
            raise ClientError("topics: a list, such as topics=[Position]")
        self._topics = frozenset(_topic(topic) for topic in topics)
        self._timeout_s = timeout_s
        self._ahead: deque[Record] = deque()  # arrived with what was asked for, and not yet taken
        self._last: dict[Topic, int] = {}
        self._anew: set[Topic] = set()  # their next tick is the first that is here of a daemon that was started anew
        self._back: set[Topic] = set()  # they have counted from the beginning before its status came
        key = client_keys(self.endpoint, keys)
        self._context = zmq.Context(io_threads=1)
        self._socket = self._context.socket(zmq.SUB)
        self._connection = CurveClient(self._socket, self.endpoint, key)
        try:
            self._socket.setsockopt(zmq.LINGER, 0)
            self._socket.setsockopt(zmq.RCVHWM, receive_high_water)
            self._socket.setsockopt(zmq.MAXMSGSIZE, _LARGEST_MESSAGE)
            for topic in self._topics | {Topic.STATUS}:
                self._socket.setsockopt_string(zmq.SUBSCRIBE, topic)
            self._connection.connect()
        except zmq.ZMQError as error:
            self.close()
            raise EndpointError(
                f"{self.endpoint}: {error.strerror}; an endpoint is ipc://PATH or tcp://HOST:PORT"
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __iter__(self) -> Iterator[Record]:
        """Every record as it arrives.

        Raises:
            SilenceError: nothing arrived for `timeout_s`.
            RefusedKeyError, SchemaError, WireError: as `receive`.
        """
        while True:
            records = self.receive(self._timeout_s)
            if not records:
                doubt = self.doubt or "; is the daemon running there?"
                raise SilenceError(f"{self.endpoint}: nothing for {self._timeout_s:g} s{doubt}")
            self._ahead.extend(records)
            while self._ahead:
                yield self._ahead.popleft()

    def receive(self, timeout_s: float | None = 0.0) -> list[Record]:
        """The records of the next message that has some; empty when none came in time.

        Args:
            timeout_s: how long to wait for it [s]; None: for ever.

        Raises:
            RefusedKeyError: the daemon does not list this key.
            SchemaError: the daemon's schema is not known to this client.
            WireError: a message is not what the contract says.
        """
        if self._ahead:
            records = list(self._ahead)
            self._ahead.clear()
            return records
        deadline_s = _deadline_s(timeout_s)
        while (message := self._message(deadline_s)) is not None:
            if message:
                return message
        return []

    @overload
    def wait_for(self, wanted: int, *, timeout_s: float | None = None) -> Event: ...

    @overload
    def wait_for(
        self, wanted: type[Kind], where: Callable[[Kind], bool] | None = None, *, timeout_s: float | None = None
    ) -> Kind: ...

    def wait_for(
        self, wanted: int | type[Any], where: Callable[[Any], bool] | None = None, *, timeout_s: float | None = None
    ) -> Any:
        """The next record that fits; those before it are passed over.

        Args:
            wanted: the code of an event, such as `EventCode.ARMED`, or a record class.
            where: what is true of the record; None: any of its class.
            timeout_s: how long to wait for it [s]; None: for ever.

        Raises:
            ClientError: its topic is not among those asked for.
            SilenceError: it did not come in time.
            RefusedKeyError, SchemaError, WireError: as `receive`.
        """
        kind = Event if isinstance(wanted, int) else wanted
        name = f"event {int(wanted)}" if isinstance(wanted, int) else kind.__name__
        if kind.topic not in self._topics:
            raise ClientError(f"{name}: cannot be waited for without its topic; add {kind.__name__} to the topics")
        deadline_s = _deadline_s(timeout_s)
        while True:
            while self._ahead:
                record = self._ahead.popleft()
                if not isinstance(record, kind) or (isinstance(wanted, int) and record.code != wanted):
                    continue
                if where is None or where(record):
                    return record
            message = self._message(deadline_s)
            if message is None:
                raise SilenceError(f"{self.endpoint}: {name} did not come within {timeout_s:g} s{self.doubt}")
            self._ahead.extend(message)

    @property
    def doubt(self) -> str:
        """What is wrong with what answers at the endpoint, to be put behind a statement; empty when nothing is."""
        return self._connection.doubt

    def close(self) -> None:
        """Disconnect. May be called twice."""
        self._connection.close()
        self._context.term()

    def _message(self, deadline_s: float) -> list[Record] | None:
        """The records of the next message, which may have none; None when no message came in time."""
        if self._socket.closed:
            raise ClientError(f"{self.endpoint}: this connection is closed; connect again")
        left_s = deadline_s - time.monotonic()
        if not self._connection.wait(None if left_s == math.inf else left_s):
            return None
        return self._accept(self._socket.recv_multipart())

    def _accept(self, frames: list[bytes]) -> list[Record]:
        if len(frames) != 2:
            raise WireError(f"{self.endpoint}: a message of {len(frames)} frames, not topic and payload")
        records = decode(*frames)
        accepted: list[Record] = []
        for record in records:
            if isinstance(record, Status):
                self._learn(record)
            if self.latest_status is None or record.topic not in self._topics:
                continue
            if record.topic in _EVERY_TICK:
                accepted.extend(self._gap(record.topic, record.seq))
            accepted.append(record)
        return accepted

    def _learn(self, status: Status) -> None:
        if status.schema != SCHEMA:
            raise SchemaError(
                f"{self.endpoint}: hapticd {status.version} there speaks schema {status.schema}, this "
                f"client {SCHEMA}; install the release that the daemon runs"
            )
        before, self.latest_status = self.latest_status, status
        if before is None:
            return
        if status.every_ticks != before.every_ticks:
            self._last.clear()
        if status.started_timestamp != before.started_timestamp:
            self._anew = self._last.keys() - self._back
            self._back.clear()

    def _gap(self, topic: Topic, seq: int) -> list[Gap]:
        last = self._last.get(topic)
        self._last[topic] = seq
        step = self.latest_status.every_ticks if self.latest_status is not None else 1
        if topic in self._anew:  # it may have counted past the last one already
            self._anew.discard(topic)
            return [Gap(topic, last, seq, 0)] if last is not None else []
        if last is None or seq == last + step:
            return []
        missing = max(0, (seq - last) // step - 1) if seq > last else 0
        if seq <= last:
            self._back.add(topic)
        elif missing == 0:
            return []
        self.missing[topic] += missing
        return [Gap(topic, last, seq, missing)]


def _deadline_s(timeout_s: float | None) -> float:
    return math.inf if timeout_s is None else time.monotonic() + timeout_s


def _topic(topic: type[Any] | Topic | str) -> Topic:
    name = topic if isinstance(topic, str) else topic.topic
    try:
        return Topic(name if "/" in name else f"hapticd/{name}")
    except ValueError:
        known = ", ".join(one.removeprefix("hapticd/") for one in Topic)
        raise ClientError(f"topic {name!r}: not one of {known}") from None
