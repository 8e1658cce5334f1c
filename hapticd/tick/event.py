"""What happened: the codes of `hapticd/event` messages. Documented in docs/faults.md."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field

LONGEST_MARKER = 200
"""Characters of a marker at most."""


class EventCode(enum.IntEnum):
    """1xx: life; 2xx: faults that take the force away; 3xx: warnings."""

    STARTED = 100
    ARMED = 101
    DISARMED = 102
    SWITCHED = 103
    CLEARED = 104
    STOPPING = 105
    REFUSED = 106
    DEVICE_FOUND = 107
    CALIBRATING = 108
    CALIBRATED = 109
    TARED = 110
    MARKED = 111
    REMOTE_BACK = 112

    LAW_FAILED = 200
    LAW_OVER_BUDGET = 201
    OVER_SPEED = 202
    SAMPLE_IMPOSSIBLE = 203
    DEVICE_LOST = 204
    DEVICE_FROZEN = 205
    DEVICE_FAULT = 206
    SUPERVISOR_STALLED = 207
    CONTROL_LOST = 208
    LOOP_LATE = 209

    OVERRUN_BURST = 300
    RING_DROPPED = 301
    NOT_REALTIME = 302
    FAULT_RECORD_FAILED = 303
    SUBSCRIBER_FLOOD = 304
    DEVICE_WARNING = 305
    CALIBRATION_ENDED = 306
    HELPER_MISSING = 307
    REMOTE_STALE = 308
    REMOTE_LOST = 309


@dataclass(slots=True)
class LoopEvent:
    """One event.

    Attributes:
        code: what happened.
        text: one line for people.
        seq: tick at which it happened.
        deadline_ns: CLOCK_MONOTONIC time of that tick [ns].
        fields: numbers and names that belong to it.
    """

    code: int
    text: str
    seq: int
    deadline_ns: int
    fields: dict[str, float | int | str] = field(default_factory=dict)

    @property
    def is_fault(self) -> bool:
        """Whether it took the force away."""
        return 200 <= self.code < 300


def marker_problem(text: object) -> str:
    """Why this cannot be the text of a marker; "" when it can."""
    if not isinstance(text, str) or not text.strip():
        return "a marker is a text that is not empty"
    if len(text) > LONGEST_MARKER:
        return f"a marker has at most {LONGEST_MARKER} characters, this one {len(text)}"
    if not text.isprintable():
        return "a marker is one line of printable characters"
    return ""
