"""Which devices the SDK finds, and how one of them is opened."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass

from hapticd.device import FoundDevice
from hapticd.errors import ConfigError, DeviceBusyError, DeviceNotFoundError, DriverError, PluginError
from hapticd_drivers.forcedimension import presence
from hapticd_drivers.forcedimension.models import MODELS
from hapticd_drivers.forcedimension.presence import Obstacle, UsbDevice
from hapticd_drivers.forcedimension.processors import on_every_processor
from hapticd_drivers.forcedimension.sdk import GET_SDK, Sdk

ANY = "Force Dimension device"
"""What a device is called that nobody could ask for its model."""

_in_use: set[int] = set()
"""IDs that drivers of this process have open: the SDK gives them again to whoever opens the same device."""


@dataclass(frozen=True, slots=True)
class OpenDevice:
    """A device that has just been opened.

    Attributes:
        id: the SDK's number for it.
        type: number of the kind of device.
        serial: serial number.
        name: what it is called.
    """

    id: int
    type: int
    serial: int
    name: str


def open_device(sdk: Sdk, serial: int | None, unknown: bool = False) -> OpenDevice:
    """Open the device with a serial number, or the first one that can be used.

    Args:
        sdk: the SDK.
        serial: its serial number; None takes any.
        unknown: take a device of a type that hapticd does not know as well.

    Raises:
        ConfigError: there is only one of a type that hapticd does not know.
        DriverError: there is none, or it cannot be opened.
    """
    strangers = []
    others = []
    refusals: list[DriverError] = []
    for found in _each(sdk):
        if isinstance(found, DriverError):
            refusals.append(found)
        elif found.id in _in_use:
            refusals.append(DeviceBusyError(f"omega7: {found.name} {found.serial} is already open in this process"))
        elif serial is not None and found.serial != serial:
            others.append(f"{found.name} {found.serial}")
            _release(sdk, found.id)
        elif found.type in MODELS or unknown:
            _in_use.add(found.id)
            return found
        else:
            strangers.append(f"{found.name} {found.serial}")
            _release(sdk, found.id)
    if strangers:
        raise ConfigError(
            f"device.options.max_force_n is not set: hapticd does not know what {', '.join(strangers)} bears; the "
            "device's data sheet says it"
        )
    if others and not refusals:
        raise DeviceNotFoundError(f"omega7: no device has serial number {serial}; there is {', '.join(others)}")
    if refusals:
        raise _told(sdk, refusals[0])
    raise presence.explain().error()


def close_device(sdk: Sdk, device_id: int) -> None:
    """Give a device back; whatever the SDK says to it."""
    _in_use.discard(device_id)
    sdk.drdClose(device_id)


def find_devices(library: str | None = None) -> list[FoundDevice]:
    """Every Force Dimension device that is there, whether it can be used or not; opens each for a moment.

    Args:
        library: where the SDK is, as in [device.options].
    """
    on_bus = presence.look()
    try:
        sdk = Sdk(library)
        devices = [_described(sdk, found, on_bus) for found in _each(sdk)]
    except PluginError as error:
        problem = str(error).removeprefix("omega7: ")
        return [FoundDevice(ANY, "", device.where, problem, mend=GET_SDK) for device in on_bus]
    return devices or [_unseen(device) for device in on_bus]


def _described(sdk: Sdk, found: OpenDevice | DriverError, on_bus: list[UsbDevice]) -> FoundDevice:
    """What the SDK has just opened, or would not open; it is open no longer afterwards."""
    # Which of several devices on USB is which the SDK does not tell.
    where = on_bus[0].where if len(on_bus) == 1 else ""
    if isinstance(found, DriverError):
        said = str(found).removeprefix("omega7: ")
        obstacle = _obstacle(sdk, found)
        if obstacle is None:
            return FoundDevice(ANY, "", where, said)
        return FoundDevice(ANY, "", where, f"{obstacle.text} ({said})", mend=obstacle.mend)
    problem = note = ""
    model = MODELS.get(found.type)
    if found.id in _in_use:
        problem = "in use"
    elif model is None:
        note = "a type that hapticd does not know: set device.options.max_force_n to what its data sheet says"
    elif not model.to_calibrate:
        note = "without a watchdog: device.accept_no_watchdog = true, once docs/omega7.md has been read"
    elif not sdk.drdIsInitialized(found.id):
        note = "not calibrated since it was switched on: hapticd calibrate, which moves the arm"
    name = f"{found.name}, left-handed" if sdk.dhdIsLeftHanded(found.id) else found.name
    _release(sdk, found.id)
    return FoundDevice(name, str(found.serial), where, problem, note)


def _unseen(device: UsbDevice) -> FoundDevice:
    """A device that USB shows and the SDK does not."""
    obstacle = device.obstacle or presence.unseen(device)
    return FoundDevice(ANY, "", device.where, obstacle.text, mend=obstacle.mend)


def _each(sdk: Sdk) -> Iterator[OpenDevice | DriverError]:
    """Open each device that the SDK counts; what is not wanted is closed by the caller."""
    for index in range(max(0, sdk.dhdGetDeviceCount())):
        with on_every_processor():
            device_id = sdk.drdOpenID(index)
        if device_id < 0:
            yield sdk.failure("drdOpenID")
            continue
        number = ctypes.c_ushort(0)
        sdk.dhdGetSerialNumber(ctypes.byref(number), device_id)
        device_type = sdk.dhdGetSystemType(device_id)
        yield OpenDevice(device_id, device_type, number.value, _name(sdk, device_id, device_type))


def _release(sdk: Sdk, device_id: int) -> None:
    if device_id not in _in_use:
        sdk.drdClose(device_id)


def _told(sdk: Sdk, refusal: DriverError) -> DriverError:
    """A refusal with what else is known of its reason."""
    obstacle = _obstacle(sdk, refusal)
    return refusal if obstacle is None else obstacle.error(str(refusal))


def _obstacle(sdk: Sdk, refusal: DriverError) -> Obstacle | None:
    """What stands behind a refusal: USB does not let this user in, or somebody has the device. None: nobody knows."""
    busy = isinstance(refusal, DeviceBusyError)
    for device in presence.look():
        # With several devices there may be several obstacles: one that fits goes before nothing.
        if device.obstacle is not None and (device.obstacle.kind is DeviceBusyError or not busy):
            return device.obstacle
    free = sdk.dhdGetAvailableCount() if sdk.has("dhdGetAvailableCount") else -1
    if busy or free == 0:
        mend = "# end that program first; while the daemon runs, it is the daemon"
        return Obstacle(DeviceBusyError, "another program has the device", (mend,))
    return None


def _name(sdk: Sdk, device_id: int, device_type: int) -> str:
    if device_type in MODELS:
        return MODELS[device_type].name
    words = sdk.dhdGetSystemName(device_id) if sdk.has("dhdGetSystemName") else None
    return f"{(words or b'device').decode(errors='replace')} of type {device_type}"
