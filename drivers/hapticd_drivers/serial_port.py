"""Opening a serial port, and what to tell a user who may not or cannot."""

from __future__ import annotations

import errno
import termios

import serial

from hapticd.errors import DeviceBusyError, DeviceNotFoundError, DevicePermissionError, DriverError


def open_tty(driver: str, path: str, baud: int, what: str) -> serial.Serial:
    """Open a port for this program alone; nothing of it waits.

    Args:
        driver: what the configuration calls it.
        path: the device file.
        baud: bits a second.
        what: what should be plugged in there, for people.

    Raises:
        DriverError: not there, not permitted, or busy.
    """
    try:
        return serial.Serial(path, baud, timeout=0, write_timeout=0, exclusive=True)
    except (serial.SerialException, OSError, ValueError, termios.error) as error:
        raise _refusal(driver, path, baud, what, error) from error


def _refusal(driver: str, path: str, baud: int, what: str, error: Exception) -> DriverError:
    number = getattr(error, "errno", None)
    if number in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        return DeviceNotFoundError(f"{driver}: there is no {path}: is {what} plugged in?")
    if number in (errno.EACCES, errno.EPERM):
        return DevicePermissionError(
            f"{driver}: this user may not open {path}: sudo usermod -aG dialout $USER, then log in again"
        )
    if number in (errno.EAGAIN, errno.EBUSY):
        return DeviceBusyError(
            f"{driver}: another program has {path} open: end it first (sudo fuser -v {path} names it)"
        )
    return DeviceNotFoundError(f"{driver}: {path} cannot be opened at {baud} baud: {error}")
