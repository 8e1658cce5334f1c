"""What is said to a moteus controller and what it answers: registers in the subframes of its multiplex protocol.

    identifier to a controller      0x8000 (answer wanted) | its address
    identifier of its answer        its address << 8

A subframe is an opcode, the first register, and the values. Opcode = direction | type | count, a count above three in
a byte of its own. Directions: 0x00 write, 0x10 read, 0x20 answer, 0x30 and 0x31 refused, 0x50 nothing.
Types: 0x00 int8, 0x04 int16, 0x08 int32, 0x0c float; all little-endian (mjbots/moteus, docs/protocol).
"""

from __future__ import annotations

import struct

ANSWER = 0x8000

MODE, POSITION, VELOCITY, TORQUE = 0x00, 0x01, 0x02, 0x03
HOME_STATE, VOLTAGE, TEMPERATURE, FAULT = 0x0C, 0x0D, 0x0E, 0x0F
MILLISECONDS, FIRMWARE, SERIAL = 0x70, 0x101, 0x120
SET_OUTPUT_EXACT = 0x131

STOPPED, FAULTED, PREPARING, POSITION_MODE, TIMED_OUT, BRAKE = 0, 1, (2, 3, 4), 10, 11, 15
"""Values of MODE: without current, stopped by a fault, about to follow, following, timed out, windings shorted."""

HOME_AT_ROTOR, HOME_AT_OUTPUT = 1, 2
"""Values of HOME_STATE: turns count from the zero of an encoder, within a turn of it; or from a place that was told, or
that motor_position.output.reference_source knows, as soon as it is switched on."""

VOLTS = 0.5
"""A volt in an int8 [V]; temperatures are whole degrees."""

_SIZES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
_NOTHING = b"\x50"
_LEAST = (-(1 << 7), -(1 << 15), -(1 << 31))
_TYPES = ("b", "h", "i", "f")

_WIDTHS = (1, 2, 4, 4)


def padded(data: bytes) -> bytes:
    """Data filled up with nothing to a length that CAN-FD has.

    Raises:
        ValueError: there is no frame as long as that.
    """
    for size in _SIZES:
        if len(data) <= size:
            return data + _NOTHING * (size - len(data))
    raise ValueError(f"{len(data)} bytes are too long for a frame")


_QUERY = bytes((0x11, MODE, 0x1F, POSITION, 0x10, 4, HOME_STATE, 0x19, MILLISECONDS))
"""MODE as int8; POSITION, VELOCITY, TORQUE as float; HOME_STATE, VOLTAGE, TEMPERATURE, FAULT as int8; MILLISECONDS."""

_TORQUE = struct.Struct(f"<3B 3B6f 2Bf 3B {len(_QUERY)}s")
"""As long as a frame: 48 bytes."""

_NAN = float("nan")

QUERY = padded(_QUERY)
"""The state, and no command."""

IDENTITY = padded(bytes((0x19, 0x81, 0x02, 0x1B, 0xA0, 0x02)))
"""FIRMWARE and the three words of SERIAL as int32."""

STOP = padded(bytes((0x01, MODE, STOPPED)) + _QUERY)
SHORTED = padded(bytes((0x01, MODE, BRAKE)) + _QUERY)
"""Take the current away, and answer; with the windings shorted, so that they brake."""


def torque(torque_n_m: float, most_n_m: float, timeout_s: float) -> bytes:
    """A torque that holds until the next one comes or the time is over, and the question for the state.

    It is position mode without a position: the place is free (NaN), stiffness, damping and integrator are scaled to 0,
    and the torque is what is left.

    Args:
        torque_n_m: at the output shaft [N m].
        most_n_m: that the controller may apply [N m].
        timeout_s: watchdog [s].
    """
    return _TORQUE.pack(
        *(0x01, MODE, POSITION_MODE),
        # COMMAND_POSITION, VELOCITY, FEEDFORWARD_TORQUE, KP_SCALE, KD_SCALE, MAXIMUM_TORQUE
        *(0x0C, 6, 0x20, _NAN, 0.0, torque_n_m, 0.0, 0.0, most_n_m),
        *(0x0D, 0x27, timeout_s),
        *(0x01, 0x2B, 0),  # ILIMIT_SCALE
        _QUERY,
    )


def here_is(turns: float) -> bytes:
    """From now on the shaft counts such that it is at these turns, and knows that (HOME_STATE); and the state."""
    return padded(struct.pack("<BBBf", 0x0D, 0xB1, 0x02, turns) + _QUERY)


def answers(data: bytes) -> dict[int, float] | None:
    """The registers in an answer, numbers as they came: integers unscaled, the least one of each type as NaN.

    Args:
        data: of a frame.

    Returns:
        By register; None when this is no answer.
    """
    found: dict[int, float] = {}
    at, end = 0, len(data)
    try:
        while at < end:
            opcode = data[at]
            at += 1
            direction = opcode & 0xF0
            if direction == 0x20:
                kind, count = opcode >> 2 & 3, opcode & 3
                if not count:
                    count = data[at]
                    at += 1
                register, at = _varuint(data, at)
                form = _FORMS[kind].get(count)
                if form is None:
                    return None
                for value in form.unpack_from(data, at):
                    found[register] = _NAN if kind < 3 and value == _LEAST[kind] else value
                    register += 1
                at += _WIDTHS[kind] * count
            elif opcode in (0x30, 0x31):  # a register that this firmware does not have
                _, at = _varuint(data, at)
                _, at = _varuint(data, at)
            elif opcode != 0x50:
                return None
    except (IndexError, struct.error):
        return None
    return found or None


def _varuint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7


_FORMS = [
    {count: struct.Struct(f"<{count}{kind}") for count in range(1, 64 // width)}
    for kind, width in zip(_TYPES, _WIDTHS, strict=True)
]
