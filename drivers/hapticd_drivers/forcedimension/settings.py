"""What hapticd sets in the SDK and the device: only what is asked for, and the watchdog while forces are on."""

from __future__ import annotations

import ctypes
import math

from hapticd.errors import ConfigError, DeviceFaultError
from hapticd_drivers.forcedimension.failures import NOT_AVAILABLE
from hapticd_drivers.forcedimension.options import MOST_WATCHDOG_MS, WATCHDOG_UNIT_MS, ForceDimensionOptions
from hapticd_drivers.forcedimension.sdk import Sdk

_OLDEST_WITH_WATCHDOG = 3.0  # firmware


def configure(sdk: Sdk, device: int, options: ForceDimensionOptions) -> None:
    """Set what is asked for differently from how the SDK has it; the rest is left alone.

    Raises:
        DriverError: the device refuses.
    """
    if options.base_tilt_deg is not None:
        sdk.call("dhdSetDeviceAngleDeg", options.base_tilt_deg, device)
    if options.effector_mass_kg is not None:
        sdk.call("dhdSetEffectorMass", options.effector_mass_kg, device)
    if options.velocity_window_ms is not None:
        sdk.call("dhdConfigLinearVelocity", options.velocity_window_ms, 0, device)
    if options.time_guard_us is not None:
        with sdk.expert():
            sdk.call("dhdSetTimeGuard", options.time_guard_us, device)


def watchdog_steps(sdk: Sdk, device: int, wanted_ms: float | None, period_s: float) -> int | None:
    """After what silence of this computer the device is to drop its force; nothing is set.

    Args:
        sdk: the SDK.
        device: the device's ID.
        wanted_ms: what the configuration says [ms].
        period_s: time between ticks [s].

    Returns:
        Steps of 125 us, 0 for never; None when the device has no watchdog.

    Raises:
        ConfigError: it would act between two ticks.
        DriverError: the device has one, and does not say how it is set.
    """
    period_ms = 1e3 * period_s
    if wanted_ms is None:
        wanted_ms = min(max(10.0, 4.0 * period_ms), MOST_WATCHDOG_MS)
    if 0.0 < wanted_ms < 2.0 * period_ms:
        raise ConfigError(
            f"device.options.watchdog_ms = {wanted_ms:g}: must be 0, or at least two ticks ({2.0 * period_ms:g} ms)"
        )
    if not (sdk.has("dhdSetWatchdog") and sdk.has("dhdGetWatchdog")) or _firmware(sdk, device) < _OLDEST_WITH_WATCHDOG:
        return None
    with sdk.expert():
        if sdk.dhdGetWatchdog(ctypes.byref(ctypes.c_ubyte(0)), device) < 0:
            if sdk.last_error() in NOT_AVAILABLE:
                return None
            raise sdk.failure("dhdGetWatchdog")
    return math.ceil(wanted_ms / WATCHDOG_UNIT_MS - 1e-9)


def set_watchdog(sdk: Sdk, device: int, steps: int) -> None:
    """Set the device's watchdog, which only force commands feed.

    Args:
        sdk: the SDK.
        device: the device's ID; it has a watchdog.
        steps: of 125 us; 0 switches it off.

    Raises:
        DriverError: the device refuses, or has taken another time.
    """
    taken = ctypes.c_ubyte(0)
    with sdk.expert():
        sdk.call("dhdSetWatchdog", steps, device)
        sdk.call("dhdGetWatchdog", ctypes.byref(taken), device)
    if taken.value != steps:
        raise DeviceFaultError(f"omega7: the device took {taken.value} for a watchdog of {steps} steps of 125 us")


def _firmware(sdk: Sdk, device: int) -> float:
    version = ctypes.c_double(math.inf)
    if sdk.has("dhdGetVersion"):
        sdk.call("dhdGetVersion", ctypes.byref(version), device)
    return version.value
