"""What the SDK's errors and the device's own stops are called in hapticd."""

from __future__ import annotations

from hapticd.errors import (
    DeviceBusyError,
    DeviceDisconnectedError,
    DeviceFaultError,
    DeviceNotFoundError,
    DeviceProtocolError,
    DeviceTimeoutError,
    DriverError,
    DriverStateError,
)

TIMEOUT = 7
NOT_AVAILABLE = (6, 10)
"""Errors of a function that this device or this SDK does not have."""

ERRORS: dict[int, tuple[str, type[DriverError]]] = {
    1: ("ERROR", DriverError),
    2: ("COM", DeviceDisconnectedError),
    3: ("DHC_BUSY", DeviceBusyError),
    4: ("NO_DRIVER_FOUND", DeviceNotFoundError),
    5: ("NO_DEVICE_FOUND", DeviceNotFoundError),
    6: ("NOT_AVAILABLE", DriverError),
    TIMEOUT: ("TIMEOUT", DeviceTimeoutError),
    8: ("GEOMETRY", DeviceProtocolError),
    9: ("EXPERT_MODE_DISABLED", DriverStateError),
    10: ("NOT_IMPLEMENTED", DriverError),
    11: ("OUT_OF_MEMORY", DriverError),
    12: ("DEVICE_NOT_READY", DriverStateError),
    13: ("FILE_NOT_FOUND", DriverError),
    14: ("CONFIGURATION", DriverError),
    15: ("INVALID_INDEX", DeviceNotFoundError),
    16: ("DEPRECATED", DriverError),
    17: ("NULL_ARGUMENT", DriverError),
    18: ("REDUNDANT_FAIL", DeviceFaultError),
    19: ("NOT_ENABLED", DeviceFaultError),
    20: ("DEVICE_IN_USE", DeviceBusyError),
    21: ("INVALID", DriverError),
    22: ("NO_REGULATION", DriverStateError),
}
"""Number of an SDK error: its name in the SDK's headers, and the error that hapticd raises."""

_CAUSES = {
    0: "the device gives no cause",
    1: "the force button on the device was pressed",
    2: "the device's own velocity limit was exceeded",
    3: "the device's watchdog heard nothing from this computer in time",
    4: "another part of the software stopped it",
    5: "the USB connection broke",
    6: "the dead man's switch was released",
}
"""FORCE_OFF_CAUSE of the status: why the device took the force away by itself."""


def cause_of(number: int) -> str:
    """Why the device took the force away by itself, in words."""
    return _CAUSES.get(number, f"cause {number}, which is not documented")


def failure(what: str, number: int, text: str) -> DriverError:
    """The error to raise for a call that failed.

    Args:
        what: the function.
        number: the SDK's error number, as read on the thread that failed.
        text: the SDK's own words; "" when it had none.
    """
    name, kind = ERRORS.get(number, ("no known error", DriverError))
    said = f"{text}, " if text else ""
    return kind(f"omega7: {what} failed: {said}error {number} ({name})")
