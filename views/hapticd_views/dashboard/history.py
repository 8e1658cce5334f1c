"""What a viewer gets that comes late, or again: the last minute, bounded in time and in bytes."""

from __future__ import annotations

from collections import deque
from typing import Any

KEEP_S = 60.0
"""How much is kept [s]."""

MOST_BYTES = 64 * 1024 * 1024
"""Most bytes of ticks that are kept; a minute of 1000 ticks a second on three axes takes 4 MB."""

MOST_NOTES = 10_000
"""Most cycles, and most events, that are kept."""

MESSAGE_BYTES = 1024 * 1024
"""Ticks of the past are sent in messages of at most about this size."""


class History:
    """The last minute of ticks, cycles and events, and the last word on how the daemon is.

    Attributes:
        state: what a viewer is told first, a message by its name.
    """

    def __init__(self) -> None:
        self.state: dict[str, Any] = {}
        self._frames: deque[tuple[float, bytes]] = deque()
        self._bytes = 0
        self._notes: dict[str, deque[dict[str, Any]]] = {
            "cycles": deque(maxlen=MOST_NOTES),
            "events": deque(maxlen=MOST_NOTES),
        }

    def add_ticks(self, timestamp: float, frame: bytes) -> None:
        """Ticks as they were sent, with the time of the last of them [s since the epoch]."""
        self._frames.append((timestamp, frame))
        self._bytes += len(frame)
        while self._bytes > MOST_BYTES or self._frames[0][0] < timestamp - KEEP_S:
            self._bytes -= len(self._frames.popleft()[1])

    def add_note(self, kind: str, note: dict[str, Any]) -> None:
        """One of the `cycles` or `events`, with its `timestamp`."""
        notes = self._notes[kind]
        notes.append(note)
        while notes[0]["timestamp"] < note["timestamp"] - KEEP_S:
            notes.popleft()

    def messages(self) -> list[dict[str, Any] | bytes]:
        """All of it, as a viewer that has just come is sent it."""
        parts: list[dict[str, Any] | bytes] = [{name: value} for name, value in self.state.items()]
        gathered, size = list[bytes](), 0
        for _, frame in self._frames:
            gathered.append(frame)
            size += len(frame)
            if size >= MESSAGE_BYTES:
                parts.append(b"".join(gathered))
                gathered, size = [], 0
        parts.append(b"".join(gathered))
        parts.append({"past": {kind: list(notes) for kind, notes in self._notes.items()}})
        return parts
