"""What a client may say of a port, and what is wrong with what it says.

A number that is not finite, a vector of another length, a key that the port does not have, more stiffness or damping
than the configuration allows: refused, and then nothing of the message is taken. Where a force or a velocity is beyond
the limit of its port it is scaled down to it instead: a field that grows too strong stays there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hapticd.config.ports import PortLimits
from hapticd.tick.remote.update import (
    DAMPING,
    FORCE,
    MOTION,
    ORIENTATION,
    POSITION,
    RELEASED,
    STIFFNESS,
    TURNING,
    VELOCITY,
    Update,
)

FARTHEST_M = 10.0
"""Of a position, each of its numbers: what is beyond is no place that a device reaches [m]."""

FASTEST_TURN_RAD_PER_S = 100.0
"""Of an angular velocity, each of its numbers [rad/s]."""

LARGEST_NUMBER = 1 << 62
"""Numbers of messages are below it."""

_SAID_OF = {"name", "seq", "sent_ns", "state_seq", "moved_seq"}
_MOTION = {"position_m": POSITION, "velocity_m_per_s": VELOCITY}
_SPRING = {"stiffness_n_per_m": STIFFNESS, "damping_n_s_per_m": DAMPING}
_KEYS = {
    "object": {**_MOTION, **_SPRING, "orientation": ORIENTATION, "angular_velocity_rad_per_s": TURNING},
    "coupling": {**_MOTION, **_SPRING},
    "force": {"force_n": FORCE},
}
_SHORTEST = 1e-3


@dataclass(frozen=True, slots=True)
class Said:
    """What a message says that is in order.

    Attributes:
        seq: the client's number of it.
        sent_ns: when the client says that it sent it [ns of its CLOCK_MONOTONIC]; 0 where it does not.
        state_seq: tick of the state that it answers, -1 where it does not say.
        moved_seq: number of the message that first said the motion in this one; its own where it does not say.
        values: what it says of the port, by the names of `Update`.
        bits: the same as `Update.said` has it.
    """

    seq: int
    sent_ns: int
    state_seq: int
    moved_seq: int
    values: dict[str, list[float] | float]
    bits: int


class WrongMessageError(Exception):
    """The message says what cannot be; nothing of it is taken.

    Attributes:
        key: of the message that is wrong; "" where it is none by itself.
    """

    key = ""


def examine(fields: Mapping[str, Any], port: PortLimits, axes: int) -> Said:
    """What a message says of a port.

    Args:
        fields: the message.
        port: what it is for.
        axes: of the device.

    Raises:
        WrongMessageError: something in it cannot be.
    """
    known = _KEYS[port.kind]
    seq = _count(fields.get("seq"), "seq")
    sent_ns = _count(fields.get("sent_ns", 0), "sent_ns")
    state_seq = _count(fields["state_seq"], "state_seq") if "state_seq" in fields else -1
    moved_seq = _count(fields.get("moved_seq", seq), "moved_seq")
    if moved_seq > seq:
        raise WrongMessageError(f"moved_seq = {moved_seq}: must be at most seq = {seq}, the number of this message")
    values: dict[str, list[float] | float] = {}
    bits = 0
    for key, value in fields.items():
        if key in _SAID_OF:
            continue
        try:
            if key not in known:
                text = f"{port.name} is a {port.kind} and has no {key[:40]}: it takes {', '.join(known)}"
                raise WrongMessageError(text)
            values[key] = _value(key, value, port, axes)
        except WrongMessageError as error:
            error.key = key[:40]
            raise
        bits |= known[key]
    return Said(seq, sent_ns, state_seq, moved_seq, values, bits)


def merge(said: Said, update: Update, now_ns: int) -> None:
    """Put what a message says into all that was said before.

    A velocity belongs to the position that it came with: a message with another position and no velocity ends it.
    Motion that was said before keeps the time at which it was.

    Args:
        said: the message.
        update: all that was said before.
        now_ns: when the message was taken [ns].
    """
    new = said.bits
    if said.moved_seq <= update.moved_seq:  # it repeats what was said of motion before
        new &= ~update.said
    elif said.bits & MOTION:
        update.moved_seq = said.moved_seq
    over = RELEASED
    if said.bits & POSITION:
        over |= VELOCITY
    if said.bits & ORIENTATION:
        over |= TURNING
    update.said = update.said & ~over | said.bits
    update.seq = said.seq
    update.stamp(new, now_ns)
    for key, value in said.values.items():
        if isinstance(value, list):
            getattr(update, key)[: len(value)] = value
        else:
            setattr(update, key, value)


def _value(key: str, value: object, port: PortLimits, axes: int) -> list[float] | float:
    if key in _SPRING:
        number = _number(value, key)
        most: float = getattr(port, key)
        if not 0.0 <= number <= most:
            raise WrongMessageError(f"{key} = {number:g}: must be 0 to {most:g}, as the configuration has it")
        return number
    length = 4 if key == "orientation" else 3 if port.kind == "object" else axes
    if not isinstance(value, list | tuple) or len(value) != length:
        raise WrongMessageError(f"{key}: must be a list of {length} numbers")
    vector = [_number(each, key) for each in value]
    if key == "position_m":
        _within(vector, FARTHEST_M, key)
    elif key == "angular_velocity_rad_per_s":
        _within(vector, FASTEST_TURN_RAD_PER_S, key)
    elif key == "orientation":
        if not _SHORTEST <= math.hypot(*vector) <= 1.0 / _SHORTEST:
            raise WrongMessageError("orientation: must be a quaternion w x y z, of length 1")
    else:
        _limit(vector, port.max_force_n if key == "force_n" else port.max_speed_m_per_s)
    return vector


def _within(vector: list[float], most: float, key: str) -> None:
    if max(map(abs, vector)) > most:
        raise WrongMessageError(f"{key}: must be -{most:g} to {most:g}")


def _limit(vector: list[float], most: float) -> None:
    """Scale a vector down to a length."""
    largest = max(map(abs, vector))
    if largest > most:  # first, so that no length overflows
        vector[:] = [each / largest * most for each in vector]
    length = math.hypot(*vector)
    if length > most:
        vector[:] = [each * (most / length) for each in vector]


def _number(value: object, key: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise WrongMessageError(f"{key}: must be a finite number")
    return float(value)


def _count(value: object, key: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < LARGEST_NUMBER:
        raise WrongMessageError(f"{key}: must be a whole number, 0 or more")
    return value
