"""The memory that the loop and the supervisor share.

    words | the driver's metrics | answer | request | events | the driver's trace | what clients say | tick records

One writer a word. A ring's counter is stored after its slot, and the reader looks at the counter again after it has
copied a slot: on x86-64 stores become visible in order and a word in one go, so what was not overwritten by then is
whole. Other machines do not promise that, nor does a 32-bit Python on this one, and plain Python cannot
ask them to, so they are refused.

The memory is an anonymous file: it has no name, and it is gone when both processes are.
"""

from __future__ import annotations

import mmap
import os
import platform
import sys
from typing import Any

import msgpack

from hapticd.config.objects import MAX_OBJECTS
from hapticd.config.remote import MAX_PORTS
from hapticd.device import MOST_METRICS
from hapticd.errors import HapticdError
from hapticd.tick.event import LoopEvent
from hapticd.tick.record import RecordLayout, TickRecord
from hapticd.tick.remote.update import SLOT_BYTES
from hapticd.trace import AREA_BYTES

MOST_PORTS = MAX_OBJECTS + MAX_PORTS
"""Most things in a scene that clients may drive."""

HISTORY_S = 8.0
"""How much of the past the ring of records holds [s]."""

(
    RECORDS,  # records written
    EVENTS,  # events written
    SUPERVISOR_BEAT,  # when the supervisor last showed that it lives [ns of CLOCK_MONOTONIC]
    REQUESTS,  # requests sent
    REQUEST_LENGTH,  # of the last one [bytes]
    ANSWERED,  # requests answered
    ANSWERED_AT,  # records written when the last one was
    DISARM,  # how often disarming was asked for, which waits behind no request
    DISARMED,  # and how often it was done
    NEXT_SEQ,  # what the loop leaves to the next one: `hapticd.loop.resume`
    SKIPPED,
    LAW,
    MAY_ARM,
    LATCHED,
    REMOTE,  # updates that clients sent for what they may drive
    PORTS,  # which list of those things the loop has: `hapticd.loop.remote_slots`
    LAW_CODE,  # what the loop has loaded from files, which it leaves to the next one as well
    PORT_LAW_CODE,
    FIELDS,
    PORTS_SINCE,  # deadline of the last tick that was recorded with another list of them [ns of CLOCK_MONOTONIC]
) = range(20)
"""Words, each written by one side only."""

DISARMED_SINCE = "not done: disarming was asked for after it"
"""The answer to a request that would put forces on after all, on either side of the memory."""

GO = b"go"
"""The packet that lets the loop's process open the device."""

DEVICE_LOST = 3
"""Exit code of the loop's process: the device is gone, and may come back."""

FORCE_LEFT = 4
"""Exit code of the loop's process: it ended, and the driver could not take the force away."""

LARGEST_ANSWER = 1 << 16
"""Of the packet with which the loop's process says that it is ready, or why it is not [bytes]."""

_METRICS = 2048
_ANSWER = 4096
_REQUEST = 8192
_REQUEST_SIZE = 1 << 18
_EVENTS = _REQUEST + _REQUEST_SIZE
_EVENT_SIZE = 1024
_EVENT_SLOTS = 256
_TRACE = _EVENTS + _EVENT_SIZE * _EVENT_SLOTS
_REMOTE = _TRACE + AREA_BYTES
_RECORDS = _REMOTE + MOST_PORTS * SLOT_BYTES


