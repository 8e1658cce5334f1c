"""Read a daemon's telemetry.

    from hapticd.client import Cycle, Gap, connect

    with connect(topics=[Cycle]) as client:
        for record in client:
            print(record)

The contract behind it is docs/telemetry.md; any language with ZeroMQ and msgpack can read the same.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, TypeAlias

import msgpack
import zmq

from hapticd.contracts.errors import HapticdError
from hapticd.telemetry.endpoint import DEFAULT_INSTANCE, telemetry_endpoint
from hapticd.telemetry.status import Status
from hapticd.telemetry.wire import SCHEMA, Topic

__all__ = [
    "Client",
    "ClientError",
    "Cycle",
    "Damping",
    "Energy",
    "Event",
    "Gap",
    "Input",
    "Position",
    "Record",
    "SchemaError",
    "SilenceError",
    "Status",
    "Timing",
    "WireError",
    "connect",
    "decode",
]


class ClientError(HapticdError):
    """Base of what can go wrong for a subscriber."""


class SilenceError(ClientError):
    """Nothing arrived in the time allowed."""


class SchemaError(ClientError):
    """The daemon speaks a version of the contract that this client does not know."""


class WireError(ClientError):
    """A message that is not what the contract says."""


@dataclass(frozen=True, slots=True)
class Position:
    """One tick: where the device was and what pushed it, one element an axis.

    Attributes:
        timestamp: seconds since the epoch at the tick's deadline [s].
        seq: tick number.
        position_m: position [m].
        velocity_m_per_s: estimated velocity [m/s].
        force_n: force applied to the device [N].
        force_requested_n: force asked for before the guard [N].
        invalid: a value was not finite and stands here as 0.
    """

    topic: ClassVar[Topic] = Topic.POSITION

    timestamp: float
    seq: int
    position_m: tuple[float, ...]
    velocity_m_per_s: tuple[float, ...]
    force_n: tuple[float, ...]
    force_requested_n: tuple[float, ...]
    invalid: bool = False


@dataclass(frozen=True, slots=True)
class Energy:
    """One tick: the energy ledger of all contacts.

    Attributes:
        timestamp: seconds since the epoch at the tick's deadline [s].
        seq: tick number.
        energy_j: energy into the virtual environment, with the applied force [J].
        spring_energy_j: stored in its springs [J].
        dissipated_j: taken by wall damping and law [J].
        generated_j: made by sampling and hold [J].
        invalid: a value was not finite and stands here as 0.
    """

    topic: ClassVar[Topic] = Topic.ENERGY

    timestamp: float
    seq: int
    energy_j: float
    spring_energy_j: float
    dissipated_j: float
    generated_j: float
    invalid: bool = False


@dataclass(frozen=True, slots=True)
class Damping:
    """One tick: what the law did, one element a wall.

    Attributes:
        timestamp: seconds since the epoch at the tick's deadline [s].
        seq: tick number.
        damping_n_s_per_m: damping of the law [N s/m].
        in_contact: whether the device was inside the wall.
        felt_mass_kg: mass that the law has identified [kg]; 0 while unknown.
        invalid: a value was not finite and stands here as 0.
    """

    topic: ClassVar[Topic] = Topic.DAMPING

    timestamp: float
    seq: int
    damping_n_s_per_m: tuple[float, ...]
    in_contact: tuple[bool, ...]
    felt_mass_kg: tuple[float, ...]
    invalid: bool = False


@dataclass(frozen=True, slots=True)
class Timing:
    """One tick: how punctual it was.

    Attributes:
        timestamp: seconds since the epoch at the tick's deadline [s].
        seq: tick number.
        deadline_ns: when it was due [ns of CLOCK_MONOTONIC].
        late_us: how late it started [us].
        busy_us: how long its body took [us].
        dt_s: time since the tick before, on the device's clock where it has one [s].
        invalid: a value was not finite and stands here as 0.
    """

    topic: ClassVar[Topic] = Topic.TIMING

    timestamp: float
    seq: int
    deadline_ns: int
    late_us: float
    busy_us: float
    dt_s: float
    invalid: bool = False


@dataclass(frozen=True, slots=True)
class Cycle:
    """One completed cycle of energy exchange with a wall.

    Attributes:
        timestamp: seconds since the epoch at its end [s].
        seq: tick number of its end.
        contact: index of the wall.
        cycle: number of the cycle at this wall.
        energy_j: energy at its end [J].
        generated_j: energy that it generated [J].
        damping_n_s_per_m: damping of the law when it ended [N s/m].
        duration_s: how long it took [s].
        invalid: a value was not finite and stands here as 0.
    """

    topic: ClassVar[Topic] = Topic.CYCLE

    timestamp: float
    seq: int
    contact: int
    cycle: int
    energy_j: float
    generated_j: float
    damping_n_s_per_m: float
    duration_s: float
    invalid: bool = False


@dataclass(frozen=True, slots=True)
class Input:
    """Buttons, gripper and wrist; what the device has not is None or empty.

    Attributes:
        timestamp: seconds since the epoch at the tick's deadline [s].
        seq: tick number.
        buttons: bit i is button i.
        gripper_m: opening [m].
        orientation: rotation matrix row by row.
        invalid: a value was not finite and stands here as 0.
    """

    topic: ClassVar[Topic] = Topic.INPUT

    timestamp: float
    seq: int
    buttons: int | None = None
    gripper_m: float | None = None
    orientation: tuple[float, ...] = ()
    invalid: bool = False


@dataclass(frozen=True, slots=True)
class Event:
    """Something happened.

    Attributes:
        timestamp: seconds since the epoch at its tick [s].
        seq: tick number.
        code: `hapticd.contracts.event.EventCode`; a newer daemon may know more of them.
        text: one line for people.
        fields: numbers and names that belong to it.
    """

    topic: ClassVar[Topic] = Topic.EVENT

    timestamp: float
    seq: int
    code: int
    text: str
    fields: dict[str, float | int | str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Gap:
    """Ticks that did not arrive, told before the first record after them.

    Attributes:
        topic: of those ticks.
        after: last tick before the gap.
        seq: first tick after it.
        missing: ticks in between; 0 when the daemon started anew and counts from the beginning.
    """

    topic: Topic
    after: int
    seq: int
    missing: int


Tick: TypeAlias = Position | Energy | Damping | Timing
Record: TypeAlias = Tick | Cycle | Input | Event | Status | Gap

_EVERY_TICK = (Topic.POSITION, Topic.ENERGY, Topic.DAMPING, Topic.TIMING)
_LARGEST_MESSAGE = 16 * 1024 * 1024


def connect(
    endpoint: str | None = None,
    instance: str = DEFAULT_INSTANCE,
    topics: Sequence[type[Tick | Cycle | Input | Event | Status] | Topic | str] = tuple(Topic),
    timeout_s: float | None = None,
    receive_high_water: int = 1000,
) -> Client:
    """Subscribe to a daemon. It need not run yet, and may be restarted: ZeroMQ connects again by itself.

    Args:
        endpoint: for example "tcp://127.0.0.1:9872"; None: the instance's own on this computer.
        instance: name of the daemon's instance, when no endpoint is given.
        topics: record classes, or topics by name ("position" or "hapticd/position"); all unless given.
        timeout_s: longest silence while iterating [s]; None: wait for ever.
        receive_high_water: messages kept while the caller is busy; new ones are lost beyond it.

    Raises:
        ClientError: no such topic, or ZeroMQ cannot use the endpoint.
    """
    return Client(endpoint or telemetry_endpoint(instance), topics, timeout_s, receive_high_water)


class Client:
    """An iterable of records; made by `connect`.

    Records are yielded once the daemon's first status has arrived and its schema is known. Ticks that are
    missing are yielded as a `Gap`.

    Attributes:
        endpoint: what it is connected to.
        status: latest status of the daemon, None before the first, whether or not that topic was asked for.
        missing: ticks that did not arrive so far, by topic.
    """

    def __init__(
        self,
        endpoint: str,
        topics: Sequence[type[Tick | Cycle | Input | Event | Status] | Topic | str],
        timeout_s: float | None,
        receive_high_water: int,
    ) -> None:
        self.endpoint = endpoint
        self.status: Status | None = None
        self.missing: dict[Topic, int] = dict.fromkeys(_EVERY_TICK, 0)
        self._topics = frozenset(_topic(topic) for topic in topics)
        self._timeout_s = timeout_s
        self._last: dict[Topic, int] = {}
        self._context = zmq.Context(io_threads=1)
        self._socket = self._context.socket(zmq.SUB)
        try:
            self._socket.setsockopt(zmq.LINGER, 0)
            self._socket.setsockopt(zmq.RCVHWM, receive_high_water)
            self._socket.setsockopt(zmq.MAXMSGSIZE, _LARGEST_MESSAGE)
            if "[" in endpoint:
                self._socket.setsockopt(zmq.IPV6, 1)
            for topic in self._topics | {Topic.STATUS}:
                self._socket.setsockopt_string(zmq.SUBSCRIBE, topic)
            self._socket.connect(endpoint)
        except zmq.ZMQError as error:
            self.close()
            raise ClientError(f"{endpoint}: {error.strerror}; an endpoint is ipc://PATH or tcp://HOST:PORT") from error

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __iter__(self) -> Iterator[Record]:
        """Every record as it arrives.

        Raises:
            SilenceError: nothing arrived for `timeout_s`.
            SchemaError, WireError: as `receive`.
        """
        while True:
            records = self.receive(self._timeout_s)
            if not records:
                raise SilenceError(f"{self.endpoint}: nothing for {self._timeout_s:g} s; is the daemon running there?")
            yield from records

    def receive(self, timeout_s: float | None = 0.0) -> list[Record]:
        """The records of the next message that has some; empty when none came in time.

        Args:
            timeout_s: how long to wait for it [s]; None: for ever.

        Raises:
            SchemaError: the daemon's schema is not known to this client.
            WireError: somebody sends what the contract does not allow.
        """
        until = math.inf if timeout_s is None else time.monotonic() + timeout_s
        while True:
            left_s = until - time.monotonic()
            if not self._socket.poll(None if left_s == math.inf else max(0, math.ceil(left_s * 1000))):
                return []
            records = self._accept(self._socket.recv_multipart())
            if records:
                return records

    def close(self) -> None:
        """Disconnect. May be called twice."""
        self._socket.close(linger=0)
        self._context.term()

    def _accept(self, frames: list[bytes]) -> list[Record]:
        if len(frames) != 2:
            raise WireError(f"{self.endpoint}: a message of {len(frames)} frames, not topic and payload")
        records = decode(*frames)
        accepted: list[Record] = []
        for record in records:
            if isinstance(record, Status):
                self._learn(record)
            if self.status is None or record.topic not in self._topics:
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
        if self.status is not None and status.every_ticks != self.status.every_ticks:
            self._last.clear()
        self.status = status

    def _gap(self, topic: Topic, seq: int) -> list[Gap]:
        last = self._last.get(topic)
        self._last[topic] = seq
        step = self.status.every_ticks if self.status is not None else 1
        if last is None or seq == last + step:
            return []
        missing = max(0, (seq - last) // step - 1) if seq > last else 0
        if seq > last and missing == 0:
            return []
        self.missing[topic] += missing
        return [Gap(topic, last, seq, missing)]


def decode(topic: bytes, payload: bytes) -> list[Tick | Cycle | Input | Event | Status]:
    """The records of one message; none when the topic is not known to this client.

    Raises:
        WireError: the payload is not what the contract says.
    """
    reader = _READERS.get(topic)
    if reader is None:
        return []
    name = topic.decode()
    try:
        maps = msgpack.unpackb(payload, raw=False)
    except (ValueError, TypeError, msgpack.exceptions.UnpackException) as error:
        raise WireError(f"{name}: payload is no msgpack: {error or type(error).__name__}") from error
    if not isinstance(maps, list):
        raise WireError(f"{name}: payload is {type(maps).__name__}, not an array of maps")
    return [reader.read(name, fields) for fields in maps]


class _UnfitError(Exception):
    """A value that a key cannot have; the text says what it should be."""


def _number(value: Any) -> float:
    if type(value) is float and math.isfinite(value):
        return value
    if type(value) is int:
        return float(value)
    raise _UnfitError("a finite number")


def _integer(value: Any) -> int:
    if type(value) is int:
        return value
    raise _UnfitError("an integer")


def _flag(value: Any) -> bool:
    if type(value) is bool:
        return value
    raise _UnfitError("true or false")


def _text(value: Any) -> str:
    if type(value) is str:
        return value
    raise _UnfitError("text")


def _is_plain(value: Any) -> bool:
    return isinstance(value, int | str) or (isinstance(value, float) and math.isfinite(value))


def _array_of(element: Callable[[Any], Any]) -> Callable[[Any], tuple[Any, ...]]:
    def convert(value: Any) -> tuple[Any, ...]:
        if type(value) is not list:
            raise _UnfitError("an array")
        return tuple([element(one) for one in value])

    return convert


_CONVERTERS: dict[str, Callable[[Any], Any]] = {
    "float": _number,
    "int": _integer,
    "bool": _flag,
    "str": _text,
    "int | None": _integer,
    "float | None": _number,
    "tuple[float, ...]": _array_of(_number),
    "tuple[int, ...]": _array_of(_integer),
    "tuple[bool, ...]": _array_of(_flag),
    "tuple[str, ...]": _array_of(_text),
}


class _Reader:
    """Makes records of one class from maps: keys are its fields, types their annotations."""

    def __init__(self, record: type[Any]) -> None:
        self.record = record
        self.keys = []
        for key in dataclasses.fields(record):
            if key.name != "fields":
                required = key.default is dataclasses.MISSING
                self.keys.append((key.name, _CONVERTERS[str(key.type)], required))

    def read(self, topic: str, fields: Any) -> Any:
        if type(fields) is not dict:
            raise WireError(f"{topic}: an element is {type(fields).__name__}, not a map")
        values = {}
        for name, convert, required in self.keys:
            if name in fields:
                try:
                    values[name] = convert(fields[name])
                except _UnfitError as unfit:
                    raise WireError(f"{topic}: {name} = {str(fields[name])[:40]!r} is not {unfit}") from None
            elif required:
                raise WireError(f"{topic}: a map has no `{name}`")
        if self.record is Event:
            values["fields"] = {
                key: value
                for key, value in fields.items()
                if key not in values and isinstance(key, str) and _is_plain(value)
            }
        return self.record(**values)


_READERS: dict[bytes, _Reader] = {
    record.topic.encode(): _Reader(record)
    for record in (Position, Energy, Damping, Timing, Cycle, Input, Event, Status)
}


def _topic(topic: type[Any] | Topic | str) -> Topic:
    name = topic if isinstance(topic, str) else topic.topic
    try:
        return Topic(name if "/" in name else f"hapticd/{name}")
    except ValueError:
        known = ", ".join(one.removeprefix("hapticd/") for one in Topic)
        raise ClientError(f"topic {name!r}: not one of {known}") from None
