"""Publishes what happened, tick by tick, over ZeroMQ; never waits for a subscriber.

One XPUB socket, its sends non-blocking: a subscriber that falls behind by `send_high_water` messages loses
the next and sees it by `seq`; the others lose none.
"""

from __future__ import annotations

import errno
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import zmq

from hapticd.config.models import TelemetryConfig
from hapticd.errors import InstanceError
from hapticd.keys.connections import ConnectionBound, descriptor_of
from hapticd.keys.heartbeat import expect_signs_of_life
from hapticd.keys.local_bind import bind_local
from hapticd.keys.policy import stays_here
from hapticd.keys.server import CurveServer
from hapticd.keys.store import KeyRing
from hapticd.own_file import OwnFile
from hapticd.telemetry import wire
from hapticd.telemetry.clock import timestamp_s
from hapticd.telemetry.wire import INVALID, Inputs, Map, Topic
from hapticd.tick.contact_record import WallRecord
from hapticd.tick.event import LoopEvent
from hapticd.tick.record import TickRecord

BATCH_NS = 20_000_000
"""Longest time that a tick waits in a batch [ns]."""

_TOPICS_PER_TICK = 6
_MOST_SUBSCRIPTIONS_AT_ONCE = 1000
_LAST_WORDS_MS = 100
_LARGEST_REQUEST = 128  # bytes of a subscription; ZeroMQ keeps forty times that for each
_MOST_UNREAD = 10  # subscriptions of a client: ZeroMQ keeps what it has read before it can be refused
_LARGEST_WITH_KEYS = 1024  # the handshake is longer, and who it lets in is listed


@dataclass(slots=True)
class PublisherCounts:
    """Counts of a publisher since it was made.

    Attributes:
        ticks: ticks published, after decimation.
        cycles: cycles published.
        events: events published.
        messages: messages sent, received or not.
        payload_bytes: bytes of payload in them.
        refused: messages that ZeroMQ did not take, 0 unless something is wrong.
        dropped: clients that were disconnected since they only filled the memory.
        invalid: maps in which a number was not finite.
        subscriptions: requests for a topic seen.
    """

    ticks: int = 0
    cycles: int = 0
    events: int = 0
    messages: int = 0
    payload_bytes: int = 0
    refused: int = 0
    dropped: int = 0
    invalid: int = 0
    subscriptions: int = 0


