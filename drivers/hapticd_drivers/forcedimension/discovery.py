"""Which devices the SDK finds, and how one of them is opened."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass

import usb.core

from hapticd.contracts.driver import FoundDevice
from hapticd.contracts.errors import DeviceBusyError, DeviceNotFoundError, DriverError, PluginError
from hapticd_drivers.forcedimension import presence
from hapticd_drivers.forcedimension.models import FALCON_TYPE, MODELS
from hapticd_drivers.forcedimension.sdk import Sdk

_in_use: set[int] = set()
"""IDs that drivers of this process have open: the SDK gives them again to whoever opens the same device."""


@dataclass(frozen=True, slots=True)
class OpenDevice:
    """A device that has just been opened.

    Attributes:
        id: the SDK's number for it.
        type: number of the kind of device.
        serial: serial number.
    """

    id: int
    type: int
    serial: int


def open_device(sdk: Sdk, serial: int | None) -> OpenDevice:
    """Open the device with a serial number, or the first one that hapticd knows.

    Raises:
        DriverError: there is none, or it cannot be opened.
    """
    others = []
    refusals: list[DriverError] = []
    for found in _each(sdk):
        if isinstance(found, DriverError):
            refusals.append(found)
        elif found.id in _in_use:
            refusals.append(
                DeviceBusyError(f"omega7: {_name(found.type)} {found.serial} is already open in this process")
            )
        elif (serial is None or found.serial == serial) and found.type in MODELS:
            _in_use.add(found.id)
            return found
        else:
            others.append(f"{_name(found.type)} {found.serial}")
            _release(sdk, found.id)
    if others and serial is not None and not refusals:
        raise DeviceNotFoundError(f"omega7: no device has serial number {serial}; there is {', '.join(others)}")
    if refusals:
        raise _told(sdk, refusals[0])
    if others:
        raise DeviceNotFoundError(f"omega7: hapticd does not know how to use {', '.join(others)}")
    raise presence.explain()


def close_device(sdk: Sdk, device_id: int) -> None:
    """Give a device back; whatever the SDK says to it."""
    _in_use.discard(device_id)
    sdk.drdClose(device_id)


def find_devices(library: str | None = None) -> list[FoundDevice]:
    """Every Force Dimension device that is there, whether it can be used or not; opens each for a moment.

    Args:
        library: where the SDK is, as in [device.options].
    """
    try:
        on_bus = presence.look()
    except usb.core.NoBackendError:
        on_bus = []
    devices = []
    try:
        sdk = Sdk(library)
        for found in _each(sdk):
            if isinstance(found, DriverError):
                devices.append(FoundDevice("Force Dimension device", "", problem=str(_told(sdk, found))))
                continue
            known = found.type in MODELS
            calibrated = sdk.drdIsInitialized(found.id)
            busy = found.id in _in_use
            devices.append(
                FoundDevice(
                    _name(found.type),
                    str(found.serial),
                    problem="" if known and not busy else "in use" if busy else "hapticd does not know how to use it",
                    note="" if calibrated else "not calibrated since it was switched on: hapticd calibrate",
                )
            )
            _release(sdk, found.id)
    except PluginError as error:
        return [FoundDevice("Force Dimension device", "", device.where, str(error)) for device in on_bus]
    if not devices:
        reason = str(presence.explain()) if on_bus else ""
        devices = [
            FoundDevice("Force Dimension device", "", device.where, str(device.problem or reason)) for device in on_bus
        ]
    return devices


def _each(sdk: Sdk) -> Iterator[OpenDevice | DriverError]:
    """Open each device that the SDK counts; what is not wanted is closed by the caller."""
    for index in range(max(0, sdk.dhdGetDeviceCount())):
        device_id = sdk.drdOpenID(index)
        if device_id < 0:
            yield sdk.failure("drdOpenID")
            continue
        number = ctypes.c_ushort(0)
        sdk.dhdGetSerialNumber(ctypes.byref(number), device_id)
        yield OpenDevice(device_id, sdk.dhdGetSystemType(device_id), number.value)


def _release(sdk: Sdk, device_id: int) -> None:
    if device_id not in _in_use:
        sdk.drdClose(device_id)


def _told(sdk: Sdk, refusal: DriverError) -> DriverError:
    """A refusal with what else is known: who holds the device, or that USB does not let this user in."""
    free = sdk.dhdGetAvailableCount() if sdk.has("dhdGetAvailableCount") else -1
    try:
        seen = [device.problem for device in presence.look() if device.problem is not None]
    except usb.core.NoBackendError:
        seen = []
    if seen:
        return type(seen[0])(f"{seen[0]} ({refusal})")
    if isinstance(refusal, DeviceBusyError) or free == 0:
        return DeviceBusyError(f"{refusal}: another program has the device; end it first")
    return refusal


def _name(device_type: int) -> str:
    if device_type == FALCON_TYPE:
        return "Novint Falcon"
    model = MODELS.get(device_type)
    return f"device of type {device_type}" if model is None else model.name
