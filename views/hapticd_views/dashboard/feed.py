"""What the daemon publishes, turned into messages for the page thirty times a second."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from hapticd.client import Client, Cycle, Damping, Energy, Event, Gap, Input, Position, Record, Status, Timing
from hapticd.errors import HapticdError, SchemaError, WireError
from hapticd_views.dashboard.frames import TickJoiner, packed
from hapticd_views.dashboard.history import History
from hapticd_views.dashboard.target import Target

FRAMES_HZ = 30
"""How often the page gets what is new [Hz]."""

SILENT_S = 2.5
"""After how long without a status a daemon counts as silent, and is looked for elsewhere [s]."""

ALIVE_S = 1.0
"""How often viewers are told the time, by which they know that the server is there [s]."""

_AGAIN_S = 1.0  # before a connection that was given up is tried again
_MOST_AT_ONCE = 400  # messages; viewers and commands have their turn in between

Message = dict[str, Any] | bytes
Send = Callable[[Message], None]


class Feed:
    """Follows a daemon, through restarts of it; keeps the last minute.

    Args:
        target: the daemon.
        send: takes each message for all viewers.

    Attributes:
        history: what a viewer that comes now is sent first.
    """

    def __init__(self, target: Target, send: Send) -> None:
        self.history = History()
        self._target = target
        self._send = send
        self._joiner = TickJoiner()
        self._every_ticks = 1
        self._client: Client | None = None
        self._heard_s = time.monotonic()
        self._again_s = self._alive_s = 0.0
        self._doubt(f"looking for the daemon {target.telemetry or target.instance}")

    async def run(self) -> None:
        """Send what comes until cancelled."""
        try:
            while True:
                begun_s = time.monotonic()
                self.turn()
                await asyncio.sleep(max(0.001, 1.0 / FRAMES_HZ - (time.monotonic() - begun_s)))
        finally:
            self._leave()

    def turn(self) -> None:
        """Send what has come since the last turn."""
        notes: dict[str, list[dict[str, Any]]] = {"cycles": [], "events": []}
        try:
            client = self._connected()
            for _ in range(_MOST_AT_ONCE):
                records = client.receive(0.0) if client is not None else []
                if not records:
                    self._look_for_it()
                    break
                for record in records:
                    self._sort(record, notes)
        except SchemaError as error:  # what comes next from there would be misread
            self._doubt(str(error))
            self._leave()
        except WireError as error:  # one message; the next may be fine
            self._doubt(str(error))
        except HapticdError as error:
            self._doubt(str(error))
            self._leave()
        self._send_ticks()
        for kind, new in notes.items():
            for note in new:
                self.history.add_note(kind, note)
        if notes["cycles"] or notes["events"]:
            self._send({"notes": notes})
        if time.monotonic() >= self._alive_s:
            self._alive_s = time.monotonic() + ALIVE_S
            self._send({"now": time.monotonic()})

    def _connected(self) -> Client | None:
        """The subscription, made when there is none; None while it is too early to try again."""
        if self._client is None and time.monotonic() >= self._again_s:
            self._again_s = time.monotonic() + _AGAIN_S
            self._client = self._target.subscribe()
        return self._client

    def _look_for_it(self) -> None:
        """All is read: say so when the daemon is silent, and go where it is now.

        One that is where it was keeps its connection: it may have been starved, and what it has to say still comes.
        """
        if time.monotonic() - self._heard_s <= SILENT_S or self._client is None:
            return
        self._heard_s = time.monotonic()
        self._doubt(f"{self._client.endpoint}: no daemon answers{self._client.doubt or '; start `hapticd run`'}")
        if self._target.endpoint != self._client.endpoint:
            self._leave()

    def _sort(self, record: Record, notes: dict[str, list[dict[str, Any]]]) -> None:
        match record:
            case Position() | Energy() | Damping() | Timing():
                self._joiner.add(record, self._every_ticks)
            case Cycle():
                notes["cycles"].append(asdict(record))
            case Event():
                notes["events"].append(asdict(record))
            case Gap(missing=0):
                self._joiner.restart(record)
            case Status():
                self._heard_s = time.monotonic()
                self._every_ticks = record.every_ticks
                self._say("status", record.as_map())
                self._doubt("")
            case Gap() | Input():  # the page sees gaps by the ticks' numbers
                pass

    def _send_ticks(self) -> None:
        ticks = self._joiner.take()
        if ticks:
            frame = packed(ticks)
            self.history.add_ticks(ticks[-1].timestamp, frame)
            self._send(frame)

    def _doubt(self, trouble: str) -> None:
        if self.history.state.get("trouble") != trouble:
            self._say("trouble", trouble)

    def _say(self, name: str, value: Any) -> None:
        self.history.state[name] = value
        self._send({name: value})

    def _leave(self) -> None:
        """Let go of the connection; the next turn looks for the daemon anew."""
        self._heard_s = time.monotonic()
        if self._client is not None:
            self._client.close()
            self._client = None
