"""What a recording is, for people and for programs: `hapticd record show`."""

from __future__ import annotations

from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any

from hapticd_views.recording.recording import PER_TICK, Recording

_SHOWN = 20


def summary(recording: Recording) -> dict[str, Any]:
    """What there is to know of a recording, ready for JSON."""
    return {
        "file": str(recording.path),
        "complete": recording.complete,
        "cut": recording.cut,
        "duration_s": recording.duration_s,
        "receipts": list(recording.receipts),
        "messages": {name: len(table["run"]) for name, table in recording.topics.items()},
        "missing": recording.missing,
        "gaps": [asdict(gap) for gap in recording.gaps],
        "notes": [asdict(note) for note in recording.notes],
        "markers": [{"timestamp": one.timestamp, "seq": one.seq, "text": one.text} for one in recording.markers],
        "events": [asdict(event) for event in recording.events],
    }


def lines(recording: Recording) -> list[str]:
    """The same for people."""
    receipt = recording.receipt
    found = [
        f"{recording.path}: {recording.duration_s:.3f} s of {receipt['device']} with {receipt['law']} at "
        f"{receipt['rate_hz']:g} Hz",
        f"began {_time(receipt['timestamp'])}, instance {receipt['instance']}, hapticd {receipt['version']}, "
        f"driver {receipt['driver']}" + (f", serial {receipt['serial']}" if receipt["serial"] else ""),
        f"configuration {receipt['config_hash']} of {receipt['config_file']}"
        + (f"; its text is not in here: {receipt['config_missing']}" if receipt["config_missing"] else ""),
        f"{'real-time' if receipt['realtime'] else 'not real-time'}, {receipt.get('kernel', 'kernel unknown')}",
        *(f"  {warning}" for warning in receipt["warnings"]),
        "messages: " + ", ".join(f"{name} {len(table['run'])}" for name, table in recording.topics.items()),
    ]
    if recording.cut:
        found.append(f"the file ends early: {recording.cut}; `hapticd record repair` makes a complete one")
    if recording.gaps:
        found.append(f"{recording.missing} ticks are missing:")
        found += _first([f"  {gap.topic} {gap.missing} after tick {gap.after}" for gap in recording.gaps])
    elif any(name in recording.topics for name in PER_TICK):
        found.append("no tick is missing")
    for other in recording.receipts[1:]:
        found.append(f"from {_time(other['timestamp'])}: {other['law']}, configuration {other['config_hash']}")
    found += _first([f"{_time(note.timestamp)} recorder: {note.text}" for note in recording.notes])
    found += _first([f"{_time(one.timestamp)} tick {one.seq}: {one.code} {one.text}" for one in recording.events])
    return found


def _first(rows: list[str]) -> list[str]:
    left = len(rows) - _SHOWN
    return rows[:_SHOWN] + ([f"  and {left} more, all with --json"] if left > 0 else [])


def _time(timestamp: float) -> str:
    try:
        return f"{datetime.fromtimestamp(timestamp, UTC).replace(tzinfo=None).isoformat(' ', 'milliseconds')} UTC"
    except (OverflowError, ValueError, OSError):
        return f"{timestamp:g} s"