class Publisher:
    """The telemetry of one instance.

    Not guarded against a second daemon on the same ipc path, which would silently take it over: hold the
    instance's lock first. Not for use from two threads.

    Args:
        config: the [telemetry] table.
        ipc_path: where to publish to this computer, None for nowhere; `config.ipc` = false is obeyed as well.
        info: what the device reports besides its position.
        epoch_offset_ns: `clock.measure_epoch_offset_ns` at the start.
        ring: the keys that an endpoint for other computers takes; without them there can be none.

    Raises:
        InstanceError: an endpoint cannot be had; the message says which, why and what to do.
    """

    def __init__(
        self,
        config: TelemetryConfig,
        ipc_path: Path | None,
        info: Inputs,
        epoch_offset_ns: int,
        ring: KeyRing | None = None,
    ) -> None:
        self.counts = PublisherCounts()
        self.endpoints: list[str] = []
        self._offset_ns = epoch_offset_ns
        self._inputs = info
        self._has_input = bool(info.buttons or info.has_gripper or info.has_orientation)
        self._last_input: tuple[object, ...] = ()
        self._input_message: list[Map] | None = None
        self._status: dict[str, Any] | None = None
        self._seq = -1
        self._cycles = wire.Cycles()
        self._packer = wire.new_packer()
        self._position: list[Map] = []
        self._energy: list[Map] = []
        self._damping: list[Map] = []
        self._contact: list[Map] = []
        self._objects = wire.Objects()
        self._timing: list[Map] = []
        self._input: list[Map] = []
        self._batch_due_ns: int | None = None
        self._high_water = config.send_high_water
        self.reconfigure(config)

        self._file: OwnFile | None = None
        self._gate: CurveServer | None = None
        self._context = zmq.Context(io_threads=1)
        self._socket = self._context.socket(zmq.XPUB)
        self._connections = ConnectionBound(self._socket)
        try:
            self._socket.setsockopt(zmq.XPUB_VERBOSE, 1)
            self._socket.setsockopt(zmq.SNDHWM, config.send_high_water)
            self._socket.setsockopt(zmq.LINGER, 0)
            self._socket.setsockopt(zmq.MAXMSGSIZE, _LARGEST_REQUEST)
            self._socket.setsockopt(zmq.RCVHWM, _MOST_UNREAD)
            if config.ipc and ipc_path is not None:
                self._bind_ipc(ipc_path)
            expect_signs_of_life(self._socket)
            if config.tcp is not None:
                self._bind_tcp(config.tcp, ring)
        except BaseException:
            self.close()
            raise

    @property
    def flush_due_ns(self) -> int | None:
        """When `flush` has something to send [ns of CLOCK_MONOTONIC]; None while no tick waits."""
        return self._batch_due_ns

    def reconfigure(self, config: TelemetryConfig) -> None:
        """Take over batching and decimation from a reloaded file; endpoints stay as they were bound.

        What waits is sent first: a status tells the step of `seq` of all that comes after it.
        """
        self._send_batch()
        self._batch_ticks = self._most_ticks = config.batch_ticks
        self._every_ticks = config.every_ticks
        self._input_every_tick = config.input_every_tick

    def follow_clock(self, epoch_offset_ns: int) -> None:
        """Stamp by another offset from now on; what waits is of the one before."""
        self._send_batch()
        self._offset_ns = epoch_offset_ns

    def take_loop(self) -> None:
        """Publish of another loop from now on, which has touched nothing yet."""
        self._objects = wire.Objects()

    def admit(self, ring: KeyRing) -> None:
        """Take other keys over; a client that is no longer listed is disconnected."""
        if self._gate is not None:
            self._gate.renew(ring.pair, ring.watchers())

    def publish(self, records: Sequence[TickRecord]) -> None:
        """Publish ticks, oldest first. Full batches leave now, the rest with `flush`; cycles leave now.

        What would fill half of a subscriber's queue at once leaves now in messages of 20 ms, whatever a batch is: it
        is the daemon that was late, and no subscriber is to lose a tick by it.
        """
        flood = 2 * _TOPICS_PER_TICK * len(records) > self._high_water * self._batch_ticks
        self._most_ticks = len(records) if flood else self._batch_ticks
        cycles: list[Map] = []
        for record in records:
            timestamp = timestamp_s(record.deadline_ns, self._offset_ns)
            self._seq = record.seq
            for contact, _ in self._cycles.completed(record):
                cycles.append(wire.cycle_map(record, timestamp, contact))
            contacts = self._objects.see(record)
            if self._has_input:
                self._add_input(record, timestamp)
            if record.seq % self._every_ticks == 0:
                self._add_tick(record, timestamp, contacts)
        if flood:
            self._send_batch()
        if cycles:
            self.counts.cycles += len(cycles)
            self._send(Topic.CYCLE, cycles)
        self.service()

    def event(self, event: LoopEvent) -> None:
        """Publish an event at once."""
        self.counts.events += 1
        self._send(Topic.EVENT, [wire.event_map(event, timestamp_s(event.deadline_ns, self._offset_ns))])

    def status(self, status: Mapping[str, Any]) -> None:
        """Publish the state of the daemon, and keep it for later subscribers."""
        self._status = dict(status)
        self._send_status()

    def completed(self, status: Mapping[str, Any]) -> Map:
        """The state of the daemon with what only this knows: the time, the last tick, and one in how many there is."""
        now = timestamp_s(time.monotonic_ns(), self._offset_ns)
        return wire.status_map(status, now, self._seq, self._every_ticks)

    def flush(self, now_ns: int) -> None:
        """Send the ticks that wait, when the oldest has waited 20 ms.

        Args:
            now_ns: CLOCK_MONOTONIC, and as much more as the next call may come too late [ns].
        """
        if self._batch_due_ns is not None and now_ns >= self._batch_due_ns:
            self._send_batch()
        self.service()

    def service(self) -> None:
        """Answer new subscribers: the state of the daemon and of its buttons, at once. Returns at once."""
        if self._gate is not None:
            self._gate.turn()
        wanted: set[Topic] = set()
        for _ in range(_MOST_SUBSCRIPTIONS_AT_ONCE):
            # `recv` would raise when there is nothing; this costs a tenth of it.
            if not int(self._socket.getsockopt(zmq.EVENTS)) & zmq.POLLIN:
                break
            try:
                request = self._socket.recv(zmq.NOBLOCK, copy=False)
            except zmq.Again:
                break
            wanted.update(self._asked_for(request))
        if Topic.STATUS in wanted and self._status is not None:
            self._send_status()
        if Topic.INPUT in wanted and self._input_message is not None:
            self._send(Topic.INPUT, self._input_message)

    def close(self) -> None:
        """Send what waits, let go of the endpoints, remove the ipc file. May be called twice.

        The last messages have 0.1 s to leave; only a stalled subscriber makes it that long.
        """
        if not self._socket.closed:
            self._send_batch()
        self._socket.close(linger=_LAST_WORDS_MS)
        self._connections.close()
        if self._gate is not None:
            self._gate.close()
        self._context.term()  # returns when ZeroMQ's thread has let go of the path
        if self._file is not None:
            self._file.unlink()
            self._file = None

    def _add_tick(self, record: TickRecord, timestamp: float, contacts: Sequence[WallRecord]) -> None:
        if self._batch_due_ns is None:
            self._batch_due_ns = record.deadline_ns + BATCH_NS
        elif record.deadline_ns >= self._batch_due_ns:
            self._send_batch()
            self._batch_due_ns = record.deadline_ns + BATCH_NS
        self._position.append(wire.position_map(record, timestamp))
        self._energy.append(wire.energy_map(record, timestamp))
        self._damping.append(wire.damping_map(record, timestamp, contacts))
        self._contact += wire.contact_maps(record, timestamp)
        self._timing.append(wire.timing_map(record, timestamp))
        self.counts.ticks += 1
        if len(self._position) >= self._most_ticks:
            self._send_batch()

    def _add_input(self, record: TickRecord, timestamp: float) -> None:
        state = (record.buttons, record.gripper_m, record.orientation)
        if state == self._last_input and not self._input_every_tick:
            return
        self._last_input = state
        fields = wire.input_map(record, timestamp, self._inputs)
        self._input_message = [fields]
        self._input.append(fields)
        if self._batch_due_ns is None:
            self._batch_due_ns = record.deadline_ns + BATCH_NS

    def _asked_for(self, request: zmq.Frame) -> list[Topic]:
        """The topics that a request subscribes to; a client that asks for too much else is disconnected."""
        said = request.bytes
        if said[:1] != b"\x01":  # the end of a subscription; a client that has gone has no connection
            return []
        connection = descriptor_of(request)
        self.counts.subscriptions += 1
        topics = [topic for topic in Topic if topic.encode().startswith(said[1:])]
        if topics:
            self._connections.heard(connection)
        elif self._connections.odd(connection):
            self.counts.dropped += 1
        return topics

    def _send_batch(self) -> None:
        self._batch_due_ns = None
        for topic, maps in (
            (Topic.POSITION, self._position),
            (Topic.ENERGY, self._energy),
            (Topic.DAMPING, self._damping),
            (Topic.CONTACT, self._contact),
            (Topic.TIMING, self._timing),
            (Topic.INPUT, self._input),
        ):
            if maps:
                self._send(topic, maps)
                maps.clear()

    def _send_status(self) -> None:
        assert self._status is not None
        self._send(Topic.STATUS, [self.completed(self._status)])

    def _send(self, topic: Topic, maps: list[Map]) -> None:
        self.counts.invalid += sum(INVALID in fields for fields in maps)
        payload: bytes = self._packer.pack(maps)
        try:
            self._socket.send_multipart((topic.encode(), payload), zmq.NOBLOCK)
        except zmq.ZMQError:  # an XPUB drops rather than refuses; if it ever refuses, the loop must not suffer
            self.counts.refused += 1
            return
        self.counts.messages += 1
        self.counts.payload_bytes += len(payload)

    def _bind_tcp(self, endpoint: str, ring: KeyRing | None) -> None:
        if stays_here(endpoint):
            self._socket.setsockopt(zmq.IPV6, "[" in endpoint)
            self._bind(endpoint.replace("localhost", "127.0.0.1"))
            return
        if ring is None:
            raise InstanceError(
                f"{endpoint}: other computers reach it, which takes keys: make them with `hapticd keys make`, or set "
                "telemetry.tcp to a loopback address such as tcp://127.0.0.1:9872"
            )
        try:
            self._socket.setsockopt(zmq.MAXMSGSIZE, _LARGEST_WITH_KEYS)
            self._gate = CurveServer(self._socket, endpoint, ring.pair, ring.watchers(), watch_only=True)
        except zmq.ZMQError as error:
            raise _refused(endpoint, error) from error
        self.endpoints.append(self._gate.endpoint)

    def _bind_ipc(self, path: Path) -> None:
        if path.exists() and not path.is_socket():
            raise InstanceError(f"ipc://{path}: a file that is no socket is in the way; remove it")
        endpoint = f"ipc://{path}"
        try:
            self._file = bind_local(self._socket, path)
        except (zmq.ZMQError, OSError) as error:
            raise _refused(endpoint, error) from error
        self.endpoints.append(endpoint)

    def _bind(self, endpoint: str) -> None:
        try:
            self._socket.bind(endpoint)
        except zmq.ZMQError as error:
            raise _refused(endpoint, error) from error
        self.endpoints.append(self._socket.getsockopt_string(zmq.LAST_ENDPOINT))


def _refused(endpoint: str, error: zmq.ZMQError | OSError) -> InstanceError:
    return InstanceError(f"{endpoint}: {_advice(error.errno or 0)}")


def _advice(number: int) -> str:
    """What went wrong with an endpoint and what to do about it, in one line."""
    match number:
        case errno.EADDRINUSE:
            return "another program listens there; stop it, or set another telemetry.tcp"
        case errno.EACCES | errno.EPERM | errno.EROFS:
            return "no permission; run as the user that owns the directory, or set HAPTICD_RUNTIME_DIR"
        case errno.ENOENT | errno.ENOTDIR:
            return "its directory is not there; make it, or set HAPTICD_RUNTIME_DIR"
        case errno.ENAMETOOLONG:
            return "path longer than 107 bytes; set HAPTICD_RUNTIME_DIR to a shorter one"
        case errno.EADDRNOTAVAIL | errno.ENODEV | errno.EINVAL:
            return "no such address or port on this computer; set another telemetry.tcp"
        case _:
            return f"{zmq.strerror(number)}; set another endpoint in [telemetry]"