class SharedMemory:
    """The shared memory of one loop.

    Args:
        layout: how a record lies in memory.
        rate_hz: ticks a second, which with `HISTORY_S` sets how many records are kept [Hz].
        descriptor: an existing memory to map; None makes a new one.

    Attributes:
        view: all of it.
        words: the 64-bit words at the start.
        metrics: the driver's metrics; it writes each of them as a whole.
        trace: the driver's trace, as `hapticd.trace` keeps it.
        remote: what clients say, as `hapticd.loop.remote_slots` keeps it.
        remote_words: the same as 64-bit words.
        record_area: where the records lie.
        descriptor: file descriptor to hand to the other process.

    Raises:
        HapticdError: this processor does not keep stores in order, or this Python does not store a word in one go.
    """

    def __init__(self, layout: RecordLayout, rate_hz: float, descriptor: int | None = None) -> None:
        if platform.machine() not in ("x86_64", "AMD64"):
            raise HapticdError(
                f"hapticd needs a 64-bit x86 processor: on {platform.machine()} the shared ring is not safe"
            )
        if sys.maxsize < 1 << 32:
            raise HapticdError("hapticd needs a 64-bit Python: one of 32 bits stores a word of the ring in two goes")
        self.layout = layout
        self.slots = int(HISTORY_S * rate_hz)
        size = _RECORDS + self.slots * layout.size
        if descriptor is None:
            descriptor = os.memfd_create("hapticd")
            os.ftruncate(descriptor, size)
        self.descriptor = descriptor
        self._map = mmap.mmap(descriptor, size)
        self.view = memoryview(self._map)
        self.words = self.view[:_METRICS].cast("q")
        self.metrics = self.view[_METRICS : _METRICS + 8 * MOST_METRICS].cast("d")
        self.trace = self.view[_TRACE:_REMOTE]
        self.remote = self.view[_REMOTE:_RECORDS]
        self.remote_words = self.remote.cast("q")
        self.record_area = self.view[_RECORDS:]

    def close(self) -> None:
        """Unmap the memory."""
        self.words.release()
        self.metrics.release()
        self.trace.release()
        self.remote_words.release()
        self.remote.release()
        self.record_area.release()
        self.view.release()
        self._map.close()
        os.close(self.descriptor)

    def write_event(self, event: LoopEvent) -> None:
        """Append an event (loop side); text that does not fit is cut."""
        text = event.text.encode(errors="replace")[:600].decode(errors="ignore")
        row: bytes = msgpack.packb([event.code, text, event.seq, event.deadline_ns, event.fields])
        if len(row) > _EVENT_SIZE - 8:
            row = msgpack.packb([event.code, text, event.seq, event.deadline_ns, {}])
        start = _EVENTS + self.words[EVENTS] % _EVENT_SLOTS * _EVENT_SIZE
        self.view[start : start + 8] = len(row).to_bytes(8, "little")
        self.view[start + 8 : start + 8 + len(row)] = row
        self.words[EVENTS] += 1

    def post(self, request: dict[str, Any]) -> None:
        """Send a request to the loop (supervisor side).

        Raises:
            HapticdError: the one before is not answered yet, it is too long, or it holds what no message can.
        """
        if self.words[ANSWERED] != self.words[REQUESTS]:
            raise HapticdError("the control loop is still busy with the request before")
        try:
            packed: bytes = msgpack.packb(request | {"disarm": self.words[DISARM]})
        except (ValueError, TypeError, OverflowError) as error:  # parameters are as a law of anybody's makes them
            raise HapticdError(f"the loop cannot be told: {type(error).__name__}: {error}") from error
        if len(packed) > _REQUEST_SIZE:
            raise HapticdError(f"the request is {len(packed)} bytes long, {_REQUEST_SIZE} fit")
        self.view[_REQUEST : _REQUEST + len(packed)] = packed
        self.words[REQUEST_LENGTH] = len(packed)
        self.words[REQUESTS] += 1

    def request(self) -> dict[str, Any]:
        """The request that waits (loop side); `disarm` is how often disarming had been asked for when it was sent."""
        unpacked: dict[str, Any] = msgpack.unpackb(self.view[_REQUEST : _REQUEST + self.words[REQUEST_LENGTH]])
        return unpacked

    def answer(self, verdict: str) -> None:
        """Answer it (loop side): "" is done, anything else says why not."""
        row = verdict.encode(errors="replace")[: _REQUEST - _ANSWER - 8]
        self.view[_ANSWER : _ANSWER + 8] = len(row).to_bytes(8, "little")
        self.view[_ANSWER + 8 : _ANSWER + 8 + len(row)] = row
        self.words[ANSWERED_AT] = self.words[RECORDS]
        self.words[ANSWERED] = self.words[REQUESTS]

    def verdict(self) -> str:
        """The answer to the last request (supervisor side)."""
        length = int.from_bytes(self.view[_ANSWER : _ANSWER + 8], "little")
        return bytes(self.view[_ANSWER + 8 : _ANSWER + 8 + length]).decode(errors="replace")


class RecordReader:
    """Reads tick records from the ring; never in the writer's way.

    Args:
        shared: the memory.
        newest: begin with the next record, not with the oldest that is there.

    Attributes:
        dropped: records lost because the reader was too slow.
    """

    def __init__(self, shared: SharedMemory, *, newest: bool = False) -> None:
        self._shared = shared
        self._area = shared.record_area
        self._next = shared.words[RECORDS] if newest else 0
        self.dropped = 0

    @property
    def fetched(self) -> int:
        """How many records were read or passed over so far."""
        return self._next

    def read(self, most: int = 4096) -> list[TickRecord]:
        """The records that are new, oldest first, at most `most`."""
        layout = self._shared.layout
        slots = self._shared.slots
        words = self._shared.words
        written = words[RECORDS]
        if written - self._next > slots - 2:
            keep = written - slots // 2  # leap well clear of the writer, or the next read is overtaken again
            self.dropped += keep - self._next
            self._next = keep
        records = []
        for number in range(self._next, min(written, self._next + most)):
            start = number % slots * layout.size
            row = bytes(self._area[start : start + layout.size])
            self._next = number + 1
            if words[RECORDS] - number > slots - 2:
                self.dropped += 1
            else:
                records.append(layout.unpack(row))
        return records


class EventReader:
    """Reads events from their ring; never in the writer's way.

    Args:
        shared: the memory.

    Attributes:
        dropped: events lost because the reader was too slow.
    """

    def __init__(self, shared: SharedMemory) -> None:
        self._shared = shared
        self._next = 0
        self.dropped = 0

    def read(self) -> list[LoopEvent]:
        """The events that are new, oldest first."""
        view = self._shared.view
        words = self._shared.words
        written = words[EVENTS]
        oldest = max(self._next, written - _EVENT_SLOTS + 1)
        self.dropped += oldest - self._next
        events = []
        for number in range(oldest, written):
            start = _EVENTS + number % _EVENT_SLOTS * _EVENT_SIZE
            row = bytes(view[start : start + _EVENT_SIZE])
            if words[EVENTS] - number >= _EVENT_SLOTS:  # overwritten, or just being so
                self.dropped += 1
            else:
                length = int.from_bytes(row[:8], "little")
                events.append(LoopEvent(*msgpack.unpackb(row[8 : 8 + length])))
        self._next = written
        return events
