"""A publisher that plays what a test gives it, faster than any device: a minute of ticks in two seconds."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Sequence

from hapticd.config.models import TelemetryConfig
from hapticd.telemetry.records import Status
from hapticd.telemetry.wire import SCHEMA
from hapticd.tick.event import LoopEvent
from hapticd.tick.record import TickRecord
from tests.telemetry.sockets import Wire


class Stage:
    """A publisher with a status twice a second, in a thread of its own.

    Attributes:
        last: number of the last tick that it was given; -1 before the first.
    """

    def __init__(self) -> None:
        self._wire = Wire(say_status=False)
        self._play: queue.Queue[list[TickRecord] | LoopEvent | TelemetryConfig | int | tuple[str, object]] = (
            queue.Queue()
        )
        self._status = Status(version="1.2.3", law="energy-cycle", rate_hz=1000.0, axes=("z",)).as_map()
        self._over = threading.Event()
        self.endpoint = self._wire.endpoint
        self.directory = self._wire.directory
        self.last = -1
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def __enter__(self) -> Stage:
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()
        self._wire.__exit__()

    def play(self, ticks: Sequence[TickRecord]) -> None:
        """Have ticks published, behind those before."""
        self.last = ticks[-1].seq
        self._play.put(list(ticks))

    def event(self, event: LoopEvent) -> None:
        """Have an event published."""
        self._play.put(event)

    def reload(self, every_ticks: int) -> None:
        """Have one tick in this many published, behind those before, and a status that says so."""
        self._play.put(TelemetryConfig(every_ticks=every_ticks))

    def speak(self, schema: int) -> None:
        """Have statuses of this schema published, now and from now on."""
        self._play.put(schema)

    def forge(self, topic: str, payload: object) -> None:
        """Have something published that no daemon would."""
        self._play.put((topic, payload))

    def _run(self) -> None:
        publisher = self._wire.publisher
        due_s, schema = 0.0, SCHEMA
        while not self._over.is_set():
            try:
                item = self._play.get(timeout=0.02)
            except queue.Empty:
                item = None
            match item:
                case list():
                    publisher.publish(item)
                    publisher.flush(time.monotonic_ns() + 10**18)
                case LoopEvent():
                    publisher.event(item)
                case TelemetryConfig():
                    publisher.reconfigure(item)
                    due_s = 0.0
                case (str(topic), payload):
                    self._wire.say(topic, payload)
                case int():
                    schema, due_s = item, 0.0
                    publisher._status = None  # nor is one who comes anew told another
            publisher.service()
            if time.monotonic() >= due_s:
                due_s = time.monotonic() + 0.5
                if schema == SCHEMA:
                    publisher.status(self._status)
                else:
                    self._wire.say("hapticd/status", [{**self._status, "schema": schema}])
