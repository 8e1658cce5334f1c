"""What is said to Haply's Inverse service and what it says: JSON, a state for each message of the client.

    -> {"inverse3": [{"device_id": "049D", "commands": {"set_cursor_force": {"vector": {"x": 0, "y": 0, "z": 0}}}}]}
    <- {"inverse3": [{"device_id": "049D", "state": {"cursor_position": {"x": ...}, "cursor_velocity": {...}}}],
        "wireless_verse_grip": [{"device_id": ..., "state": {"orientation": {"w": ...}, "buttons": {"a": false}}}]}

Metres, metres a second, newtons, right-handed. Versions up to 3.1 of the service say `values` where 3.5 says `vector`.
"""

from __future__ import annotations

import json
import math
from typing import Any, NamedTuple

AXES = ("x", "y", "z")
GRIPS = ("wireless_verse_grip", "verse_grip")
MOST_BUTTONS = 8

IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


class State(NamedTuple):
    """What a message says of one device.

    Attributes:
        position_m, velocity_m_per_s: x, y, z.
        orientation: of the grip, row by row; identity without one.
        buttons: bit i is its i-th button by name.
    """

    position_m: list[float]
    velocity_m_per_s: list[float]
    orientation: tuple[float, ...]
    buttons: int


def force(device: str, key: str, force_n: tuple[float, float, float]) -> str:
    """A force on the cursor [N].

    Args:
        device: its name.
        key: `vector` or `values`.
        force_n: x, y, z.
    """
    x, y, z = force_n
    return (
        f'{{"inverse3":[{{"device_id":{json.dumps(device)},"commands":'
        f'{{"set_cursor_force":{{"{key}":{{"x":{x!r},"y":{y!r},"z":{z!r}}}}}}}}}]}}'
    )


def question(device: str) -> str:
    """A message that moves nothing, to have a state come."""
    return f'{{"inverse3":[{{"device_id":{json.dumps(device)},"commands":{{"probe_position":{{}}}}}}]}}'


def devices(message: str | bytes) -> list[str]:
    """The names of every Inverse3 that a message lists.

    Raises:
        ValueError: it is no message of the service.
    """
    return [_text(entry) for entry in _entries(_map(message), "inverse3")]


def state(message: str | bytes, device: str) -> State | None:
    """What a message says of a device; None when it does not list it.

    Raises:
        ValueError: it is no message of the service, or a number makes no sense.
    """
    said = _map(message)
    for entry in _entries(said, "inverse3"):
        if entry.get("device_id") == device:
            cursor = entry.get("state")
            if not isinstance(cursor, dict):
                raise ValueError("a device without a state")
            orientation, buttons = _grip(said)
            return State(
                _vector(cursor.get("cursor_position")), _vector(cursor.get("cursor_velocity")), orientation, buttons
            )
    return None


def _grip(said: dict[str, Any]) -> tuple[tuple[float, ...], int]:
    for kind in GRIPS:
        for entry in _entries(said, kind):
            grip = entry.get("state")
            if isinstance(grip, dict):
                return _rotation(grip.get("orientation")), _buttons(grip.get("buttons"))
    return IDENTITY, 0


def _rotation(quaternion: object) -> tuple[float, ...]:
    if quaternion is None:
        return IDENTITY
    w, x, y, z = (_number(quaternion, name) for name in ("w", "x", "y", "z"))
    squared = w * w + x * x + y * y + z * z
    if not 0.5 < squared < 2.0:
        raise ValueError("an orientation that is none")
    s = 2.0 / squared
    return (
        *(1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)),
        *(s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)),
        *(s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)),
    )


def _buttons(pressed: object) -> int:
    if not isinstance(pressed, dict):
        return 0
    return sum(1 << bit for bit, name in enumerate(sorted(pressed)[:MOST_BUTTONS]) if pressed[name] is True)


def _vector(value: object) -> list[float]:
    return [_number(value, name) for name in AXES]


def _number(value: object, name: str) -> float:
    number = value.get(name) if isinstance(value, dict) else None
    if isinstance(number, bool) or not isinstance(number, int | float):
        raise ValueError(f"{name} is no number")
    try:
        found = float(number)
    except OverflowError:  # a whole number of hundreds of digits
        found = math.inf
    if not math.isfinite(found):
        raise ValueError(f"{name} is no number")
    return found


def _map(message: str | bytes) -> dict[str, Any]:
    try:
        said = json.loads(message)
    except (ValueError, RecursionError) as error:
        raise ValueError("no JSON") from error
    if not isinstance(said, dict):
        raise ValueError("no map")
    return said


def _entries(said: dict[str, Any], kind: str) -> list[dict[str, Any]]:
    entries = said.get(kind, [])
    if not isinstance(entries, list):
        raise ValueError(f"{kind} is no list")
    return [entry for entry in entries if isinstance(entry, dict)]


def _text(entry: dict[str, Any]) -> str:
    name = entry.get("device_id")
    if not isinstance(name, str):
        raise ValueError("a device without a name")
    return name
