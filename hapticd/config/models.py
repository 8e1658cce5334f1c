"""The configuration file whole; every key has its unit, bounds and meaning, here or in the module of its table.

Driver options and law parameters are kept as plain tables here; the driver's and the law's own models check
them when the file is loaded (`hapticd.config.loading`).
"""

from __future__ import annotations

import ipaddress
import re
from typing import Literal

from pydantic import Field, field_validator, model_validator

from hapticd.config.objects import MAX_OBJECTS, ObjectConfig, check_names
from hapticd.config.plugin_tables import ControllerConfig, DeviceConfig, RemoteLawTable
from hapticd.config.remote import MAX_PORTS, CouplingConfig, ForceConfig, check_ports
from hapticd.config.safety import SafetyConfig
from hapticd.config.walls import MAX_WALLS, WallConfig
from hapticd.settings import Table


class LoopConfig(Table):
    """[loop]: how fast the control loop runs and how hard it insists on real time."""

    rate_hz: float = Field(1000.0, ge=100.0, le=8000.0, description="ticks a second [Hz]")
    realtime: Literal["required", "preferred", "off"] = Field(
        "preferred",
        description="required: do not start without SCHED_FIFO and locked memory; preferred: run and warn; off",
    )
    priority: int = Field(80, ge=1, le=98, description="SCHED_FIFO priority")
    cpu: int | None = Field(
        None, ge=0, le=4095, description="processor to stay on; unset: the last one this process may use"
    )
    law_budget: float = Field(
        0.5,
        gt=0.0,
        le=1.0,
        description="share of the period that laws may compute; 3 ticks of 10 above it fail them",
    )

    @property
    def period_ns(self) -> int:
        """Time between deadlines, whole nanoseconds."""
        return round(1e9 / self.rate_hz)

    @property
    def period_s(self) -> float:
        """Time between deadlines [s]."""
        return self.period_ns * 1e-9


class SceneConfig(Table):
    """[scene]: walls across an axis, objects in space, and what clients drive."""

    walls: tuple[WallConfig, ...] = Field((), max_length=MAX_WALLS, description="the walls, at most eight")
    objects: tuple[ObjectConfig, ...] = Field(
        (), max_length=MAX_OBJECTS, description="the objects, at most 64; they need a device with three axes"
    )
    couplings: tuple[CouplingConfig, ...] = Field(
        (), max_length=MAX_PORTS, description="springs to targets that clients move"
    )
    forces: tuple[ForceConfig, ...] = Field((), max_length=MAX_PORTS, description="forces that clients send")

    @field_validator("objects")
    @classmethod
    def _names_differ(cls, objects: tuple[ObjectConfig, ...]) -> tuple[ObjectConfig, ...]:
        check_names(objects)
        return objects

    @model_validator(mode="after")
    def _ports_differ(self) -> SceneConfig:
        check_ports((each.name for each in self.objects), self.couplings, self.forces)
        return self


class VelocityConfig(Table):
    """[velocity]: how velocity is estimated from positions."""

    estimator: Literal["difference", "lowpass", "foaw", "device"] = Field(
        "difference",
        description="difference over `samples`, low-pass of it, first-order adaptive window, or the device's own",
    )
    samples: int = Field(
        1,
        ge=1,
        le=64,
        description="samples that the difference spans; longest window of foaw, 256000 a second over all axes at most",
    )
    cutoff_hz: float = Field(200.0, gt=0.0, le=1e5, description="corner of the low-pass [Hz]")
    noise_m: float | None = Field(
        None,
        ge=0.0,
        le=0.1,
        description="foaw: error bound of a position [m]; unset: the device's resolution",
    )


