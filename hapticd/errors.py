"""Every error that hapticd raises on purpose.

HapticdError                     one line for the user; `exit_code` for the shell
├── ConfigError                  a file, key or value that cannot be used (exit 2)
├── PluginError                  a driver or law that is unknown or cannot be loaded (exit 2)
├── RealtimeError                real-time rights were required and are missing
├── InstanceError                another daemon holds the instance, the device or an endpoint
├── DriverError                  something about the device
│   ├── DeviceNotFoundError      nothing of this kind is plugged in
│   ├── DevicePermissionError    it is there, but this user may not open it
│   ├── DeviceBusyError          another process holds it
│   ├── DeviceDisconnectedError  it was there and is gone
│   ├── DeviceTimeoutError       it did not answer in time
│   ├── DeviceProtocolError      it answered something that makes no sense
│   ├── DeviceFaultError         it reports a fault of its own
│   └── DriverStateError         a call that the life cycle or the limits do not allow
└── ClientError                  something about a daemon that a program listens to
    ├── EndpointError            an address that none can have (exit 2)
    ├── SilenceError             nothing arrived in time
    ├── SchemaError              the daemon speaks another version of the contract
    └── WireError                a message that is not what the contract says
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import PurePath
from traceback import walk_tb


class HapticdError(Exception):
    """Base of all errors that are meant for the user: the message says what, where and what to do."""

    exit_code = 1


class ConfigError(HapticdError):
    """A configuration that cannot be used.

    Attributes:
        problems: one line each, `file: key = value: what is allowed`.
    """

    exit_code = 2

    def __init__(self, *problems: str) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems


class PluginError(HapticdError):
    """A driver or law that is unknown, cannot be imported or does not keep its contract."""

    exit_code = 2


class RealtimeError(HapticdError):
    """Real-time scheduling or locked memory was required and could not be had."""


class InstanceError(HapticdError):
    """Another daemon already holds this instance, device or endpoint."""


class DriverError(HapticdError):
    """Base of everything that can go wrong with a device."""


class DeviceNotFoundError(DriverError):
    """No device of this kind is there, for example it is not plugged in."""


class DevicePermissionError(DriverError):
    """The device is there but this user may not open it, for example without a udev rule."""


class DeviceBusyError(DriverError):
    """Another process holds the device."""


class DeviceDisconnectedError(DriverError):
    """The device was open and is gone, for example unplugged."""


class DeviceTimeoutError(DriverError):
    """The device did not answer within the time that the driver allows."""


class DeviceProtocolError(DriverError):
    """The device sent something that makes no sense, for example an impossible position."""


class DeviceFaultError(DriverError):
    """The device reports a fault of its own, for example its watchdog tripped."""


class DriverStateError(DriverError):
    """A call out of order, or a force that is not finite or beyond the device's limit."""


class ClientError(HapticdError):
    """Base of what can go wrong for a subscriber."""


class EndpointError(ClientError):
    """An endpoint that ZeroMQ cannot use."""

    exit_code = 2


class SilenceError(ClientError):
    """Nothing arrived in the time allowed."""


class SchemaError(ClientError):
    """The daemon speaks a version of the contract that this client does not know."""


class WireError(ClientError):
    """A message that is not what the contract says."""


def alike(name: str, known: Sequence[str]) -> str:
    """Advice for an unknown name: `did you mean "x"?`, or nothing where none is near."""
    import difflib  # for an error only

    near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    return f'did you mean "{near[0]}"?' if near else ""


def in_words(error: BaseException, module: str) -> str:
    """What a plug-in raised, and where in it: `ZeroDivisionError: division by zero (mine.py:12)`.

    Args:
        error: an exception of anybody's making, which need not even be printable.
        module: name of the plug-in's module.
    """
    try:
        text = f"{type(error).__name__}: {error}".removesuffix(": ")
    except Exception:  # noqa: BLE001 - its text is made by anybody's code
        text = type(error).__name__
    undeclared = re.match(rf"AttributeError: '{re.escape(module)}\.(\w+)' object has no attribute '(\w+)'", text)
    if undeclared:  # a law's state and parameters have the fields that are declared, and no others
        text = "{0} has no field {1}: declare it there, `{1}: float`".format(*undeclared.groups())
    places = [
        f" ({PurePath(frame.f_code.co_filename).name}:{line})"
        for frame, line in walk_tb(error.__traceback__)
        if frame.f_globals.get("__name__") == module
    ]
    return text + "".join(places[-1:])
