"""[device.options] that every rig has: how counts become metres, and what a calibration may do."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from hapticd.settings import Table
from hapticd_drivers.rig.messages import MOST_AXES
from hapticd_drivers.trace import TraceOptions

Homing = Literal["low_stop", "high_stop", "low_switch", "high_switch", "here"]


class AxisOptions(Table):
    """[[device.options.axes]]: one axis; what is not set is as the rig says."""

    count_m: float | None = Field(
        None, gt=0.0, le=0.01, description="what a count is at the handle [m]; unset: the rig says it"
    )
    lowest_m: float | None = Field(
        None, ge=-10.0, le=10.0, description="lower end of the travel [m]; unset: the rig says it"
    )
    highest_m: float | None = Field(
        None, ge=-10.0, le=10.0, description="upper end of the travel [m]; unset: the rig says it"
    )
    home_m: float = Field(0.0, ge=-10.0, le=10.0, description="position of the rig's home [m]")
    homing: Homing = Field(
        "low_stop",
        description="how a calibration finds out where the handle is: it drives gently against an end of the travel, "
        "or until the switch at that end closes, or the rig's home is where the handle is",
    )
    reversed: bool = Field(False, description="positions grow where the rig's counts shrink; forces follow")
    motor_reversed: bool = Field(False, description="the motor pushes the other way than the rig means to")
    force_scale: float = Field(
        1.0, gt=0.1, lt=10.0, description="force that a scale shows at the handle when 1 N is commanded [N]"
    )


class RigOptions(TraceOptions):
    """What a rig is, as far as it cannot say so itself, and what a calibration may do."""

    axes: tuple[AxisOptions, ...] = Field((), max_length=MOST_AXES, description="one table an axis")
    max_force_n: float | None = Field(
        None, gt=0.0, le=1000.0, description="force limit below the rig's own [N]; unset: the rig's own"
    )
    moving_mass_kg: float = Field(
        0.05, gt=0.0, le=10.0, description="mass that moves, or less [kg]; the damping of the fallback follows it"
    )
    sign_checked: bool = Field(
        False,
        description="a calibration has shown that the motor pushes the right way, and the wiring is as it was then; "
        "otherwise each start of the daemon needs a calibration before the rig takes forces",
    )
    calibration_force_n: float = Field(
        0.5, gt=0.0, le=5.0, description="largest force of a calibration [N]: enough for friction, no more"
    )
    calibration_speed_m_per_s: float = Field(
        0.02, gt=0.0, le=0.2, description="speed at which a calibration drives the handle [m/s]"
    )
    answer_after_us: int | None = Field(
        None,
        ge=0,
        le=65535,
        description="how long the rig waits with the position that the next tick gets [us]; unset: as the link allows",
    )
