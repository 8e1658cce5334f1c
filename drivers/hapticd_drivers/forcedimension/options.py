"""[device.options] of driver omega7."""

from __future__ import annotations

from pydantic import Field

from hapticd_drivers.trace import TraceOptions

WATCHDOG_UNIT_MS = 0.125
MOST_WATCHDOG_MS = 255 * WATCHDOG_UNIT_MS


class ForceDimensionOptions(TraceOptions):
    """Which device, where the SDK is, and what is set in the device."""

    serial: int | None = Field(
        None, ge=0, le=65535, description="serial number, `hapticd devices` lists them; unset: the first device"
    )
    library: str | None = Field(
        None,
        min_length=1,
        description="libdrd.so.3 or a directory of the SDK; unset: $FDSDK, the usual places, the loader's",
    )
    base_tilt_deg: float | None = Field(
        None, ge=-180.0, le=180.0, description="tilt of the base about its y axis [deg]; unset: as the SDK has it"
    )
    gravity_compensation: bool = Field(True, description="carry the arm's weight while forces are sent")
    effector_mass_kg: float | None = Field(
        None, ge=0.0, le=2.0, description="mass of the end-effector, where it is not the original one [kg]"
    )
    gripper_button: bool = Field(False, description="a closed gripper is button 0")
    max_force_n: float | None = Field(
        None, gt=0.0, le=100.0, description="force limit set in the SDK as well [N]; unset: the model's own"
    )
    watchdog_ms: float | None = Field(
        None,
        ge=0.0,
        le=MOST_WATCHDOG_MS,
        description="the device drops its force when this computer is silent this long [ms], in steps of 0.125; "
        "0 = never; unset: 10 ms or four ticks",
    )
    velocity_window_ms: int | None = Field(
        None, ge=1, le=1000, description="window of the SDK's velocity [ms]; unset: its own, 20 ms"
    )
    time_guard_us: int | None = Field(
        None, ge=-1, le=100000, description="least time between two transfers [us]; -1 = as advised; unset: untouched"
    )
    status_every_ticks: int = Field(10, ge=1, le=1000, description="ticks between two looks at the device's status")
