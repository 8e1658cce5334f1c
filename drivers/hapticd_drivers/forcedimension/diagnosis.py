"""What this computer has of what the driver needs: the SDK, and which devices that counts."""

from __future__ import annotations

import os
from pathlib import Path

from hapticd.device import Diagnosis
from hapticd.errors import PluginError
from hapticd_drivers.forcedimension import presence
from hapticd_drivers.forcedimension.options import ForceDimensionOptions
from hapticd_drivers.forcedimension.sdk import ADVISED, ENVIRONMENT, GET_SDK, Sdk, dotted

_CLOSED_TO_SERVICE = ("/home", "/root", "/tmp")


def diagnose(options: ForceDimensionOptions) -> list[Diagnosis]:
    """Say what there is; no device is opened.

    Args:
        options: where the SDK is, and which device is wanted.
    """
    try:
        sdk = Sdk(options.library)
    except PluginError as error:
        return [Diagnosis("problem", str(error).removeprefix("omega7: "), GET_SDK)]
    return [_library(sdk, options.library), _count(sdk, options.serial)]


def _library(sdk: Sdk, wanted: str | None) -> Diagnosis:
    file = _loaded(sdk)
    what = f"Force Dimension SDK {dotted(sdk.version)}, {file}"
    if (0, 0) < sdk.version[:2] < ADVISED:
        return Diagnosis("advice", f"{what}: old, {dotted(ADVISED)} or newer is better", GET_SDK)
    if any(map(file.is_relative_to, _CLOSED_TO_SERVICE)):
        copy = f"sudo cp -a {file.parent}/lib*.so* /usr/local/lib/ && sudo ldconfig"
        return Diagnosis("advice", f"{what}: the system service may not look there", (copy,))
    named = [Path(os.environ[name]).expanduser().resolve() for name in ENVIRONMENT if os.environ.get(name)]
    if wanted is None and any(map(file.is_relative_to, named)):
        key = f'# in the configuration, [device.options]: library = "{file}"'
        return Diagnosis("advice", f"{what}: found by a variable that the system service does not have", (key,))
    return Diagnosis("ok", what)


def _count(sdk: Sdk, serial: int | None) -> Diagnosis:
    count = sdk.dhdGetDeviceCount()
    free = sdk.dhdGetAvailableCount() if sdk.has("dhdGetAvailableCount") else -1
    if count <= 0:
        for device in presence.look():
            if device.obstacle is None:
                obstacle = presence.unseen(device)
                return Diagnosis("problem", obstacle.text, obstacle.mend)
        return Diagnosis("ok", "the SDK finds no device")
    found = "the SDK finds one device" if count == 1 else f"the SDK finds {count} devices"
    if free == 0:
        text = f"{found}, and another program has {'it' if count == 1 else 'them'}: the daemon itself, when it runs"
        return Diagnosis("advice", text, ("hapticd watch  # whether it is the daemon; if not, end that program",))
    if count > 1 and serial is None:
        which = "# in the configuration, [device.options]: serial = ...; hapticd devices lists the numbers"
        return Diagnosis("advice", f"{found}; without a serial number the first that is free is taken", (which,))
    return Diagnosis("ok", found)


def _loaded(sdk: Sdk) -> Path:
    """The file behind what was loaded, which the loader may have found by its name alone."""
    named = Path(sdk.path)
    if named.is_absolute():
        return named.resolve()
    maps = Path("/proc/self/maps").read_text().splitlines()
    files = (line.split(maxsplit=5)[-1].removesuffix(" (deleted)") for line in maps if f"/{named.stem}" in line)
    return next(map(Path, files), named)
