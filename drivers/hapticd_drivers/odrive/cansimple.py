"""What is said to an ODrive and what it says: the messages of CANSimple, firmware 0.6 and later.

    identifier = address << 5 | message         11 bits; address 0 to 63

All numbers are little-endian (docs.odriverobotics.com, "CAN Protocol"; the DBC file of 0.6.10 says the same).
"""

from __future__ import annotations

import struct

VERSION, HEARTBEAT, ERRORS, SET_STATE, ESTIMATES = 0x00, 0x01, 0x03, 0x07, 0x09
SET_MODE, SET_TORQUE, TEMPERATURES, BUS, CLEAR_ERRORS, TORQUES = 0x0B, 0x0E, 0x15, 0x17, 0x18, 0x1C
"""Messages: what an ODrive sends by itself, every so many milliseconds, and what it is told."""

MOST_ADDRESS = 63

IDLE, CLOSED_LOOP = 1, 8
"""Axis states: without current; following a torque."""

TORQUE_CONTROL, PASSTHROUGH = 1, 1

INITIALIZING, WATCHDOG_EXPIRED = 0x00000001, 0x01000000
"""Bits of an error."""

SIZE = 8

_PAIR = struct.Struct("<ff")
_ERRORS = struct.Struct("<II")
_HEARTBEAT = struct.Struct("<IBBBx")
_TORQUE = struct.Struct("<f")
_WORD = struct.Struct("<I")
_MODE = struct.Struct("<II")
_VERSION = struct.Struct("<8B")


def identifier(address: int, message: int) -> int:
    """Identifier of a message to or from an ODrive."""
    return address << 5 | message


def torque(torque_n_m: float) -> bytes:
    """Set_Input_Torque: a torque that holds until the next one comes [N m]; it feeds the watchdog."""
    return _TORQUE.pack(torque_n_m)


def state(axis_state: int) -> bytes:
    """Set_Axis_State."""
    return _WORD.pack(axis_state)


TORQUE_MODE = _MODE.pack(TORQUE_CONTROL, PASSTHROUGH)
"""Set_Controller_Mode: the torque that is told is the torque that is given, at once."""

CLEAR = b"\x00"
"""Clear_Errors, without a blinking lamp."""


def pair(data: bytes) -> tuple[float, float]:
    """Get_Encoder_Estimates: place [turns], speed [turns/s]; Get_Temperature: transistors, motor [C].

    Get_Bus_Voltage_Current: supply [V], [A]; Get_Torques: target, estimate [N m].

    Raises:
        struct.error: not as long as it has to be.
    """
    first, second = _PAIR.unpack(data)
    return first, second


def heartbeat(data: bytes) -> tuple[int, int]:
    """Heartbeat: error, axis state.

    Raises:
        struct.error: not as long as it has to be.
    """
    error, axis_state, _result, _done = _HEARTBEAT.unpack(data)
    return error, axis_state


def errors(data: bytes) -> tuple[int, int]:
    """Get_Error: active errors, and why it let go last.

    Raises:
        struct.error: not as long as it has to be.
    """
    active, reason = _ERRORS.unpack(data)
    return active, reason


def version(data: bytes) -> tuple[str, str]:
    """Get_Version: hardware and firmware.

    Raises:
        struct.error: not as long as it has to be.
    """
    _protocol, product, board, variant, major, minor, revision, _unreleased = _VERSION.unpack(data)
    return f"{product}.{board}.{variant}", f"{major}.{minor}.{revision}"
