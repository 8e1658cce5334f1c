"""[device.options] of motor controllers: drums, limits, and what a calibration may do."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from hapticd.settings import Table
from hapticd_drivers.motors.link import AUTO
from hapticd_drivers.trace import TraceOptions

MOST_AXES = 3

MOST_ABSOLUTE_TURNS = 0.5
"""No encoder tells one turn from the next: a controller that is switched on assumes the one nearest to 0."""


class DrumOptions(Table):
    """[[device.options.axes]]: one motor, and the drum whose cord pulls the handle along one axis."""

    id: int = Field(ge=0, le=127, description="address of its controller on the bus")
    radius_m: float = Field(
        gt=0.0, le=1.0, description="radius of the drum, up to the middle of the cord [m]; a lever counts as a drum"
    )
    max_torque_n_m: float = Field(
        gt=0.0,
        le=100.0,
        description="largest torque at the shaft that the controller reports [N m]",
    )
    lowest_m: float = Field(ge=-10.0, le=10.0, description="lower end of the travel [m]")
    highest_m: float = Field(ge=-10.0, le=10.0, description="upper end of the travel [m]")
    gear: float = Field(
        1.0, gt=0.0, le=1000.0, description="turns of the shaft that the controller reports for one turn of the drum"
    )
    home_m: float = Field(
        0.0,
        ge=-10.0,
        le=10.0,
        description='position that a controller counts from: with homing = "here" that of the handle in a calibration, '
        'with "absolute" that of turn 0 of the encoder [m]',
    )
    homing: Literal["low_stop", "high_stop", "here", "absolute"] = Field(
        "low_stop",
        description="how a calibration finds out where the handle is: it drives gently against an end of the travel, "
        "or home is where the handle is, or nothing is looked for, since turn 0 of an absolute encoder is home",
    )
    reversed: bool = Field(False, description="positions grow where the shaft turns backwards; forces follow")
    motor_reversed: bool = Field(False, description="the motor pushes the other way than its controller means to")
    force_scale: float = Field(
        1.0, gt=0.1, lt=10.0, description="force that a scale shows at the handle when 1 N is commanded [N]"
    )
    counts_per_turn: int = Field(16384, ge=8, le=1 << 24, description="of the encoder, at the shaft that is reported")

    @property
    def most_turns(self) -> float:
        """Farthest that the shaft is from home in the travel [turns]."""
        way_m = max(abs(end_m - self.home_m) for end_m in (self.lowest_m, self.highest_m))
        return way_m * self.gear / (2.0 * math.pi * self.radius_m)


class MotorOptions(TraceOptions):
    """Which adapter, which motors, and what a calibration may do."""

    channel: str = Field(
        AUTO,
        pattern=r"^(auto|/.+|[A-Za-z0-9_.-]{1,15})$",
        description='a serial adapter, "/dev/ttyACM0"; a CAN interface of the kernel, "can0"; or "auto": the only one',
    )
    axes: tuple[DrumOptions, ...] = Field(min_length=1, max_length=MOST_AXES, description="one table a motor")
    max_force_n: float | None = Field(
        None, gt=0.0, le=1000.0, description="force limit below what the motors can do [N]; unset: what they can do"
    )
    moving_mass_kg: float = Field(
        0.05, gt=0.0, le=10.0, description="mass that moves, or less [kg]; the damping of the fallback follows it"
    )
    sign_checked: bool = Field(
        False,
        description="a calibration has shown that the motors push the right way, and the wiring is as it was then; "
        "otherwise each start of the daemon needs a calibration before the device takes forces",
    )
    calibration_force_n: float = Field(
        0.5, gt=0.0, le=5.0, description="largest force of a calibration [N]: enough for friction, no more"
    )
    calibration_speed_m_per_s: float = Field(
        0.02, gt=0.0, le=0.2, description="speed at which a calibration drives the handle [m/s]"
    )


def refuse_axes(options: MotorOptions) -> None:
    """Refuse axes that cannot be.

    Raises:
        ValueError: two with one address, a travel without length, or of more turns than an absolute encoder knows.
    """
    seen = set()
    for index, axis in enumerate(options.axes):
        key = f"device.options.axes[{index}]"
        if axis.lowest_m >= axis.highest_m:
            raise ValueError(f"{key}.lowest_m = {axis.lowest_m:g}: must be below highest_m = {axis.highest_m:g}")
        if axis.id in seen:
            raise ValueError(f"{key}.id = {axis.id}: another axis has this address")
        seen.add(axis.id)
        if axis.homing == "absolute" and axis.most_turns >= MOST_ABSOLUTE_TURNS:
            raise ValueError(
                f'{key}.homing = "absolute": the encoder knows where the shaft is within a turn, which turns up to '
                f"{axis.most_turns:.2g} times from home_m: take another homing, or keep lowest_m and highest_m within "
                "half a turn of home_m"
            )
