"""[safety]: what holds whatever a law asks for."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from hapticd.settings import Table


class SafetyConfig(Table):
    """[safety]: what the guard allows."""

    profile: Literal["device", "simulation"] = Field(
        "device",
        description="simulation lifts these limits, to what the device itself can do; only for simulated devices",
    )
    max_force_n: float | None = Field(
        None, gt=0.0, le=1000.0, description="largest force magnitude [N]; unset: the device's own limit"
    )
    max_axis_force_n: float | None = Field(
        None, gt=0.0, le=1000.0, description="largest force along one axis [N]; unset: as max_force_n"
    )
    max_speed_m_per_s: float | None = Field(
        None,
        gt=0.0,
        le=100.0,
        description="over-speed stop [m/s]; unset: 2 m/s on a real device, none on a simulated one",
    )
    ramp_s: float = Field(
        0.05, ge=0.001, le=1.0, description="duration of every force ramp: arming, switch, release [s]"
    )
    auto_arm: bool = Field(False, description="arm a real device by itself at start and after it reconnects")
    supervisor_stall_s: float = Field(
        10.0,
        ge=0.1,
        le=3600.0,
        description="release the force when the supervisor has been silent this long [s]",
    )
