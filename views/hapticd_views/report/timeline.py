"""What happened in a recording, in order of time."""

from __future__ import annotations

from dataclasses import dataclass

from hapticd_views.recording import Recording
from hapticd_views.recording.loop import FAULTS


@dataclass(frozen=True, slots=True)
class Happening:
    """One line of it.

    Attributes:
        time_s: since the first tick [s].
        kind: "event", "fault", "marker", "gap", "recorder" or "configuration".
        text: what happened.
    """

    time_s: float
    kind: str
    text: str


def timeline(recording: Recording) -> list[Happening]:
    """Events, faults, markers, gaps, what the recorder noted, and changes of the configuration."""
    first_s = float(recording.ticks["timestamp"][0])
    marked = {id(event) for event in recording.markers}
    found = [
        Happening(
            event.timestamp - first_s,
            "marker" if id(event) in marked else "fault" if event.code in FAULTS else "event",
            event.text if id(event) in marked else f"{event.text} (code {event.code})",
        )
        for event in recording.events
    ]
    found += [
        Happening(gap.timestamp - first_s, "gap", f"{gap.missing} ticks of {gap.topic} missing before tick {gap.seq}")
        for gap in recording.gaps
    ]
    found += [Happening(note.timestamp - first_s, "recorder", note.text) for note in recording.notes]
    found += [
        Happening(
            receipt["timestamp"] - first_s,
            "configuration",
            f"law {receipt['law']}, {receipt['config_file']}, hash {receipt['config_hash'][:12]}",
        )
        for receipt in recording.receipts[1:]
    ]
    return sorted(found, key=lambda one: one.time_s)
