"""What Haply's Inverse service says and understands, version 3: JSON, one state for each message of a client.

    <- {"session_id": 1, "inverse3": [{"device_id": "default", "state": {"cursor_position": {"x": ...}, ...}}],
        "wireless_verse_grip": [{"device_id": "default", "state": {"orientation": {"w": ...}, "buttons": {...}}}]}
    -> {"inverse3": [{"device_id": "default", "commands": {"set_cursor_force": {"values": {"x": 0, "y": 0, "z": 0}}}}]}

Metres, metres a second, newtons, right-handed. Clients of 3.1 say `values` where 3.5 says `vector`. A force acts until
the next message; one without a force ends it. What is not known here is ignored, as there.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

from hapticd_views.gateway.cursor import AXES, Cursor

PORT = 10001
"""Where the service is, and its clients look for it."""

BUTTONS = ("a", "b", "c")
FORCE_KEYS = ("vector", "values")


def inventory(device: str, cursor: Cursor | None) -> str:
    """The first message: what there is. Without a cursor there is no device.

    Args:
        device: its name.
        cursor: where it is.
    """
    return _message(device, cursor, {"config": {"handedness": "right"}})


def reading(device: str, cursor: Cursor | None) -> str:
    """The answer to a message: where the device is. Without a cursor there is none.

    Args:
        device: its name.
        cursor: where it is.
    """
    return _message(device, cursor, {})


def force_in(message: str | bytes, device: str) -> tuple[float, float, float] | None:
    """The force that a message asks for [N]; None when it asks for none of this device.

    Args:
        message: of a client.
        device: the name that the force must be for.

    Raises:
        ValueError: it is no message of the dialect, or a number makes no sense.
    """
    try:
        said = json.loads(message, parse_constant=_refuse)
    except RecursionError:
        raise ValueError("no JSON") from None
    force_n = None
    for entry in _list(_map(said).get("inverse3", [])):
        if _map(entry).get("device_id") == device:
            command = _map(_map(entry.get("commands", {})).get("set_cursor_force", {}))
            for key in FORCE_KEYS:
                if key in command:
                    force_n = _vector(command[key])
    return force_n


def _message(device: str, cursor: Cursor | None, more: dict[str, Any]) -> str:
    handles: list[dict[str, Any]] = []
    grips: list[dict[str, Any]] = []
    if cursor is not None:
        state = {
            "cursor_position": _xyz(cursor.position_m),
            "cursor_velocity": _xyz(cursor.velocity_m_per_s),
        }
        handles.append({"device_id": device, **more, "state": state, "status": {}})
        grip = {
            "orientation": dict(zip("wxyz", cursor.orientation, strict=True)),
            "buttons": {name: bool(cursor.buttons >> bit & 1) for bit, name in enumerate(BUTTONS)},
        }
        grips.append({"device_id": device, **more, "state": grip, "status": {}})
    said = {"session_id": 1, "inverse3": handles, "wireless_verse_grip": grips}
    return json.dumps(said, separators=(",", ":"), allow_nan=False)


def _xyz(values: Sequence[float]) -> dict[str, float]:
    return dict(zip(AXES, values, strict=True))


def _vector(value: object) -> tuple[float, float, float]:
    named = _map(value)
    x, y, z = (_number(named.get(axis)) for axis in AXES)
    return (x, y, z)


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError("a force without x, y and z")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError("a force that is no number")
    return number


def _map(value: object) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError("no map")
    return value


def _list(value: object) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError("no list")
    return value


def _refuse(constant: str) -> Any:
    raise ValueError(f"{constant} is no JSON")