class TelemetryConfig(Table):
    """[telemetry]: where and how often measurements are published."""

    ipc: bool = Field(True, description="publish on the instance's ipc endpoint")
    tcp: str | None = Field(
        None,
        description="extra TCP endpoint, such as tcp://127.0.0.1:9872; unset: none; off this host, such as "
        "tcp://0.0.0.0:9872, for `hapticd keys` only",
    )
    batch_ticks: int = Field(20, ge=1, le=1000, description="most ticks in one message; 20 ms at the longest")
    every_ticks: int = Field(1, ge=1, le=10000, description="publish one tick in this many; cycles and events always")
    input_every_tick: bool = Field(
        False, description="publish buttons, gripper and orientation with every tick, and not on change only"
    )
    send_high_water: int = Field(
        1000, ge=10, le=100000, description="messages kept for a slow subscriber before it loses new ones"
    )

    @field_validator("tcp")
    @classmethod
    def _is_endpoint(cls, endpoint: str | None) -> str | None:
        return _tcp_endpoint(endpoint, 9872)


class ControlConfig(Table):
    """[control]: where commands are taken besides the instance's own socket."""

    tcp: str | None = Field(
        None, description="TCP endpoint for `hapticd keys` only, such as tcp://0.0.0.0:9873; unset: none"
    )

    @field_validator("tcp")
    @classmethod
    def _is_endpoint(cls, endpoint: str | None) -> str | None:
        return _tcp_endpoint(endpoint, 9873)


class RemoteConfig(RemoteLawTable):
    """[remote]: what other programs drive in the scene, and where they come in besides the instance's own sockets."""

    scene_tcp: str | None = Field(
        None,
        description="TCP endpoint for what they say, for `hapticd keys` only, such as tcp://0.0.0.0:9874; unset: none",
    )
    state_tcp: str | None = Field(
        None,
        description="TCP endpoint for what they are told each tick, for `hapticd keys` only, such as "
        "tcp://0.0.0.0:9875; unset: none",
    )
    lease_s: float = Field(
        1.0, ge=0.1, le=60.0, description="how long a client that says nothing keeps the name that it drives [s]"
    )

    @field_validator("scene_tcp", "state_tcp")
    @classmethod
    def _is_endpoint(cls, endpoint: str | None) -> str | None:
        return _tcp_endpoint(endpoint, 9874)


class ServiceConfig(Table):
    """[service]: how the daemon deals with this file."""

    reload_on_save: bool = Field(
        False, description="take the file over whenever it is saved, as `hapticd reload` does when asked"
    )


class FaultsConfig(Table):
    """[faults]: how many fault records are kept."""

    keep: int = Field(20, ge=0, le=1000, description="fault records kept, the oldest goes first; 0: none are written")


class Config(Table):
    """A whole configuration file."""

    loop: LoopConfig = Field(default_factory=LoopConfig)
    device: DeviceConfig = Field(default_factory=DeviceConfig)
    scene: SceneConfig = Field(default_factory=SceneConfig)
    velocity: VelocityConfig = Field(default_factory=VelocityConfig)
    controller: ControllerConfig = Field(default_factory=ControllerConfig)
    safety: SafetyConfig = Field(default_factory=SafetyConfig)
    telemetry: TelemetryConfig = Field(default_factory=TelemetryConfig)
    control: ControlConfig = Field(default_factory=ControlConfig)
    remote: RemoteConfig = Field(default_factory=RemoteConfig)
    faults: FaultsConfig = Field(default_factory=FaultsConfig)
    service: ServiceConfig = Field(default_factory=ServiceConfig)


def _tcp_endpoint(endpoint: str | None, port: int) -> str | None:
    if endpoint is None:
        return None
    found = re.fullmatch(r"tcp://(?:\[([0-9a-f:]+)\]|([0-9.]+)):([0-9]{1,5})", endpoint, re.IGNORECASE | re.ASCII)
    try:
        address = ipaddress.ip_address(found[1] or found[2]) if found else None
    except ValueError:
        address = None
    if found is None or address is None or not 1 <= int(found[3]) <= 65535:
        raise ValueError(f"must be an address and a port, such as tcp://127.0.0.1:{port}")
    return endpoint
