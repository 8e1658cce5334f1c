"""The messages of the rig protocol, version 1 (docs/rig-protocol.md): numbers in, bytes out, and back.

What carries them, frames on a line or reports, is not of this module.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable, Sequence
from struct import Struct
from typing import Any, NamedTuple

VERSION = 1
SHORTEST = 6
LONGEST = 63
"""Bytes of a message, CRC included."""

MOST_AXES = 3

# Types of messages, host to device and back.
HELLO, DESCRIBE, SET_HOME, ENABLE, DISABLE, POLL, FORCE, PING = range(0x01, 0x09)
IDENTITY, AXIS, STATE, PONG, FAULT, REFUSED = 0x81, 0x82, 0x84, 0x88, 0x90, 0x91

# Bits of `flags`.
ENABLED, HOMED, TRIPPED, LIMITED, HOME_SWITCH_CLOSED = 1, 2, 4, 8, 16

# Bits of `capabilities`.
HAS_HOME_SWITCH, KNOWS_HOME = 1, 2

WRONG_VERSION, NO_HELLO = 1, 4
"""Reasons of a REFUSED: the version is not spoken; no HELLO since the device was switched on."""

NO_AXIS = 255
"""Axis of a FAULT that belongs to none."""

_FAULTS = {
    1: "its position signal is implausible or lost",
    2: "its motor driver reports over-current or over-temperature",
    3: "its processor was reset by its own watchdog or by a dip of the supply",
}
_REASONS = {
    WRONG_VERSION: "it speaks another version of the protocol",
    2: "it does not know this type of message",
    3: "the length is wrong for the type",
    NO_HELLO: "it has had no HELLO since it was switched on",
    5: "it has no such axis",
}


class Identity(NamedTuple):
    """What the device is.

    Attributes:
        sequence: the device's number of this message.
        echo: number of the last message that it accepted.
        time_us: its clock, modulo 2^32 [us].
        axes: how many.
        capabilities: bits `HAS_HOME_SWITCH`, `KNOWS_HOME`.
        buttons: how many.
        flags: as in `State`.
        host_silence_ms: its watchdog [ms].
        nominal_rate_hz: rate that it is made for [Hz].
        firmware: version, major to patch.
        model, serial: names.
    """

    sequence: int
    echo: int
    time_us: int
    axes: int
    capabilities: int
    buttons: int
    flags: int
    host_silence_ms: int
    nominal_rate_hz: int
    firmware: tuple[int, int, int]
    model: str
    serial: str


class Axis(NamedTuple):
    """What one axis is.

    Attributes:
        sequence, echo, time_us: as in `Identity`.
        axis: its index.
        count_pm: what a count is at the handle [pm]; 0: unknown.
        max_force_un: largest force at the handle [uN].
        lowest, highest: ends of its travel [counts from home]; both 0: unknown.
        home: which count is the origin [counts].
    """

    sequence: int
    echo: int
    time_us: int
    axis: int
    count_pm: int
    max_force_un: int
    lowest: int
    highest: int
    home: int


class State(NamedTuple):
    """Where the device is.

    Attributes:
        sequence, echo: as in `Identity`.
        time_us: when the position was taken, modulo 2^32 [us].
        flags: bits `ENABLED`, `HOMED`, `TRIPPED`, `LIMITED`, `HOME_SWITCH_CLOSED`.
        fault: code, 0: none.
        buttons: bit i is button i.
        position: of each axis [counts].
        force_un: what each motor is told at this moment, as a force at the handle [uN].
    """

    sequence: int
    echo: int
    time_us: int
    flags: int
    fault: int
    buttons: int
    position: list[int]
    force_un: list[int]


class Pong(NamedTuple):
    """Answer to a PING.

    Attributes:
        sequence, echo, time_us: as in `Identity`.
        token: of the PING.
        received_us: device time when the PING was decoded [us].
        lost: messages to the device missing in the sequence since power-up, modulo 2^16.
        damaged: damaged frames that reached it, likewise.
        stale: old or repeated messages that reached it, likewise.
    """

    sequence: int
    echo: int
    time_us: int
    token: int
    received_us: int
    lost: int
    damaged: int
    stale: int


class Fault(NamedTuple):
    """The device has stopped by itself.

    Attributes:
        sequence, echo, time_us: as in `Identity`.
        fault: code.
        axis: which, or `NO_AXIS`.
        detail: the fault's own number.
    """

    sequence: int
    echo: int
    time_us: int
    fault: int
    axis: int
    detail: int


class Refused(NamedTuple):
    """The device does not take a message.

    Attributes:
        sequence, echo, time_us: as in `Identity`.
        reason: why.
        type: of the refused message.
    """

    sequence: int
    echo: int
    time_us: int
    reason: int
    type: int


Message = Identity | Axis | State | Pong | Fault | Refused
"""Whatever a device sends."""


def checksum(data: bytes) -> int:
    """CRC-16/IBM-3740."""
    return crc_hqx(data, 0xFFFF)


def is_newer(sequence: int, than: int) -> bool:
    """Whether a sequence number comes after another one, modulo 2^16."""
    return 0 < (sequence - than) & 0xFFFF < 0x8000


def hello(sequence: int) -> bytes:
    """Begin to talk; the device switches its motor off and says what it is."""
    return _closed(_PLAIN.pack(VERSION, HELLO, sequence))


def describe(sequence: int, axis: int) -> bytes:
    """Ask what an axis is."""
    return _closed(_DESCRIBE.pack(VERSION, DESCRIBE, sequence, axis))


def set_home(sequence: int, axis: int, home: int) -> bytes:
    """Tell the device which count is the origin of an axis."""
    return _closed(_SET_HOME.pack(VERSION, SET_HOME, sequence, axis, home))


def enable(sequence: int) -> bytes:
    """Let forces through."""
    return _closed(_PLAIN.pack(VERSION, ENABLE, sequence))


def disable(sequence: int) -> bytes:
    """Switch the motor off, and clear a fault whose cause is gone."""
    return _closed(_PLAIN.pack(VERSION, DISABLE, sequence))


def poll(sequence: int, answer_after_us: int) -> bytes:
    """Ask for a STATE, to be taken so long after this has arrived [us]."""
    return _closed(_POLL.pack(VERSION, POLL, sequence, answer_after_us))


def force(sequence: int, answer_after_us: int, force_un: Sequence[int]) -> bytes:
    """Set the force of each axis [uN], and ask for a STATE as `poll` does."""
    return _closed(_FORCES[len(force_un)].pack(VERSION, FORCE, sequence, answer_after_us, *force_un))


def ping(sequence: int, token: int) -> bytes:
    """Ask for an answer at once, with what the device has counted."""
    return _closed(_PING.pack(VERSION, PING, sequence, token))


def is_intact(message: bytes) -> bool:
    """Whether a message has a possible length and its CRC is right."""
    return SHORTEST <= len(message) <= LONGEST and crc_hqx(message[:-2], 0xFFFF) == message[-2] | message[-1] << 8


def decode(message: bytes) -> Message | None:
    """What an intact message from a device says; None when it is of no known version, type or length."""
    if message[0] != VERSION:
        return None
    if message[1] == STATE:
        layout = _STATES.get(len(message))
        if layout is None:
            return None
        sequence, echo, time_us, flags, fault, buttons, *numbers = layout.unpack_from(message, 2)
        axes = len(numbers) >> 1
        return State(sequence, echo, time_us, flags, fault, buttons, numbers[:axes], numbers[axes:])
    known = _DECODERS.get(message[1])
    if known is None or len(message) != known[0].size + 4:
        return None
    layout, make = known
    return make(*layout.unpack_from(message, 2))


def fault_text(code: int) -> str:
    """What a fault of the device is, in words."""
    return _FAULTS.get(code, f"it reports fault {code}, which only its firmware can explain")


def reason_text(reason: int) -> str:
    """Why the device refuses a message, in words."""
    return _REASONS.get(reason, f"reason {reason}, which the protocol does not know")


_PLAIN = Struct("<BBH")
_DESCRIBE = Struct("<BBHB")
_SET_HOME = Struct("<BBHBi")
_POLL = Struct("<BBHH")
_PING = Struct("<BBHI")
_FORCES = [Struct(f"<BBHH{axes}i") for axes in range(MOST_AXES + 1)]
_STATES = {16 + 8 * axes: Struct(f"<HHIBBH{axes}i{axes}i") for axes in range(1, MOST_AXES + 1)}


def _closed(message: bytes) -> bytes:
    return message + crc_hqx(message, 0xFFFF).to_bytes(2, "little")


def _identity(*fields: Any) -> Identity:
    *numbers, major, minor, patch, model, serial = fields
    return Identity._make([*numbers, (major, minor, patch), _text(model), _text(serial)])


def _text(field: bytes) -> str:
    """Text up to the first zero; what cannot be shown becomes a question mark, since it ends in logs and terminals."""
    text = field.partition(b"\0")[0].decode("ascii", "replace")
    return "".join(letter if letter.isprintable() and letter.isascii() else "?" for letter in text)


_DECODERS: dict[int, tuple[Struct, Callable[..., Message]]] = {
    IDENTITY: (Struct("<HHIBBBBHH3B16s12s"), _identity),
    AXIS: (Struct("<HHIBIIiii"), Axis),
    PONG: (Struct("<HHIIIHHH"), Pong),
    FAULT: (Struct("<HHIBBi"), Fault),
    REFUSED: (Struct("<HHIBB"), Refused),
}
